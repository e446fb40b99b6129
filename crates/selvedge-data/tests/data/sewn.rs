//! A sewn cloth in files: what is written comes back, and other programs get a texture coordinate
//! per corner, or per vertex with a way back.

use crate::export::gltf::Glb;
use crate::help::{run, says, write};
use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};
use selvedge_data::export::{ExportFormat, ExportOptions, FrameSpan};
use selvedge_data::{LoadedScene, MeshOptions, Trajectory, parse_scene, read_mesh, read_obj};
use serde_json::Value;
use std::path::Path;

/// Two squares sewn along 1-2, the second mirrored and apart in the pattern.
fn cloth() -> Cloth {
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let at = [
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (2.0, 0.0),
        (2.0, 1.0),
    ];
    let flat = at.map(Vec2::from);
    let mut points = flat.to_vec();
    for v in [4, 5, 1, 2] {
        let mirrored = Vec2::new(10.0 - flat[v].x, flat[v].y);
        if v > 3 {
            points[v] = mirrored
        } else {
            points.push(mirrored)
        }
    }
    let arrays = ClothArrays {
        rest_positions: flat.iter().map(|p| p.extend(0.25)).collect(),
        material_coordinates: points,
        vertex_mass: vec![0.1; 6],
        face_area: vec![0.5; 4],
    };
    let corners = vec![[0, 1, 2], [0, 2, 3], [6, 4, 5], [6, 5, 7]];
    let topology = Topology::new(6, &faces).unwrap();
    Cloth::sewn(topology, Handles::new(&[3], 6).unwrap(), arrays, corners).unwrap()
}

fn trajectory() -> Trajectory {
    let cloth = cloth();
    let shifted = |by: f32| {
        cloth
            .rest_positions()
            .iter()
            .map(move |p| *p + by * Vec3::Y)
    };
    let positions = shifted(0.0).chain(shifted(0.5)).collect();
    run(cloth.clone(), 60.0, positions)
}

fn exported(format: ExportFormat, frames: FrameSpan, path: &Path) {
    let options = ExportOptions {
        frames,
        ..ExportOptions::plain(format)
    };
    write(&trajectory(), path, &options);
}

#[test]
fn a_trajectory_of_a_sewn_cloth_comes_back_and_has_a_version_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.safetensors");
    trajectory().write(&path).unwrap();
    assert_eq!(Trajectory::read(&path).unwrap(), trajectory());
    let bytes = std::fs::read(&path).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    // A reader of version 1 says that it expected 1 and found 2.
    assert!(text.contains("\"version\":\"2\""));
    // A point that two vertices share is refused.
    let mut spoilt = bytes.clone();
    let data = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize + 8;
    let header: Value = serde_json::from_slice(&bytes[8..data]).unwrap();
    let start = header["pattern_faces"]["data_offsets"][0].as_u64().unwrap() as usize + data;
    spoilt[start + 4 * 6] = 3;
    says(
        Trajectory::from_bytes(&spoilt).unwrap_err(),
        &["point 3 of the pattern belongs to vertices"],
    );
}

#[test]
fn an_archive_of_a_sewn_cloth_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    exported(ExportFormat::Npz, FrameSpan::default(), &path);
    let read = Trajectory::from_npz(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(read.cloth(), trajectory().cloth());
    assert_eq!(read.positions(), trajectory().positions());
}

#[test]
fn an_obj_of_a_sewn_cloth_has_its_texture_per_corner_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    exported(ExportFormat::Obj, "0".parse().unwrap(), &path);
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(
        text.lines().filter(|line| line.starts_with("v ")).count(),
        6
    );
    assert_eq!(
        text.lines().filter(|line| line.starts_with("vt ")).count(),
        8
    );
    assert!(text.contains("f 2/7 5/5 6/6\n"), "{text}");
    let mesh = read_obj(&path).unwrap().mesh;
    let (expected, pattern) = (cloth(), mesh.pattern());
    assert_eq!(mesh.topology(), expected.topology());
    assert_eq!(pattern.corners(), expected.pattern().corners());
    let points: Vec<Vec2> = pattern.points().iter().map(|p| p.as_vec2()).collect();
    assert_eq!(points, expected.material_coordinates());
}

#[test]
fn a_stage_of_a_sewn_cloth_has_texture_coordinates_that_vary_over_faces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usda");
    exported(ExportFormat::Usda, FrameSpan::default(), &path);
    let text = std::fs::read_to_string(&path).unwrap();
    let st = text.split("primvars:st = [").nth(1).unwrap();
    let (values, after) = st.split_once(']').unwrap();
    assert_eq!(values.matches('(').count(), 12);
    says(values, &["(0, 0), (1, 0), (1, 1), (0, 0)"]);
    assert!(
        after
            .trim_start()
            .starts_with("(\n            interpolation = \"faceVarying\"")
    );
}

#[test]
fn a_gltf_of_a_sewn_cloth_is_split_along_its_seams_with_a_way_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    exported(ExportFormat::Glb, FrameSpan::default(), &path);
    let glb = Glb::read(&path);
    let primitive = &glb.json["meshes"][0]["primitives"][0];
    let number = |accessor: &Value| accessor.as_u64().unwrap() as usize;
    let floats = |name: &str| glb.floats(number(&primitive["attributes"][name]));
    let back = floats("_VERTEX");
    assert_eq!(back, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 1.0, 2.0]);
    let positions = floats("POSITION");
    for (point, &vertex) in back.iter().enumerate() {
        let place = Vec3::from_slice(&positions[3 * point..]);
        assert_eq!(place, trajectory().frame(0)[vertex as usize]);
    }
    assert_eq!(floats("TEXCOORD_0").len(), 16);
    let indices = glb.words(number(&primitive["indices"]));
    let indices = indices.into_iter().map(u32::from_le_bytes);
    assert!(indices.eq(cloth().pattern().corners().into_flattened()));
    let change = glb.floats(number(&primitive["targets"][0]["POSITION"]));
    assert_eq!((change.len(), change[22]), (24, 0.5));
}

#[test]
fn a_sewn_cloth_comes_back_through_gltf_and_usd() {
    let folder = tempfile::tempdir().unwrap();
    let expected: Vec<_> = cloth().pattern().faces().collect();
    for (name, format) in [
        ("a.glb", ExportFormat::Glb),
        ("a.usda", ExportFormat::Usda),
        ("a.usdc", ExportFormat::Usdc),
    ] {
        let path = folder.path().join(name);
        exported(format, FrameSpan::default(), &path);
        let read = read_mesh(&path, MeshOptions::default()).unwrap();
        assert!(read.warnings.is_empty() && !read.is_own_shape, "{name}");
        let mesh = &read.sheet.mesh;
        assert_eq!(mesh.topology(), cloth().topology(), "{name}");
        assert!(mesh.pattern().is_sewn(), "{name}");
        let faces: Vec<_> = mesh.pattern().faces().collect();
        let apart = faces.as_flattened().iter().zip(expected.as_flattened());
        let apart = apart.map(|(p, q)| p.as_vec2().distance(*q));
        assert!(apart.fold(0.0, f32::max) < 1e-6, "{name}");
    }
}

/// A scene of two flat panels of 3 by 3 vertices beside each other, 0.1 m apart, the second moved
/// `away` along z `[m]`, with this table of seams.
fn two_panels(away: f64, seams: &str) -> Result<LoadedScene, String> {
    let mut text = String::new();
    for panel in 0..2 {
        for k in 0..9 {
            let x = 0.3 * f64::from(panel) + 0.1 * f64::from(k % 3);
            text += &format!("v {x} {} 0\n", -0.1 * f64::from(k / 3));
        }
    }
    for panel in 0..2 {
        let vertex = |i: i32, j: i32| 9 * panel + 3 * j + i + 1;
        text += &format!("o panel{panel}\n");
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)];
            let [a, b, c, d] = corners.map(|(i, j)| vertex(i, j));
            text += &format!("f {a} {b} {c} {d}\n");
        }
        for (name, ends) in [
            ("left", [(0, 0), (0, 1), (0, 2)]),
            ("right", [(2, 0), (2, 1), (2, 2)]),
            ("top", [(0, 0), (1, 0), (2, 0)]),
        ] {
            let [a, b, c] = ends.map(|(i, j)| vertex(i, j));
            text += &format!("g {name}{panel}\nl {a} {b} {c}\n");
        }
        text += "g rest\n";
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("flat.obj"), text).unwrap();
    let scene = format!(
        "name = \"panels\"\nmaterial = \"gray-interlock\"\nstart = \"fit\"\n\
         handles = {{ vertices = [0] }}\nmotion = {{ named = \"forward\" }}\n\
         mesh = {{ file = \"flat.obj\", panels = [{{ panel = \"panel1\", translation = [0, 0, {away}] }}] }}\n\
         seams = [{seams}]\n"
    );
    parse_scene(&scene, folder.path(), "panels").map_err(|error| error.to_string())
}

#[test]
fn panels_are_sewn_over_any_distance() {
    let seam = "{ a = \"right0\", b = \"left1\" }";
    for away in [-0.2, 40.0] {
        let loaded = two_panels(away, seam).unwrap();
        assert_eq!(loaded.scene.mesh.positions().len(), 15);
        assert!(loaded.loose.is_some());
    }
}

#[test]
fn seams_that_make_no_cloth_are_said_to_be_at_fault() {
    for (seams, problem) in [
        // Two borders that meet in a corner: the face there would collapse.
        ("{ a = \"left0\", b = \"top0\" }", "names vertex"),
        (
            "{ a = \"left0\", b = \"left1\" }, { a = \"left0\", b = \"right1\" }",
            "more than two faces",
        ),
    ] {
        let error = two_panels(-0.2, seams).unwrap_err();
        assert!(error.contains(problem), "{error}");
        assert!(error.contains("once the seams are sewn"), "{error}");
    }
}

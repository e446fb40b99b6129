//! A sewn cloth in files: what is written comes back, and other programs get a texture coordinate
//! per corner, or per vertex with a way back.

use crate::export::gltf::Glb;
use crate::help::{exported, run, says, sewn_squares as cloth};
use glam::{Vec2, Vec3};
use selvedge_data::export::ExportFormat;
use selvedge_data::{LoadedScene, MeshOptions, Trajectory, parse_scene, read_mesh};
use serde_json::Value;

pub(crate) fn trajectory() -> Trajectory {
    let cloth = cloth();
    let mut positions = cloth.rest_positions().to_vec();
    positions.extend_from_within(..);
    for moved in &mut positions[6..] {
        moved.y += 0.5;
    }
    run(cloth, 60.0, positions)
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
    let words = ["point 3 of the pattern belongs to vertices"];
    says(Trajectory::from_bytes(&spoilt).unwrap_err(), &words);
}

#[test]
fn an_obj_of_a_sewn_cloth_has_its_texture_per_corner_and_comes_back() {
    let (_folder, path) = exported(&trajectory(), ExportFormat::Obj, "a.obj", |o| {
        o.frames = "0".parse().unwrap();
    });
    let text = std::fs::read_to_string(&path).unwrap();
    let count = |kind: &str| text.lines().filter(|line| line.starts_with(kind)).count();
    assert_eq!(["v ", "vt "].map(count), [6, 8]);
    assert!(text.contains("f 2/7 5/5 6/6\n"), "{text}");
    let read = read_mesh(&path, MeshOptions::default()).unwrap();
    let mesh = read.sheet.mesh;
    let (expected, pattern) = (cloth(), mesh.pattern());
    assert_eq!(mesh.topology(), expected.topology());
    assert_eq!(pattern.corners(), expected.pattern().corners());
    let points: Vec<Vec2> = pattern.points().iter().map(|p| p.as_vec2()).collect();
    assert_eq!(points, expected.material_coordinates());
}

#[test]
fn a_gltf_of_a_sewn_cloth_is_split_along_its_seams_with_a_way_back() {
    let (_folder, path) = exported(&trajectory(), ExportFormat::Glb, "a.glb", |_| {});
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

/// Two flat panels of 2 × 2 quads with named borders, far apart in one plane.
const FLAT: &str = "o panel0\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nv 0 2 0\nv 1 2 0\nv 2 2 0\n\
    f 1 2 5 4\nf 2 3 6 5\nf 4 5 8 7\nf 5 6 9 8\n\
    o panel1\nv 5 0 0\nv 6 0 0\nv 7 0 0\nv 5 1 0\nv 6 1 0\nv 7 1 0\nv 5 2 0\nv 6 2 0\nv 7 2 0\n\
    f 10 11 14 13\nf 11 12 15 14\nf 13 14 17 16\nf 14 15 18 17\n\
    g left0\nl 1 4 7\ng right0\nl 3 6 9\ng low0\nl 1 2 3\ng left1\nl 10 13 16\ng right1\nl 12 15 18\n";

/// A scene of these panels, the second moved `away` along z `[m]`, with this table of seams.
fn two_panels(away: f64, seams: &str) -> Result<LoadedScene, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("flat.obj"), FLAT).unwrap();
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
    // Two borders that meet in a corner: the face there would collapse.
    let corner = "{ a = \"left0\", b = \"low0\" }";
    let thrice = "{ a = \"left0\", b = \"left1\" }, { a = \"left0\", b = \"right1\" }";
    for (seams, problem) in [(corner, "names vertex"), (thrice, "more than two faces")] {
        let error = two_panels(-0.2, seams).unwrap_err();
        says(error, &[problem, "once the seams are sewn"]);
    }
}

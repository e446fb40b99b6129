//! Garments in files of other programs: what Selvedge exports comes back sewn, and a shirt written
//! by a script, as Blender would write it, is one cloth of four panels.

use crate::help::{exported, run, says, table};
use glam::DVec3;
use selvedge_cloth::{Cloth, Handles, Mesh};
use selvedge_data::export::ExportFormat;
use selvedge_data::{
    MeshOptions, PatternSource, ReadMesh, TextureUnit, Trajectory, parse_obj_with, parse_scene,
    read_mesh,
};

/// The mesh as it comes back from a file of this format, and the bytes of the file.
fn back(mesh: &Mesh, format: ExportFormat, name: &str) -> (ReadMesh, Vec<u8>) {
    let vertices = mesh.positions().len();
    let cloth = Cloth::of_mesh(mesh, 0.2, Handles::new(&[0], vertices).unwrap()).unwrap();
    let positions = cloth.rest_positions().to_vec();
    let trajectory = run(cloth, 60.0, positions);
    let again = Trajectory::from_bytes(&trajectory.to_bytes()).unwrap();
    assert_eq!(again, trajectory);
    let (_folder, path) = exported(&trajectory, format, name, |_| {});
    let read = read_mesh(&path, MeshOptions::default()).unwrap();
    (read, std::fs::read(path).unwrap())
}

#[test]
fn exports_have_the_texture_of_the_file_or_none() {
    let tent = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 1 0 2\nv 0 0 2\n";
    let plain = format!("{tent}f 1 2 3\nf 1 3 4\nf 4 3 5\nf 4 5 6\n");
    // Its two sides are apart in an atlas.
    let atlas = format!(
        "{tent}vt 0 0\nvt 0.25 0\nvt 0.25 0.375\nvt 0 0.375\nvt 0.5 0.5\nvt 0.75 0.5\n\
        vt 0.75 0.875\nvt 0.5 0.875\n\
        f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 4/5 3/6 5/7\nf 4/5 5/7 6/8\n"
    );
    let fit = MeshOptions {
        texture: TextureUnit::Fit,
        ..MeshOptions::default()
    };
    let shape = MeshOptions {
        pattern: PatternSource::Shape,
        ..MeshOptions::default()
    };
    let read = |text: &str, options| parse_obj_with(text, options).unwrap().sheet.mesh;
    let own = read(&atlas, MeshOptions::default());
    for (name, format) in [
        ("a.glb", ExportFormat::Glb),
        ("a.usdc", ExportFormat::Usdc),
        ("a.obj", ExportFormat::Obj),
    ] {
        for options in [fit, shape] {
            let (back, _) = back(&read(&atlas, options), format, name);
            assert!(back.warnings.is_empty() && !back.is_own_shape, "{name}");
            let mesh = &back.sheet.mesh;
            assert_eq!(mesh.topology(), own.topology(), "{name}");
            assert!(mesh.pattern().is_sewn(), "{name}");
            assert!(mesh.pattern().faces().eq(own.pattern().faces()), "{name}");
        }
        let bare = read(&plain, MeshOptions::default());
        let (back, bytes) = back(&bare, format, name);
        assert!(back.is_own_shape, "{name}");
        let text = String::from_utf8_lossy(&bytes);
        let texture = ["TEXCOORD", "primvars:st", "vt "];
        assert!(!texture.iter().any(|words| text.contains(words)), "{name}");
        // No vertex is split where there is no texture.
        assert!(!text.contains("_VERTEX"), "{name}");
    }
}

#[test]
fn materials_and_units_of_other_formats_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usda");
    // Centimetres, z up, placed by its parent; corners by index; a subset of faces with a material.
    let text = "#usda 1.0\n(\n    metersPerUnit = 0.01\n    upAxis = \"Z\"\n)\n\
        def Xform \"body\"\n{\n    double3 xformOp:translate = (0, 0, 100)\n\
        uniform token[] xformOpOrder = [\"xformOp:translate\"]\n\
        def Mesh \"skirt\"\n{\n\
        int[] faceVertexCounts = [4, 3]\nint[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]\n\
        point3f[] points = [(0, 0, 0), (10, 0, 0), (10, 0, 10), (0, 0, 10), (20, 0, 5)]\n\
        texCoord2f[] primvars:UVMap = [(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1), (5, 5), (5.1, 5.05), (5, 5.1)] (\n\
        interpolation = \"faceVarying\"\n)\n\
        int[] primvars:UVMap:indices = [0, 1, 2, 3, 4, 5, 6]\n\
        def GeomSubset \"Lining\"\n{\nint[] indices = [1]\n}\n}\n}\n";
    std::fs::write(&path, text).unwrap();
    let read = read_mesh(&path, MeshOptions::default()).unwrap();
    let mesh = &read.sheet.mesh;
    let place = mesh.positions()[2];
    assert!(place.distance(DVec3::new(0.1, 1.1, 0.0)) < 1e-12, "{place}");
    assert_eq!(mesh.fabrics().names, ["Lining"]);
    assert_eq!(mesh.fabrics().of_face, [None, None, Some(0)]);
    assert_eq!(mesh.pattern().panels(), [0, 0, 1]);
    assert_eq!(read.sheet.labels["skirt"].len(), 5);
    let message = |from: &str, to: &str| {
        std::fs::write(&path, text.replace(from, to)).unwrap();
        let read = read_mesh(&path, MeshOptions::default());
        read.unwrap_err().to_string()
    };
    let cases = r#"
        [4, 3] | [4, 4] | sum to 8, but faceVertexIndices has 7
        1, 4, 2]\n | 1, 9, 2]\n | names vertex 9 of 5
        [0, 1, 2, 3, 4, 5, 6] | [0, 1] | 2 texture coordinates, for 7 corners
    "#;
    for [from, to, named] in table(cases) {
        says(message(from, to), &[named]);
    }
    // A body needs no texture coordinates.
    std::fs::write(&path, text.replace("[0, 1, 2, 3, 4, 5, 6]", "[0, 1]")).unwrap();
    let scene = format!(
        "name = \"s\"\nmaterial = \"gray-interlock\"\nmesh.generator = {{ kind = \"square\", vertices = 36, size = 1.0, seed = 1 }}\nobstacles = [{{ name = \"slab\", mesh = \"{}\" }}]\n",
        path.file_name().unwrap().to_string_lossy()
    );
    let loaded = parse_scene(&scene, path.parent().unwrap(), "s").unwrap();
    let words = "2 texture coordinates, for 7 corners";
    assert!(
        loaded.warnings.iter().any(|one| one.contains(words)),
        "{:?}",
        loaded.warnings
    );
    let error = message("def Mesh", "def Xform");
    assert!(error.ends_with("has no mesh, only nodes"), "{error}");
}

//! OBJ files: numbers of vertices are the file's, texture coordinates the material's, and what is
//! not a cloth is an error that names the line or vertex.

use glam::{DVec2, DVec3, Vec2, Vec3};
use proptest::prelude::*;
use selvedge_cloth::generate::Sheet;
use selvedge_data::{MeshFileError, MeshOptions, parse_obj_with, read_mesh, write_obj};

use crate::help::{says, sheet, table};

fn parse_obj(text: &str) -> Result<Sheet, MeshFileError> {
    Ok(parse_obj_with(text, MeshOptions::default())?.sheet)
}

const QUAD: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n";

#[test]
fn two_groups_share_vertices_and_keep_the_numbers_of_the_file() {
    let text = "o cloth\nv 9 0 0\nv 0 0 0\nv 8 0 1\nv 8 1 1\nvt 0 1\nvt 1 0\nvt 0 0\nvt 1 1\n\
        g upper\nf 2/3/1 1/2/1 4/4/1\ng lower left\nf -3/3 4/4 -2/1\n";
    let sheet = parse_obj(text).unwrap();
    assert_eq!(sheet.mesh.positions()[0], DVec3::new(9.0, 0.0, 0.0));
    assert_eq!(sheet.mesh.topology().face_indices(), [[1, 0, 3], [1, 3, 2]]);
    assert_eq!(sheet.mesh.material_coordinates()[2], DVec2::new(0.0, 1.0));
    assert_eq!(sheet.labels["upper"], [0, 1, 3]);
    assert_eq!(sheet.labels["lower"], [1, 2, 3]);
    assert_eq!(sheet.labels["left"], [1, 2, 3]);
    assert_eq!(sheet.labels["cloth"], [0, 1, 2, 3]);
}

/// Only statements go on in the next line; a comment with a folder of Windows in it does not.
#[test]
fn a_comment_ends_with_its_line_whatever_it_ends_in() {
    let plain = parse_obj(&format!("{QUAD}f 1 2 3 4\n")).unwrap();
    let text = format!("# from C:\\shirts\\\n{QUAD}f 1 2 \\\n 3 \\ \n 4 # all \\\n");
    assert_eq!(parse_obj(&text).unwrap().mesh, plain.mesh);
}

/// Readers take a name in capitals as in small letters.
#[test]
fn endings_may_be_capitals() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("QUAD.OBJ");
    std::fs::write(&path, format!("{QUAD}f 1 2 3 4\n")).unwrap();
    let read = read_mesh(&path, MeshOptions::default()).unwrap();
    assert_eq!(read.sheet.mesh.topology().faces().len(), 2);
    assert!(selvedge_data::open_scene(&path.to_string_lossy()).is_ok());
}

#[test]
fn a_flat_sheet_without_texture_gets_isometric_coordinates() {
    // In the plane x = 3, facing -x as a generated sheet: u along z, v up.
    let text = "v 3 -1 5\nv 3 -1 7\nv 3 0 7\nv 3 0 5\nf 1 2 3 4\n";
    let sheet = parse_obj(text).unwrap();
    let expected = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)].map(DVec2::from);
    assert_eq!(sheet.mesh.material_coordinates(), expected);
    // Level, seen from above: u along x, v along -z.
    let text = "v 0 0 0\nv 2 0 0\nv 2 0 -1\nv 0 0 -1\nf 1 2 3 4\n";
    let sheet = parse_obj(text).unwrap();
    assert_eq!(sheet.mesh.material_coordinates(), expected);
}

#[test]
fn a_tilted_sheet_keeps_all_lengths() {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    let mut text = String::new();
    let flat = [(0.0, 0.0), (2.0, 0.1), (2.5, 1.0), (0.2, 1.3)];
    for (x, y) in flat {
        let p = turn * DVec3::new(x, y, 0.0);
        text += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    let sheet = parse_obj(&(text + "f 1 2 3\nf 1 3 4\n")).unwrap();
    let found = sheet.mesh.material_coordinates();
    for i in 0..4 {
        for j in 0..4 {
            let expected = DVec2::from(flat[i]).distance(DVec2::from(flat[j]));
            // Rounding of a few operations on numbers of size 2.
            assert!((found[i].distance(found[j]) - expected).abs() < 1e-14);
        }
    }
}

#[test]
fn equal_texture_coordinates_with_different_numbers_are_no_seam() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0 0\n\
        f 1/1 2/2 3/3\nf 1/5 3/3 4/4\n";
    let sheet = parse_obj(text).unwrap();
    assert_eq!(sheet.mesh.positions().len(), 4);
    let seam = text.replace("vt 0 0\nf", "vt 0.5 0\nf");
    assert_eq!(parse_obj(&seam).unwrap().mesh.pattern().points().len(), 5);
}

#[test]
fn texture_corners_without_coordinates_and_seams_are_warned_of() {
    let read = |text: &str| parse_obj_with(text, MeshOptions::default()).unwrap();
    let made = read(&format!("{QUAD}stitch 1 2\nf 1/1 2/2 3/3 4/4\n"));
    assert_eq!(made.sheet, read(&format!("{QUAD}f 1 2 3 4\n")).sheet);
    let [corners, seams] = &made.warnings[..] else {
        panic!("{:?}", made.warnings);
    };
    let words = ["4 texture corners without coordinates", "first in line 6"];
    says(corners, &words);
    says(seams, &["1 × \"stitch\"", "given by seams in the scene"]);
}

#[test]
fn faces_that_a_weld_makes_alike_or_flat_are_dropped() {
    // A quad of two triangles, the second once more beside it, and a sliver that the weld flattens.
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 0.01\nv 1 1 0.01\nv 0 1 0.01\nv 0.5 0 0\nv 0.5 0.01 0\n\
        f 1 2 3\nf 1 3 4\nf 5 6 7\nf 1 9 2\n";
    let weld = |weld: f64| MeshOptions {
        weld: Some(weld),
        ..MeshOptions::default()
    };
    let made = parse_obj_with(text, weld(0.02)).unwrap();
    assert_eq!(made.sheet.mesh.topology().faces().len(), 2);
    let dropped = "2 faces become one with another, or lose their area";
    says(&made.warnings[0], &[dropped, "first at line 12"]);
    // What is alike in the file stays an error.
    let twice = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0.01\nf 1 2 3\nf 1 2 3\nf 1 2 4\n";
    let error = parse_obj_with(twice, weld(0.02)).unwrap_err();
    says(error, &["have the same three vertices"]);
}

#[test]
fn what_is_not_a_cloth_is_named() {
    let cases = r#"
        v 0 0 0\nv 1 0\n | line 2: expected 3 numbers, found 2
        v 0 0 zero\n | line 1: "zero" is no finite number
        v 0 0 nan\n | line 1: "nan" is no finite number
        v 0 0 0\nf 1 1\n | line 2: a face needs 3 corners
        v 0 0 0\nf 1 2 3\n | line 2: there is no vertex 2 (there are 1 so far)
        v 0 0 0\nf 0 1 1\n | there is no vertex 0
        v 0 0 0\nf -2 1 1\n | there is no vertex -2
        v 0 0 0\nf a 1 1\n | "a" is no number of a vertex
        v 0 0 0\nvt 0 0\nf 1/2 1/1 1/1\n | there is no texture coordinate 2 (there are 1 so far)
        v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\nvt 0 0\n | line 4: this face names a texture coordinate, but the first (vt) comes later
        v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n | line 5: this face of 4 corners crosses itself
        curv 0 1\n | has no faces
        v 0 0 0\n | has no faces
        v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1 2 3\nf 1/1 2/1 3/1\n | line 5: this face has no texture
        v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n | line 4: this face names vertex 2 twice
        v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3 4/4\n | line 9: this face of 4 corners
    "#;
    for [text, expected] in table(cases) {
        says(parse_obj(text).unwrap_err(), &[expected]);
    }
    let missing = std::path::Path::new("no/such.obj");
    let error = read_mesh(missing, MeshOptions::default());
    says(error.unwrap_err(), &["no/such.obj: could not be read"]);
}

#[test]
fn a_byte_order_mark_joined_lines_and_names_in_another_encoding_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let mut bytes = b"\xef\xbb\xbf".to_vec();
    bytes.extend(QUAD.bytes());
    // "Ärmel" in Latin-1.
    bytes.extend(b"g \xc4rmel\nf 1 2 \\\n 3 4 # a comment\n");
    std::fs::write(&path, bytes).unwrap();
    let sheet = read_mesh(&path, MeshOptions::default()).unwrap().sheet;
    assert_eq!(sheet.labels["\u{fffd}rmel"], [0, 1, 2, 3]);
    assert_eq!(sheet.mesh.positions()[1], DVec3::new(2.0, 0.0, 0.0));
}

#[test]
fn faces_that_turn_opposite_ways_are_not_called_curved() {
    // Two triangles of a tilted square: their area vectors cancel, and with them the mean normal.
    let tilted = "v 0 0 0\nv 1 0 1\nv 1 1 1\nv 0 1 0\n";
    let sheet = parse_obj(&format!("{tilted}f 1 2 3\nf 1 3 4\n")).unwrap();
    assert_eq!(sheet.mesh.topology().faces().len(), 2);
    let against = format!("{tilted}f 1 2 3\nf 1 4 3\n");
    let turned = parse_obj_with(&against, MeshOptions::default()).unwrap();
    assert!(!turned.is_own_shape);
    assert_eq!(turned.warnings.len(), 1);
    let edges = turned.sheet.mesh.topology().edges().len();
    assert_eq!(edges, sheet.mesh.topology().edges().len());
}

#[test]
fn a_written_file_is_read_back_exactly() {
    let coordinates = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.7), (0.0, 0.3)].map(Vec2::from);
    let positions = coordinates.map(|c| Vec3::new(c.x / 3.0, 1e-9, c.y * 1e9));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let cloth = sheet(&positions, &coordinates, &[[0, 1, 2], [0, 2, 3]], &[]);
    write_obj(&path, &cloth, &positions).unwrap();
    let read = read_mesh(&path, MeshOptions::default()).unwrap();
    let mesh = read.sheet.mesh;
    assert_eq!(mesh.topology(), cloth.topology());
    let places = mesh.positions().iter().map(|p| p.as_vec3());
    assert!(places.eq(positions));
    let flat = mesh.material_coordinates().iter().map(|c| c.as_vec2());
    assert!(flat.eq(coordinates));
}

proptest! {
    #[test]
    fn any_text_returns(lines in prop::collection::vec("(v|vt|f|o|g|)( (-?[0-9]{1,2}|1/1|/)){0,5}", 0..12)) {
        // Whether it is a cloth is not asserted: only that it never panics.
        let _ = parse_obj(&lines.join("\n"));
    }
}

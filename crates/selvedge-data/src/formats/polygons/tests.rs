//! Tests of meshes of other programs: seams, own shapes, mending and its warnings, errors.

use super::*;
use crate::formats::obj::parse_obj_with;
use crate::test_help::{refuses, says, table};
use glam::{DVec2, DVec3};
use selvedge_cloth::Mesh;
use std::collections::BTreeMap;

fn read(text: &str, edit: impl Fn(&mut MeshOptions)) -> Result<ReadMesh, MeshFileError> {
    let mut options = MeshOptions::default();
    edit(&mut options);
    parse_obj_with(text, options)
}

fn as_is(text: &str) -> ReadMesh {
    read(text, |_| {}).unwrap()
}

fn problem(text: &str) -> String {
    read(text, |_| {}).unwrap_err().to_string()
}

/// Checks that there is one warning, which has these words.
#[track_caller]
fn warns(made: &ReadMesh, words: &[&str]) {
    assert_eq!(made.warnings.len(), 1, "{:?}", made.warnings);
    says(&made.warnings[0], words);
}

/// Checks that the edges have their lengths in space in the pattern, too.
fn assert_lengths(mesh: &Mesh, bound: f64) {
    let lengths = mesh.pattern().edge_lengths();
    for (edge, length) in mesh.topology().edges().iter().zip(lengths) {
        let [a, b] = edge.vertices.map(|v| mesh.positions()[v.index()]);
        assert!((a.distance(b) - length).abs() < bound);
    }
}

fn area(made: &ReadMesh) -> f64 {
    made.sheet.mesh.rest_shape(1.0).face_area.iter().sum()
}

/// Pieces of cloth that no edge joins.
fn pieces(mesh: &Mesh) -> u32 {
    1 + mesh.topology().sheets().iter().max().unwrap()
}

/// Two quads over six vertices, apart in the texture: sewn along 2-3.
const SHIRT: &str = "o shirt\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 9 0\nvt 8 0\nvt 8 1\nvt 9 1\n\
    g front\nusemtl Denim\nf 1/1 2/2 3/3 4/4\ng back\nusemtl Lining blue\nf 2/5 5/6 6/7 3/8\n";

#[test]
fn panels_apart_in_the_texture_are_sewn() {
    let made = as_is(SHIRT);
    let mesh = &made.sheet.mesh;
    assert_eq!(mesh.positions().len(), 6);
    assert_eq!(mesh.pattern().points().len(), 8);
    assert_eq!(mesh.pattern().panels(), [0, 0, 1, 1]);
    assert!(made.warnings.is_empty() && made.velocities.is_none() && !made.is_own_shape);
    let fabrics = mesh.fabrics();
    assert_eq!(fabrics.names, ["Denim", "Lining blue"]);
    assert_eq!(fabrics.of_face, [Some(0), Some(0), Some(1), Some(1)]);
    assert_eq!(made.sheet.labels["back"], [1, 2, 4, 5]);
    assert_eq!(made.sheet.labels["shirt"].len(), 6);
    let cut = read(SHIRT, |o| o.seams = Seams::Cut).unwrap();
    // The vertices of the seam have copies after the others, at the same places.
    let places = cut.sheet.mesh.positions();
    assert_eq!(places.len(), 8);
    assert!(places[6..].contains(&places[1]) && places[6..].contains(&places[2]));
    assert_eq!(cut.sheet.labels["shirt"].len(), 8);
    assert_eq!(pieces(&cut.sheet.mesh), 2);
    assert!(!cut.sheet.mesh.pattern().is_sewn());
}

#[test]
fn a_sheet_that_looks_joined_and_is_not_is_warned_of() {
    // A square beside two of half its height, whose middle corner it lacks.
    let slit = "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 1 1 0\nv 2 0 0\nv 2 1 0\nv 2 2 0\n\
        f 1 2 3 4\nf 2 6 7 5\nf 5 7 8 3\n";
    let first = "1 vertices lie on an edge that they do not belong to";
    let place = "the first is 5, between 2 and 3";
    warns(&as_is(slit), &[first, place]);
    // With the corner, and with one beside the edge, it is no slit.
    for (from, to) in [("1 2 3 4", "1 2 5 3 4"), ("1 1 0", "1.01 1 0")] {
        assert_eq!(as_is(&slit.replace(from, to)).warnings, [""; 0]);
    }
    // The two halves with vertices of their own, and a piece that is far.
    let apart = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\n\
        v 9 0 0\nv 9 1 0\nv 8 1 0\nf 1 2 3 4\nf 5 6 7 8\nf 9 10 11\n";
    let words = ["2 pieces have vertices at the places", "mesh.weld = 9.0e-6"];
    warns(&as_is(apart), &words);
    let welded = read(apart, |o| o.weld = Some(9e-6)).unwrap();
    assert_eq!(welded.warnings, [""; 0]);
}

#[test]
fn each_panel_is_fitted_to_its_size() {
    // The second panel's texture is in another unit, and mirrored.
    let other = "vt 9 0\nvt 6 0\nvt 6 7\nvt 9 7";
    let text = SHIRT.replace("vt 9 0\nvt 8 0\nvt 8 1\nvt 9 1", other);
    let made = read(&text, |o| o.texture = TextureUnit::Fit).unwrap();
    assert_lengths(&made.sheet.mesh, 1e-12);
    let flat = SHIRT.replace("vt 8 1\nvt 9 1", "vt 8 0\nvt 9 0");
    let error = read(&flat, |o| o.texture = TextureUnit::Fit).unwrap_err();
    says(error, &["cannot be stretched"]);
}

#[test]
fn a_cloth_without_a_pattern_takes_its_own_shape() {
    // A tent of two quads.
    let tent = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 1 0 2\nv 0 0 2\n\
        f 1 2 3 4\nf 4 3 5 6\n";
    // Its texture is not asked.
    let textured = tent.replace("f 1 2 3 4", "f 1/1 2/1 3/1 4/1");
    let textured = read(&format!("vt 0 0\n{textured}"), |o| {
        o.pattern = PatternSource::Shape;
    });
    for made in [as_is(tent), textured.unwrap()] {
        assert!(made.is_own_shape);
        let mesh = &made.sheet.mesh;
        assert_lengths(mesh, 1e-15);
        // The wale axis runs up each roof: 1 m along u, √2 m along v.
        for [a, b, c] in mesh.pattern().faces() {
            let extent = a.max(b).max(c) - a.min(b).min(c);
            let expected = DVec2::new(1.0, 2.0_f64.sqrt());
            assert!((extent - expected).abs().max_element() < 1e-15);
        }
    }
    let along = read(tent, |o| o.thread = Some(DVec3::X)).unwrap();
    let shape = along.sheet.mesh.pattern().face(selvedge_cloth::FaceId(0));
    let turned = (shape[1] - shape[0]).y.abs();
    assert!((turned - 1.0).abs() < 1e-15, "{shape:?}");
    let nowhere = read(tent, |o| o.thread = Some(DVec3::ZERO));
    says(nowhere.unwrap_err(), &["mesh.thread must be a direction"]);
}

#[test]
fn statements_that_are_unknown_are_counted_in_one_warning() {
    let text = format!("l 1 2\nny 0 0 0\nl 2 3\n{SHIRT}");
    let words = "3 statements that no mesh of faces has are passed over: 2 × \"l\" (first in line 1), \
        1 × \"ny\" (first in line 2); what is to be sewn is given by seams in the scene, between borders, not by lines";
    assert_eq!(as_is(&text).warnings, [words]);
}

#[test]
fn velocities_and_labels_of_arcsim_are_read() {
    let text = "v 0 0 0\nnv 1 2 3\nv 1 0 0\nv 0 1 0\nnv 0 0 -1\nv 1 1 0\n\
        f 1 2 3\nfl 2\nf 2 4 3\nfl 0\n";
    let made = as_is(text);
    let expected = [
        DVec3::new(1.0, 2.0, 3.0),
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::ZERO,
    ];
    assert_eq!(made.velocities.as_deref(), Some(&expected[..]));
    assert_eq!(made.sheet.mesh.fabrics().names, ["2", "0"]);
    assert_eq!(made.sheet.mesh.fabrics().of_face, [Some(0), Some(1)]);
}

#[test]
fn vertices_without_a_face_are_left_out_with_a_warning() {
    let text = "g all\nv 7 7 7\nv 0 0 0\nnv 1 0 0\nv 1 0 0\nv 8 8 8\nv 0 1 0\nf 2 3 5\n";
    let made = as_is(text);
    let places = [DVec3::ZERO, DVec3::X, DVec3::Y];
    assert_eq!(made.sheet.mesh.positions(), places);
    assert_eq!(made.sheet.labels["all"], [0, 1, 2]);
    let words = "2 vertices belong to no face and are left out, the first is 1";
    warns(&made, &[words]);
    assert_eq!(made.velocities.unwrap()[0], DVec3::X);
}

#[test]
fn faces_against_the_others_are_turned_with_a_warning() {
    let strip = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 2 0\nv 1 2 0\n";
    let good = as_is(&format!("{strip}f 1 2 3\nf 3 2 4\nf 3 4 5\nf 5 4 6\n"));
    let bad = as_is(&format!("{strip}f 1 3 2\nf 3 2 4\nf 3 4 5\nf 5 4 6\n"));
    assert!(good.warnings.is_empty());
    warns(&bad, &["1 faces are turned round", "the first at line 7"]);
    let edges = |made: &ReadMesh| made.sheet.mesh.topology().edges().len();
    assert_eq!(edges(&good), edges(&bad));
    // A Möbius strip of three quads has no such turn.
    let moebius = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 1\nv 2 0 1\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        f 1/1 3/2 4/3 2/4\nf 3/1 5/2 6/3 4/4\nf 5/1 2/2 1/3 6/4\n";
    says(problem(moebius), &["twisted into itself"]);
}

#[test]
fn faces_at_fault_are_named_by_their_lines() {
    let base = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nv 1 1 -1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\n";
    let cases = r#"
        f 1/1 2/2 3/3\nf 2/1 4/2 3/3\nf 3/1 2/2 5/3\n | line 10, line 11, line 12: the edge from vertex 2 to vertex 3
        f 1/1 2/2 3/4\nf 2/1 4/2 5/3\n | line 10: this face has no area in the pattern
        f 1/1 2/2 3/3\nf 3/1 1/2 2/3\nf 2/1 4/2 5/3\n | line 10 and line 11: these faces have the same
    "#;
    for [faces, named] in table(cases) {
        let text = problem(&format!("{base}{faces}"));
        assert!(text.starts_with(named), "{text}");
    }
    // Of its own shape a face has no area in space.
    let text = problem("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 4\nf 1 2 3\n");
    says(
        text,
        &[
            "line 6: this face has no area in space, its vertices are 1, 2, 3",
            "mesh.weld = 1e-6",
        ],
    );
}

#[test]
fn vertices_that_coincide_are_welded_and_their_texture_stays_apart() {
    // The panels of the shirt with vertices of their own, a hair apart.
    let split = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1.00001 0 0\nv 2 0 0\nv 2 1 0\nv 1 0.99999 0\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 9 0\nvt 8 0\nvt 8 1\nvt 9 1\n\
        g front\nf 1/1 2/2 3/3 4/4\ng back\nf 5/5 6/6 7/7 8/8\n";
    let mesh = as_is(split).sheet.mesh;
    assert_eq!(mesh.pattern().panels(), [0, 0, 1, 1]);
    assert_eq!(pieces(&mesh), 2);
    let welded = read(split, |o| o.weld = Some(1e-4)).unwrap();
    let mesh = &welded.sheet.mesh;
    assert_eq!(mesh.positions().len(), 6);
    assert_eq!(pieces(mesh), 1);
    assert_eq!(mesh.pattern().points().len(), 8);
    assert_eq!(welded.sheet.labels["back"], [1, 2, 4, 5]);
    assert!(welded.warnings.is_empty());
    // Vertices that the faces share collapse.
    let flat = read(split, |o| o.weld = Some(3.0)).unwrap_err();
    says(flat, &["has no faces left"]);
    assert!(read(split, |o| o.weld = Some(-1.0)).is_err());
}

#[test]
fn concave_faces_are_cut_inside() {
    // A comb with two teeth, which no fan fills: 15 less 4, whichever way round.
    let comb = "v 0 0 0\nv 5 0 0\nv 5 3 0\nv 4 3 0\nv 4 1 0\nv 3 1 0\nv 3 3 0\nv 2 3 0\nv 2 1 0\n\
        v 1 1 0\nv 1 3 0\nv 0 3 0\n";
    for order in ["1 2 3 4 5 6 7 8 9 10 11 12", "12 11 10 9 8 7 6 5 4 3 2 1"] {
        let made = as_is(&format!("{comb}f {order}\n"));
        assert_eq!(made.sheet.mesh.topology().faces().len(), 10);
        // Of triangles beside each other alone.
        assert!((area(&made) - 11.0).abs() < 1e-12, "{}", area(&made));
    }
    // Whole in space, a line in its texture.
    let text =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 2 0\nvt 3 0\nf 1/1 2/2 3/3 4/4\n";
    says(problem(text), &["texture coordinates", "mesh.pattern"]);
    let shaped = read(text, |o| o.pattern = PatternSource::Shape).unwrap();
    assert!((area(&shaped) - 1.0).abs() < 1e-12, "{}", area(&shaped));
}

/// Two flat panels of 2 × 2 quads with named borders, far apart in one plane.
const FLAT: &str = "g front\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nv 0 2 0\nv 1 2 0\nv 2 2 0\n\
    f 1 2 5 4\nf 2 3 6 5\nf 4 5 8 7\nf 5 6 9 8\n\
    g back\nv 5 0 0\nv 6 0 0\nv 7 0 0\nv 5 1 0\nv 6 1 0\nv 7 1 0\nv 5 2 0\nv 6 2 0\nv 7 2 0\n\
    f 10 11 14 13\nf 11 12 15 14\nf 13 14 17 16\nf 14 15 18 17\n\
    g front-left\nl 1 4 7\ng front-right\nl 3 6 9\ng back-left\nl 10 13 16\ng back-right\nl 12 15 18\n\
    g short\nl 12 15\n";

fn sewn(panels: &[PanelPlace], seams: &[[&str; 2]]) -> Result<ReadMesh, MeshFileError> {
    sewn_as(FLAT, panels, seams, false)
}

fn sewn_as(
    text: &str,
    panels: &[PanelPlace],
    seams: &[[&str; 2]],
    resample: bool,
) -> Result<ReadMesh, MeshFileError> {
    let seams = seams.iter().map(|[a, b]| SeamPair {
        a: (*a).to_owned(),
        b: (*b).to_owned(),
        resample,
    });
    let sewing = Sewing {
        objects: Vec::new(),
        panels: panels.to_vec(),
        seams: seams.collect(),
    };
    sewn_by(text, &sewing)
}

fn sewn_by(text: &str, sewing: &Sewing) -> Result<ReadMesh, MeshFileError> {
    let mut polygons = crate::formats::obj::parse_obj_polygons(text.as_bytes())?;
    sew(&mut polygons, sewing)?;
    assemble(polygons, MeshOptions::default())
}

#[test]
fn flat_panels_are_placed_and_sewn_to_a_tube() {
    // The back is moved behind the front and turned to face away from it.
    let back = PanelPlace {
        panel: "back".to_owned(),
        axis: DVec3::Y,
        angle_deg: 180.0,
        translation: DVec3::new(7.0, 0.0, -0.2),
    };
    let seams = [["front-left", "back-right"], ["front-right", "back-left"]];
    let made = sewn(&[back], &seams).unwrap();
    let mesh = &made.sheet.mesh;
    assert!(made.warnings.is_empty() && !made.is_own_shape);
    assert_eq!(mesh.positions().len(), 12);
    // A tube: V - E + F = 0, in two panels with two seams of two edges.
    let topology = mesh.topology();
    assert_eq!(12 + topology.faces().len(), topology.edges().len());
    assert_eq!(mesh.pattern().panels().iter().max(), Some(&1));
    let edges = topology.edges().iter();
    assert_eq!(edges.filter(|e| mesh.pattern().is_seam(e)).count(), 4);
    // Pairs meet half way, and the pattern is that of the flat panels.
    let z: Vec<f64> = mesh
        .positions()
        .iter()
        .map(|p| (10.0 * p.z).round())
        .collect();
    for (depth, count) in [(0.0, 3), (-1.0, 6), (-2.0, 3)] {
        assert_eq!(z.iter().filter(|z| **z == depth).count(), count, "{z:?}");
    }
    let areas = mesh.rest_shape(1.0).face_area;
    assert!(areas.iter().all(|a| (a - 0.5).abs() < 1e-12));
    assert_eq!(made.sheet.labels["back"].len(), 9);
    // The panels as they were placed: each with its nine vertices.
    let loose = made.loose.unwrap();
    assert_eq!(loose.positions().len(), 18);
    assert_eq!(pieces(&loose.mesh(mesh).unwrap()), 2);
    let is_placed = |p: &DVec3| p.z == 0.0 || (p.z + 0.2).abs() < 1e-12;
    assert!(loose.positions().iter().all(is_placed));
    assert!(sewn(&[], &[]).unwrap().loose.is_none());
}

/// A panel of one quad beside one whose border has four uneven edges, all along x = 1.
const UNEVEN: &str = "g left\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n\
    g right\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 0.7 0\nv 1 0.5 0\nv 1 0.1 0\n\
    f 5 6 7 8 9 10 11\ng one\nl 2 3\ng two\nl 5 11 10 9 8\ng hem\nl 1 4\n";

#[test]
fn a_coarser_border_is_cut_as_the_finer_one_is() {
    for seam in [["one", "two"], ["two", "one"]] {
        let made = sewn_as(UNEVEN, &[], &[seam], true).unwrap();
        let mesh = &made.sheet.mesh;
        assert!(made.warnings.is_empty(), "{:?}", made.warnings);
        // Nothing moves, as the new vertices lie beside those of the other border.
        assert_eq!(mesh.positions().len(), 9);
        let heights = mesh.positions().iter();
        let heights = heights.filter(|p| (p.x - 1.0).abs() < 1e-12).map(|p| p.y);
        let mut heights: Vec<f64> = heights.collect();
        heights.sort_by(f64::total_cmp);
        assert_eq!(heights.len(), 5);
        for (found, expected) in heights.iter().zip([0.0, 0.1, 0.5, 0.7, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{heights:?}");
        }
        assert_eq!(mesh.topology().faces().len(), 5 + 5);
        assert!((area(&made) - 2.0).abs() < 1e-12, "{}", area(&made));
        assert_eq!(made.sheet.labels["one"].len(), 5);
        assert_eq!(pieces(mesh), 1);
    }
}

#[test]
fn sides_of_a_seam_that_are_unlike_in_length_are_warned_of() {
    let short = UNEVEN.replace("v 2 0 0\nv 2 1 0", "v 2 0 0\nv 2 0.5 0");
    let short = short.replace("g hem\nl 1 4\n", "g side\nl 6 7\n");
    let made = sewn_as(&short, &[], &[["side", "one"]], false).unwrap();
    let text = &made.warnings[0];
    says(text, &["\"side\" is 0.500 m long", "\"one\" 1.000 m"]);
}

#[test]
fn seams_that_cannot_be_sewn_are_named() {
    let cases = r#"
        front-left | short | "front-left" has 3 vertices and "short" has 2
        front-left | short | resample = true
        short | short | is to be sewn to itself
        front-left | hem | seams names "hem"
        front-left | hem | back-left
        front | back | are not one line along the border
    "#;
    refuses(cases, |a, b| {
        sewn(&[], &[[a, b]]).map_err(|error| error.to_string())
    });
    let lost = PanelPlace {
        panel: "back".to_owned(),
        axis: DVec3::ZERO,
        angle_deg: 0.0,
        translation: DVec3::ZERO,
    };
    says(sewn(&[lost], &[]).unwrap_err(), &["the place of \"back\""]);
}

#[test]
fn a_seam_that_is_named_twice_is_an_error() {
    let other_name = FLAT.replace("g short", "g outer\nl 3 6 9\ng short");
    let good = ["front-right", "back-left"];
    for (again, resample) in [
        (["front-right", "back-left"], false),
        (["back-left", "front-right"], false),
        (["front-right", "back-left"], true),
        (["outer", "back-left"], false),
    ] {
        let twice = sewn_as(&other_name, &[], &[good, again], resample);
        let words = [good[0], good[1], again[0], again[1], "named twice"];
        says(twice.unwrap_err(), &words);
    }
    let both = sewn(&[], &[good, ["front-left", "back-right"]]).unwrap();
    assert_eq!(both.sheet.mesh.positions().len(), 12);
}

#[test]
fn a_resampled_border_has_its_vertices_at_the_same_parts_of_its_length() {
    // Three edges of a third each against five of a fifth each, a fifth longer.
    let text = "g low\nv 0 0 0\nv 3 0 0\nv 3 1 0\nv 2 1 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 5 6\n\
        g high\nv 0 2 0\nv 0.72 2 0\nv 1.44 2 0\nv 2.16 2 0\nv 2.88 2 0\nv 3.6 2 0\nv 0 3 0\n\
        f 7 8 9 10 11 12 13\ng one\nl 3 4 5 6\ng two\nl 7 8 9 10 11 12\n";
    let made = sewn_as(text, &[], &[["one", "two"]], true).unwrap();
    says(&made.warnings[0], &["the longer one is gathered"]);
    let mesh = &made.sheet.mesh;
    let seams = mesh.topology().edges().iter();
    let seams: Vec<_> = seams.filter(|e| mesh.pattern().is_seam(e)).collect();
    assert_eq!(seams.len(), 5);
    for edge in seams {
        let (left, right) = mesh.pattern().sides(edge);
        let [a, b] = [left.length(), right.unwrap().length()];
        assert!((a.min(b) - 0.6).abs() < 1e-12, "{a} {b}");
        assert!((a.max(b) - 0.72).abs() < 1e-12, "{a} {b}");
    }
    assert!((area(&made) - 4.8).abs() < 1e-12, "{}", area(&made));
}

#[test]
fn one_object_of_a_file_is_taken_by_its_name() {
    let take = |name: &str| {
        let sewing = Sewing {
            objects: vec![name.to_owned()],
            ..Sewing::default()
        };
        sewn_by(SHIRT, &sewing)
    };
    let back = take("back").unwrap();
    let mesh = &back.sheet.mesh;
    assert_eq!(mesh.positions().len(), 4);
    assert_eq!(mesh.topology().faces().len(), 2);
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    assert_eq!(back.sheet.labels["back"], [0, 1, 2, 3]);
    // Vertices that it shares keep the names of the others.
    assert_eq!(back.sheet.labels["front"], [0, 1]);
    assert_eq!(take("shirt").unwrap().sheet.mesh.positions().len(), 6);
    let words = ["mesh.objects names \"hood\"", "front"];
    says(take("hood").unwrap_err(), &words);
}

#[test]
fn rest_angles_of_edges_are_read_and_follow_their_faces() {
    let tent = "v 0 0 0\nv 1 0 0\nv 0 1 1\nv 0 1 -1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 0 -1\n\
        f 1/1 2/2 3/3\nf 2/2 1/1 4/4\ne 2 1\nea 0.5\ne 1 3\nea 0.2\n";
    let angles = |made: &ReadMesh| -> BTreeMap<[u32; 2], f64> {
        let mesh = &made.sheet.mesh;
        let edges = mesh.topology().edges().iter().zip(mesh.rest_angles());
        let each = edges.map(|(edge, angle)| (edge.vertices.map(|v| v.0), *angle));
        each.filter(|(_, angle)| *angle != 0.0).collect()
    };
    let made = as_is(tent);
    assert!(made.has_rest_angles && made.warnings.is_empty());
    assert_eq!(angles(&made)[&[0, 1]], 0.5);
    let none = as_is(&format!("{tent}e 3 4\nea 0.1\n"));
    says(&none.warnings[0], &["from vertex 3 to vertex 4"]);
    let wide = problem(&format!("{tent}ea 4\n"));
    says(wide, &["line 15", "between -π and π"]);
    // Two faces of a sheet of five that run against the others: their fold is turned with them.
    let sheet = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n\
        f 1 2 5\nf 2 6 5\nf 2 3 6\nf 3 6 7\nf 3 7 4\ne 3 7\nea 0.3\n";
    let made = as_is(sheet);
    assert_eq!(made.warnings.len(), 1, "{:?}", made.warnings);
    assert_eq!(angles(&made)[&[2, 6]], -0.3);
}

#[test]
fn a_texture_of_one_point_is_none() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n";
    let made = as_is(text);
    assert!(made.is_own_shape);
    let words = ["all texture coordinates are the same point"];
    says(&made.warnings[0], &words);
}

//! Tests of meshes of other programs: seams, own shapes, mending and its warnings, errors.

use super::*;
use crate::formats::obj::parse_obj_with;
use crate::test_help::says;
use glam::DVec3;
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
    assert_eq!(cut.sheet.mesh.topology().sheets().iter().max(), Some(&1));
    assert!(!cut.sheet.mesh.pattern().is_sewn());
}

#[test]
fn a_sheet_that_looks_joined_and_is_not_is_warned_of() {
    // A square beside two of half its height, whose middle corner it lacks.
    let slit = "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 1 1 0\nv 2 0 0\nv 2 1 0\nv 2 2 0\n\
        f 1 2 3 4\nf 2 6 7 5\nf 5 7 8 3\n";
    let made = as_is(slit);
    assert_eq!(made.warnings.len(), 1, "{:?}", made.warnings);
    let first = "1 vertices lie on an edge that they do not belong to";
    says(
        &made.warnings[0],
        &[first, "the first is 5, between 2 and 3"],
    );
    assert!(
        as_is(&slit.replace("1 2 3 4", "1 2 5 3 4"))
            .warnings
            .is_empty()
    );
    // Beside the edge, it is no slit.
    assert!(
        as_is(&slit.replace("1 1 0", "1.01 1 0"))
            .warnings
            .is_empty()
    );
    // The two halves with vertices of their own, and a piece that is far.
    let apart = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\n\
        v 9 0 0\nv 9 1 0\nv 8 1 0\nf 1 2 3 4\nf 5 6 7 8\nf 9 10 11\n";
    let made = as_is(apart);
    assert_eq!(made.warnings.len(), 1, "{:?}", made.warnings);
    says(
        &made.warnings[0],
        &["2 pieces have vertices at the places", "mesh.weld = 9.0e-6"],
    );
    assert!(
        read(apart, |o| o.weld = Some(9e-6))
            .unwrap()
            .warnings
            .is_empty()
    );
}

#[test]
fn each_panel_is_fitted_to_its_size() {
    // The second panel's texture is in another unit, and mirrored.
    let text = SHIRT.replace(
        "vt 9 0\nvt 8 0\nvt 8 1\nvt 9 1",
        "vt 9 0\nvt 6 0\nvt 6 7\nvt 9 7",
    );
    let made = read(&text, |o| o.texture = TextureUnit::Fit).unwrap();
    let lengths = made.sheet.mesh.pattern().edge_lengths();
    for (edge, length) in made.sheet.mesh.topology().edges().iter().zip(lengths) {
        let [a, b] = edge
            .vertices
            .map(|v| made.sheet.mesh.positions()[v.index()]);
        assert!((a.distance(b) - length).abs() < 1e-12);
    }
    let flat = SHIRT.replace("vt 8 1\nvt 9 1", "vt 8 0\nvt 9 0");
    let error = read(&flat, |o| o.texture = TextureUnit::Fit).unwrap_err();
    says(error, &["cannot be stretched"]);
}

#[test]
fn a_cloth_without_a_pattern_takes_its_own_shape() {
    // A tent of two quads.
    let tent = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 1 0 2\nv 0 0 2\n\
        f 1 2 3 4\nf 4 3 5 6\n";
    for made in [
        as_is(tent),
        // Its texture is not asked.
        read(
            &format!("vt 0 0\n{}", tent.replace("f 1 2 3 4", "f 1/1 2/1 3/1 4/1")),
            |o| {
                o.pattern = PatternSource::Shape;
            },
        )
        .unwrap(),
    ] {
        assert!(made.is_own_shape);
        let mesh = &made.sheet.mesh;
        for (edge, length) in mesh
            .topology()
            .edges()
            .iter()
            .zip(mesh.pattern().edge_lengths())
        {
            let [a, b] = edge.vertices.map(|v| mesh.positions()[v.index()]);
            assert!((a.distance(b) - length).abs() < 1e-15);
        }
        // The wale axis runs up each roof: 1 m along u, √2 m along v.
        for shape in mesh.pattern().faces() {
            let extent = |axis: usize| {
                let values = shape.map(|p| p[axis]);
                values.iter().copied().fold(f64::MIN, f64::max)
                    - values.iter().copied().fold(f64::MAX, f64::min)
            };
            assert!((extent(0) - 1.0).abs() < 1e-15 && (extent(1) - 2.0_f64.sqrt()).abs() < 1e-15);
        }
    }
    let along = read(tent, |o| o.thread = Some(DVec3::X)).unwrap();
    let shape = along.sheet.mesh.pattern().face(selvedge_cloth::FaceId(0));
    assert!(
        ((shape[1] - shape[0]).y.abs() - 1.0).abs() < 1e-15,
        "{shape:?}"
    );
    let nowhere = read(tent, |o| o.thread = Some(DVec3::ZERO)).unwrap_err();
    assert!(
        nowhere
            .to_string()
            .starts_with("mesh.thread must be a direction")
    );
}

#[test]
fn statements_that_are_unknown_are_counted_in_one_warning() {
    let text = format!("l 1 2\nny 0 0 0\nl 2 3\n{SHIRT}");
    let made = as_is(&text);
    assert_eq!(
        made.warnings,
        [
            "3 statements that no mesh of faces has are passed over: 2 × \"l\" (first in line 1), \
            1 × \"ny\" (first in line 2)"
        ]
    );
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
    assert_eq!(
        made.sheet.mesh.positions(),
        [DVec3::ZERO, DVec3::X, DVec3::Y]
    );
    assert_eq!(made.sheet.labels["all"], [0, 1, 2]);
    assert_eq!(made.velocities.unwrap()[0], DVec3::X);
    assert_eq!(made.warnings.len(), 1);
    assert!(
        made.warnings[0]
            .starts_with("2 vertices belong to no face and are left out, the first is 1")
    );
}

#[test]
fn faces_against_the_others_are_turned_with_a_warning() {
    let strip = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 2 0\nv 1 2 0\n";
    let good = as_is(&format!("{strip}f 1 2 3\nf 3 2 4\nf 3 4 5\nf 5 4 6\n"));
    let bad = as_is(&format!("{strip}f 1 3 2\nf 3 2 4\nf 3 4 5\nf 5 4 6\n"));
    assert!(good.warnings.is_empty());
    assert_eq!(bad.warnings.len(), 1);
    assert!(
        bad.warnings[0].starts_with("1 faces are turned round"),
        "{:?}",
        bad.warnings
    );
    assert!(bad.warnings[0].ends_with("the first at line 7"));
    let edges = |made: &ReadMesh| made.sheet.mesh.topology().edges().to_vec();
    assert_eq!(edges(&good).len(), edges(&bad).len());
    // A Möbius strip of three quads has no such turn.
    let text = problem(
        "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 1\nv 2 0 1\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
            f 1/1 3/2 4/3 2/4\nf 3/1 5/2 6/3 4/4\nf 5/1 2/2 1/3 6/4\n",
    );
    assert!(text.contains("twisted into itself"), "{text}");
}

#[test]
fn faces_at_fault_are_named_by_their_lines() {
    let base = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nv 1 1 -1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\n";
    let text = problem(&format!(
        "{base}f 1/1 2/2 3/3\nf 2/1 4/2 3/3\nf 3/1 2/2 5/3\n"
    ));
    assert!(
        text.starts_with("line 10, line 11, line 12: the edge from vertex 2 to vertex 3"),
        "{text}"
    );
    let text = problem(&format!("{base}f 1/1 2/2 3/4\nf 2/1 4/2 5/3\n"));
    assert!(
        text.starts_with("line 10: this face has no area in the pattern"),
        "{text}"
    );
    let text = problem(&format!(
        "{base}f 1/1 2/2 3/3\nf 3/1 1/2 2/3\nf 2/1 4/2 5/3\n"
    ));
    assert!(
        text.starts_with("line 10 and line 11: these faces have the same"),
        "{text}"
    );
}

#[test]
fn vertices_that_coincide_are_welded_and_their_texture_stays_apart() {
    // The panels of the shirt with vertices of their own, a hair apart.
    let split = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1.00001 0 0\nv 2 0 0\nv 2 1 0\nv 1 0.99999 0\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 9 0\nvt 8 0\nvt 8 1\nvt 9 1\n\
        g front\nf 1/1 2/2 3/3 4/4\ng back\nf 5/5 6/6 7/7 8/8\n";
    assert_eq!(as_is(split).sheet.mesh.pattern().panels(), [0, 0, 1, 1]);
    assert_eq!(
        as_is(split).sheet.mesh.topology().sheets().iter().max(),
        Some(&1)
    );
    let welded = read(split, |o| o.weld = Some(1e-4)).unwrap();
    let mesh = &welded.sheet.mesh;
    assert_eq!(mesh.positions().len(), 6);
    assert_eq!(mesh.topology().sheets().iter().max(), Some(&0));
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
    let arrow = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 3 1 0\nv 2 4 0\nv 1 1 0\nv 0 4 0\nf 1 2 3 4 5 6 7\n";
    let made = as_is(arrow);
    let area: f64 = made.sheet.mesh.rest_shape(1.0).face_area.iter().sum();
    // The square less two notches of base 2 and depth 3.
    assert!((area - 10.0).abs() < 1e-12, "{area}");
    let crossed = problem("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n");
    assert!(
        crossed.starts_with("line 5: this face of 4 corners crosses itself"),
        "{crossed}"
    );
    // Whole in space, a line in its texture.
    let text =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 2 0\nvt 3 0\nf 1/1 2/2 3/3 4/4\n";
    let flat = problem(text);
    assert!(
        flat.contains("texture coordinates") && flat.contains("mesh.pattern"),
        "{flat}"
    );
    let shaped = read(text, |o| o.pattern = PatternSource::Shape).unwrap();
    let area: f64 = shaped.sheet.mesh.rest_shape(1.0).face_area.iter().sum();
    assert!((area - 1.0).abs() < 1e-12, "{area}");
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
    let mut polygons = crate::formats::obj::parse_obj_polygons(text.as_bytes())?;
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
    sew(&mut polygons, &sewing)?;
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
    let made = sewn(
        &[back],
        &[["front-left", "back-right"], ["front-right", "back-left"]],
    )
    .unwrap();
    let mesh = &made.sheet.mesh;
    assert!(made.warnings.is_empty() && !made.is_own_shape);
    assert_eq!(mesh.positions().len(), 12);
    // A tube: V - E + F = 0, in two panels with two seams of two edges.
    let topology = mesh.topology();
    assert_eq!(12 + topology.faces().len(), topology.edges().len());
    assert_eq!(mesh.pattern().panels().iter().max(), Some(&1));
    let seams = topology
        .edges()
        .iter()
        .filter(|edge| mesh.pattern().is_seam(edge));
    assert_eq!(seams.count(), 4);
    // Pairs meet half way, and the pattern is that of the flat panels.
    let z: Vec<f64> = mesh
        .positions()
        .iter()
        .map(|p| (10.0 * p.z).round())
        .collect();
    for (depth, count) in [(0.0, 3), (-1.0, 6), (-2.0, 3)] {
        assert_eq!(z.iter().filter(|z| **z == depth).count(), count, "{z:?}");
    }
    assert!(
        mesh.rest_shape(1.0)
            .face_area
            .iter()
            .all(|a| (a - 0.5).abs() < 1e-12)
    );
    assert_eq!(made.sheet.labels["back"].len(), 9);
    // The panels as they were placed: each with its nine vertices.
    let loose = made.loose.unwrap();
    assert_eq!(loose.positions().len(), 18);
    let apart = loose.mesh(mesh).unwrap();
    assert_eq!(apart.topology().sheets().iter().max(), Some(&1));
    assert!(
        loose
            .positions()
            .iter()
            .all(|p| p.z == 0.0 || (p.z + 0.2).abs() < 1e-12)
    );
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
        let places = mesh.positions();
        assert!(places.len() == 9, "{places:?}");
        let mut heights: Vec<f64> = mesh
            .positions()
            .iter()
            .filter(|p| (p.x - 1.0).abs() < 1e-12)
            .map(|p| p.y)
            .collect();
        heights.sort_by(f64::total_cmp);
        let expected = [0.0, 0.1, 0.5, 0.7, 1.0];
        assert!(
            heights
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{heights:?}"
        );
        assert_eq!(mesh.topology().faces().len(), 5 + 5);
        let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
        assert!((area - 2.0).abs() < 1e-12, "{area}");
        assert_eq!(made.sheet.labels["one"].len(), 5);
        assert_eq!(mesh.topology().sheets().iter().max(), Some(&0));
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
    let problem = |seam: [&str; 2]| sewn(&[], &[seam]).unwrap_err().to_string();
    let text = problem(["front-left", "short"]);
    says(
        &text,
        &["\"front-left\" has 3 vertices and \"short\" has 2"],
    );
    assert!(text.contains("resample = true"), "{text}");
    says(problem(["short", "short"]), &["is to be sewn to itself"]);
    says(
        problem(["front-left", "hem"]),
        &["seams names \"hem\"", "back-left"],
    );
    says(
        problem(["front", "back"]),
        &["are not one line along the border"],
    );
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
        let text = twice.unwrap_err().to_string();
        for name in [good[0], good[1], again[0], again[1], "named twice"] {
            assert!(text.contains(name), "{text}");
        }
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
    assert!(made.warnings[0].contains("the longer one is gathered"));
    let mesh = &made.sheet.mesh;
    let seams = mesh.topology().edges().iter();
    let sides: Vec<[f64; 2]> = seams
        .filter(|edge| mesh.pattern().is_seam(edge))
        .map(|edge| {
            let (left, right) = mesh.pattern().sides(edge);
            [left.length(), right.unwrap().length()]
        })
        .collect();
    assert_eq!(sides.len(), 5);
    for lengths in sides {
        let [short, long] = [lengths[0].min(lengths[1]), lengths[0].max(lengths[1])];
        assert!(
            (short - 0.6).abs() < 1e-12 && (long - 0.72).abs() < 1e-12,
            "{lengths:?}"
        );
    }
    let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
    assert!((area - 4.8).abs() < 1e-12, "{area}");
}

#[test]
fn one_object_of_a_file_is_taken_by_its_name() {
    let take = |name: &str| {
        let mut polygons = crate::formats::obj::parse_obj_polygons(SHIRT.as_bytes())?;
        let sewing = Sewing {
            objects: vec![name.to_owned()],
            ..Sewing::default()
        };
        sew(&mut polygons, &sewing)?;
        assemble(polygons, MeshOptions::default())
    };
    let back = take("back").unwrap();
    let mesh = &back.sheet.mesh;
    assert_eq!(
        (mesh.positions().len(), mesh.topology().faces().len()),
        (4, 2)
    );
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    assert_eq!(back.sheet.labels["back"], [0, 1, 2, 3]);
    // Vertices that it shares keep the names of the others.
    assert_eq!(back.sheet.labels["front"], [0, 1]);
    assert_eq!(take("shirt").unwrap().sheet.mesh.positions().len(), 6);
    says(
        take("hood").unwrap_err(),
        &["mesh.objects names \"hood\"", "front"],
    );
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
    says(
        problem(&format!("{tent}ea 4\n")),
        &["line 15", "between -π and π"],
    );
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
    assert!(made.warnings[0].contains("all texture coordinates are the same point"));
}

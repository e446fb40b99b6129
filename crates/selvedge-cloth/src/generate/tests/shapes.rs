//! Every shape and every mesh that has a name: exact counts, areas, placement and labels.

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::quality;
use crate::VertexId;
use crate::generate::*;

const SHAPES: [Shape; 10] = [
    Shape::Square,
    Shape::Long,
    Shape::Wide,
    Shape::Triangle,
    Shape::Diamond,
    Shape::Disc,
    Shape::DrapeDisc,
    Shape::LShape,
    Shape::Holed,
    Shape::Random,
];

fn spec(shape: Shape, vertices: usize) -> SheetSpec {
    SheetSpec {
        shape,
        vertices,
        size: 1.0,
        width: None,
        seed: 1,
    }
}

fn of(shape: Shape, vertices: usize) -> Sheet {
    sheet(&spec(shape, vertices)).unwrap()
}

/// Share of the area of a disc that lies outside of its inscribed polygon of `sides`.
fn missing_from_disc(sides: usize) -> f64 {
    let angle = 2.0 * PI / sides as f64;
    1.0 - angle.sin() / angle
}

/// Smallest angle `[degrees]` above `least`, and edges over their mean within a range.
fn assert_well_formed(mesh: &Mesh, least: f64, edges: Range<f64>, what: &str) {
    let (angle, shortest, longest, _) = quality(mesh);
    let found = format!("{what}: {angle}° {shortest} {longest}");
    assert!(angle > least, "{found}");
    assert!(shortest > edges.start && longest < edges.end, "{found}");
}

#[test]
fn every_shape_has_its_count_area_topology_and_place() {
    for shape in SHAPES {
        for vertices in [40, 289, 700] {
            let sheet = of(shape, vertices);
            let mesh = &sheet.mesh;
            let topology = mesh.topology();
            assert_eq!(topology.vertex_count(), vertices, "{shape:?}");
            // V - E + F: 1 for a disc, 0 with a hole.
            let euler = vertices + topology.faces().len() - topology.edges().len();
            assert_eq!(euler, usize::from(shape != Shape::Holed), "{shape:?}");
            if vertices > 40 {
                let edges = if shape == Shape::DrapeDisc { 0.35..2.4 } else { 0.5..1.7 };
                assert_well_formed(mesh, 25.0, edges, &format!("{shape:?} {vertices}"));
            }
            let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
            // A polygon within the disc, or around which the sheet is cut out.
            let round = match shape {
                Shape::Disc | Shape::DrapeDisc => {
                    -PI / 4.0 * missing_from_disc(sheet.labels["boundary"].len())
                }
                Shape::Holed => 0.04 * PI * missing_from_disc(sheet.labels["hole"].len()),
                _ => 0.0,
            };
            let expected = shape.unit_area() + round;
            assert!(
                (area - expected).abs() < 1e-9,
                "{shape:?}: {area} {expected}"
            );
            let heights = mesh.positions().iter().map(|p| p.y);
            let top = heights.fold(f64::MIN, f64::max);
            assert!(top.abs() < 1e-12, "{shape:?}: {top}");
            let boundary = topology.boundary_vertices();
            let count = boundary.iter().filter(|&&b| b).count();
            assert_eq!(sheet.labels["boundary"].len(), count);
            assert!(boundary[..count].iter().all(|&b| b), "{shape:?}");
        }
    }
}

#[test]
fn labels_are_where_they_say() {
    for shape in SHAPES {
        let sheet = of(shape, 300);
        let at = |label: &str| -> Vec<DVec3> {
            let list = sheet.labels[label].iter();
            list.map(|&v| sheet.mesh.positions()[v as usize]).collect()
        };
        let corners = at("upper-corners");
        let [left, right] = corners[..] else {
            panic!("{shape:?}: two corners");
        };
        if shape == Shape::Random {
            assert!(left.z < right.z, "{left} {right}");
            continue;
        }
        // Level, left before right, and in the middle.
        assert!((left.y - right.y).abs() < 1e-14, "{shape:?}");
        assert!((left.z + right.z).abs() < 1e-14, "{shape:?}");
        let width = match shape {
            Shape::Wide => 1.5,
            Shape::Disc | Shape::DrapeDisc => 0.5_f64.sqrt(),
            _ => 1.0,
        };
        assert!((right.z - left.z - width).abs() < 1e-14, "{shape:?}");
        if let Some(three) = sheet.labels.get("upper-three") {
            assert_eq!([three[0], three[2]], sheet.labels["upper-corners"][..]);
            let middle = at("upper-three")[1];
            assert!(middle.length() < 1e-14, "{shape:?}: {middle}");
        }
        if let Some(hole) = sheet.labels.get("hole") {
            let centre = DVec3::new(0.0, -0.5, 0.0);
            assert!(hole.len() >= 8);
            let off = |p: &DVec3| (p.distance(centre) - 0.2).abs();
            assert!(at("hole").iter().all(|p| off(p) < 1e-14));
        }
    }
    let triangle = of(Shape::Triangle, 300);
    let row = &triangle.labels["upper-row"];
    assert_eq!(row.len(), 17);
    for (k, &vertex) in row.iter().enumerate() {
        let place = triangle.mesh.positions()[vertex as usize];
        assert_eq!(place, DVec3::new(0.0, 0.0, k as f64 / 16.0 - 0.5));
    }
}

#[test]
fn random_outlines_are_decided_by_the_seed_and_well_formed() {
    let random = |seed| {
        let spec = spec(Shape::Random, 300);
        sheet(&SheetSpec { seed, ..spec }).unwrap()
    };
    assert_eq!(random(3), random(3));
    let mut counts = std::collections::BTreeSet::new();
    for seed in 0..40 {
        let sheet = random(seed);
        let area: f64 = sheet.mesh.rest_shape(1.0).face_area.iter().sum();
        assert!((area - 0.7).abs() < 1e-12, "{seed}: {area}");
        assert_well_formed(&sheet.mesh, 20.0, 0.4..2.0, &format!("{seed}"));
        counts.insert(sheet.labels["boundary"].len());
    }
    assert!(counts.len() > 3, "{counts:?}");
}

#[test]
fn meshes_with_a_name_can_be_made_at_the_density_of_the_paper() {
    let mut names = Vec::new();
    for named in named_sheets() {
        let vertices = named.vertices(1024.0);
        let expected = 1024.0 * named.shape.unit_area() * named.size * named.size;
        assert!((vertices as f64 - expected).abs() <= 0.5);
        // A fifth of it, to be quick.
        let sheet = sheet(&named.of(vertices / 5, 1)).unwrap();
        let handles = &sheet.labels[named.handles];
        let expected = match named.name {
            "triangle-17" => 17,
            "diamond" | "wide-3" => 3,
            _ => 2,
        };
        assert_eq!(handles.len(), expected, "{}", named.name);
        assert_eq!(NamedSheet::by_name(named.name), Some(*named));
        names.push(named.name);
    }
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), named_sheets().len());
    assert_eq!(NamedSheet::by_name("cube"), None);
}

#[test]
fn too_few_vertices_for_a_shape_are_an_error_that_says_how_many_it_needs() {
    for (shape, needed) in [(Shape::Triangle, 18), (Shape::Wide, 5), (Shape::LShape, 6)] {
        let error = sheet(&spec(shape, 3)).unwrap_err().to_string();
        let text = format!("a sheet of this shape needs at least {needed} vertices, found 3");
        assert_eq!(error, text);
    }
}

#[test]
fn a_rectangle_is_as_wide_as_it_is_said_to_be() {
    let spec = SheetSpec {
        size: 0.8,
        width: Some(2.0),
        ..spec(Shape::Rectangle, 300)
    };
    let mesh = sheet(&spec).unwrap().mesh;
    let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
    assert!((area - 1.6).abs() < 1e-9);
    assert_eq!(mesh.topology().vertex_count(), 300);
    for width in [0.0, -1.0, f64::NAN] {
        let width = Some(width);
        let error = sheet(&SheetSpec { width, ..spec }).unwrap_err().to_string();
        assert!(error.starts_with("width must be"), "{error}");
    }
}

#[test]
fn a_tube_is_closed_around_and_open_above_and_below() {
    let tubes = [
        (24, 0.1, 0.3),
        (60, 0.5, 1.0),
        (400, 1.0, 0.6),
        (401, 0.3, 2.0),
    ];
    for (vertices, size, width) in tubes {
        let spec = SheetSpec {
            size,
            width: Some(width),
            ..spec(Shape::Tube, vertices)
        };
        let Sheet { mesh, labels } = sheet(&spec).unwrap();
        let topology = mesh.topology();
        assert_eq!(topology.vertex_count(), vertices);
        assert_eq!(vertices + topology.faces().len(), topology.edges().len());
        let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
        assert!((area - size * width).abs() < 1e-9, "{area}");
        let open = topology.edges().iter().filter(|e| e.opposite.1.is_none());
        assert_eq!(open.count(), labels["boundary"].len());
        for (label, height) in [("upper-edge", 0.0), ("lower-edge", -size)] {
            for v in &labels[label] {
                let place = mesh.positions()[*v as usize];
                assert!((place.y - height).abs() < 1e-12);
                assert!((place.with_y(0.0).length() * 2.0 * PI - width).abs() < 1e-9);
            }
        }
        // Edges are as long as in the pattern, but for the chords of the circle: also over the seam.
        for (edge, rest) in topology.edges().iter().zip(mesh.pattern().edge_lengths()) {
            let [a, b] = edge.vertices.map(|v| mesh.positions()[v.index()]);
            let chord = (width / PI) * (PI * rest / width).sin();
            let length = a.distance(b);
            let is_between = length <= rest + 1e-9 && length >= chord - 1e-9;
            assert!(is_between, "{length} {rest}");
        }
        // The outside is outside.
        let face = topology.faces()[0].map(|v| mesh.positions()[v.index()]);
        let normal = (face[1] - face[0]).cross(face[2] - face[0]);
        assert!(normal.dot(face[0].with_y(0.0)) > 0.0);
    }
}

#[test]
fn a_tube_of_too_few_vertices_is_an_error_that_says_how_many_it_needs() {
    let spec = SheetSpec {
        width: Some(0.5),
        ..spec(Shape::Tube, 8)
    };
    let fewer = |vertices| sheet(&SheetSpec { vertices, ..spec });
    let error = fewer(8).unwrap_err().to_string();
    let needed = error.split(' ').find_map(|word| word.parse().ok()).unwrap();
    assert!(fewer(needed).is_ok() && fewer(needed - 1).is_err());
    for vertices in 60..160 {
        assert!(fewer(vertices).is_ok(), "{vertices}");
    }
    let width = Some(1e-5);
    assert!(sheet(&SheetSpec { width, ..spec }).is_err());
}

#[test]
fn the_disc_of_the_drape_test_is_clamped_up_to_a_ring_of_vertices() {
    for (vertices, part) in [(289, 0.5), (840, 0.5), (3600, 1.0)] {
        let sheet = of(Shape::DrapeDisc, vertices);
        let from_middle = |v: &u32| {
            let place = sheet.mesh.material_coordinates()[*v as usize];
            place.distance(DVec2::splat(0.5))
        };
        let clamped = sheet.label("clamped").unwrap();
        let rim = clamped
            .iter()
            .filter(|v| (from_middle(v) - 0.3).abs() < 1e-12);
        // Beside the clamp half as far from each other as at the hem, or 1/60; those of the rim too.
        let mesh = &sheet.mesh;
        let lengths = mesh.pattern().edge_lengths();
        let edges = || mesh.topology().edges().iter().zip(&lengths);
        let mean_within = |from: f64, to: f64| {
            let is_there = |v: VertexId| (from..to).contains(&from_middle(&(v.index() as u32)));
            let there = edges().filter(|(edge, _)| edge.vertices.into_iter().all(is_there));
            let lengths: Vec<f64> = there.map(|(_, length)| *length).collect();
            lengths.iter().sum::<f64>() / lengths.len() as f64
        };
        let (mean, near) = (mean_within(0.0, 0.6), mean_within(0.2999, 0.39));
        let (found, rim) = (near / mean_within(0.43, 0.6), 0.6 * PI / rim.count() as f64);
        assert!((0.9..1.2).contains(&(found / part)), "{vertices}: {found}");
        assert!(
            (0.8..1.25).contains(&(rim / near)),
            "{vertices}: {rim} {near}"
        );
        // All within a little less are held.
        let count = |r: f64| (0..vertices as u32).filter(|v| from_middle(v) < r).count();
        assert!(clamped.len() >= count(0.2999 - 0.1 * mean), "{vertices}");
        assert!(clamped.iter().all(|v| from_middle(v) < 0.3 + 1e-12));
    }
    // The hem is a circle, however few its vertices.
    for vertices in (100..400).step_by(10) {
        let sheet = of(Shape::DrapeDisc, vertices);
        let places = sheet.mesh.material_coordinates();
        let hem = sheet.label("boundary").unwrap().iter();
        let radii = hem.map(|v| places[*v as usize].distance(DVec2::splat(0.5)));
        assert!(
            radii.into_iter().all(|r| (r - 0.5).abs() < 1e-9),
            "{vertices}"
        );
    }
}

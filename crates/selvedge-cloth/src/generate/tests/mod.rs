//! Generated sheets: quality, exact counts, placement, sameness of bytes, other outlines.

mod shapes;

use std::f64::consts::PI;

use proptest::prelude::*;

use super::*;

fn unit_square(vertices: usize, seed: u64) -> Sheet {
    square(vertices, 1.0, seed).unwrap()
}

/// Smallest angle `[degrees]`, shortest and longest edge over the mean, and the mean `[m]`.
pub(super) fn quality(mesh: &Mesh) -> (f64, f64, f64, f64) {
    let uv = mesh.material_coordinates();
    let mut angle = f64::MAX;
    for face in mesh.topology().faces() {
        let p = face.map(|v| uv[v.index()]);
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            angle = angle.min(a.angle_to(b).to_degrees());
        }
    }
    let lengths = mesh.rest_shape(1.0).edge_length;
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    let shortest = lengths.iter().copied().fold(f64::MAX, f64::min);
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    (angle, shortest / mean, longest / mean, mean)
}

#[test]
fn quality_is_that_of_the_reference_mesh() {
    for (vertices, seeds) in [(289, 20), (1024, 6), (2500, 2)] {
        for seed in 0..seeds {
            let sheet = unit_square(vertices, seed);
            let (angle, shortest, longest, mean) = quality(&sheet.mesh);
            assert!(angle > 28.0, "{vertices}, {seed}: {angle}°");
            assert!(shortest > 0.55 && longest < 1.6, "{vertices}, {seed}");
            if vertices == 1024 {
                assert_eq!(sheet.labels["boundary"].len(), 120);
                assert!((mean - 0.0353).abs() < 0.0005, "{mean}");
            }
        }
    }
}

#[test]
fn every_count_is_met_exactly() {
    for vertices in (4..60).chain([100, 331]) {
        let sheet = unit_square(vertices, 7);
        let topology = sheet.mesh.topology();
        assert_eq!(topology.vertex_count(), vertices);
        let boundary = sheet.labels["boundary"].len();
        // Euler for a disc: F = 2 V - 2 - B.
        assert_eq!(topology.faces().len(), 2 * vertices - 2 - boundary);
        let on_boundary = topology.boundary_vertices();
        assert!(on_boundary[..boundary].iter().all(|&b| b));
        assert!(!on_boundary[boundary..].iter().any(|&b| b));
        let area: f64 = sheet.mesh.rest_shape(1.0).face_area.iter().sum();
        assert!((area - 1.0).abs() < 1e-12, "{vertices}: {area}");
    }
}

#[test]
fn the_boundary_is_even_and_runs_clockwise_from_the_upper_left() {
    let size = 0.7;
    let sheet = square(1024, size, 1).unwrap();
    let uv = sheet.mesh.material_coordinates();
    let boundary = &sheet.labels["boundary"];
    let side = boundary.len() / 4;
    let corners = [0, 1, 2, 3].map(|k| uv[k * side]);
    let expected = [DVec2::Y, DVec2::ONE, DVec2::X, DVec2::ZERO];
    assert_eq!(corners, expected.map(|c| size * c));
    for k in 0..boundary.len() {
        let step = uv[k].distance(uv[(k + 1) % boundary.len()]);
        assert!((step - size / side as f64).abs() < 1e-15);
    }
    let at = |label: &str| -> Vec<DVec3> {
        let list = sheet.labels[label].iter();
        list.map(|&v| sheet.mesh.positions()[v as usize]).collect()
    };
    let corner = |y, z| DVec3::new(0.0, y, z);
    let half = size / 2.0;
    assert_eq!(at("upper-corners"), [corner(0.0, -half), corner(0.0, half)]);
    let lower = [corner(-size, -half), corner(-size, half)];
    assert_eq!(at("lower-corners"), lower);
    let upper = at("upper-edge");
    assert_eq!(upper.len(), side + 1);
    assert!(upper.windows(2).all(|p| p[1].z > p[0].z && p[1].y == 0.0));
}

#[test]
fn the_sheet_hangs_unstrained_with_normals_along_minus_x() {
    let sheet = unit_square(100, 3);
    let (uv, world) = (sheet.mesh.material_coordinates(), sheet.mesh.positions());
    for face in sheet.mesh.topology().faces() {
        let [a, b, c] = face.map(|v| world[v.index()]);
        let area = crate::geometry::area_vector(a, b, c);
        let [a, b, c] = face.map(|v| uv[v.index()]);
        let flat = crate::geometry::signed_area_2d(a, b, c);
        assert!(flat > 0.0 && area.distance(DVec3::NEG_X * flat) < 1e-15);
    }
}

#[test]
fn inner_vertices_lie_on_no_grid() {
    let sheet = unit_square(1024, 0);
    let uv = sheet.mesh.material_coordinates();
    let topology = sheet.mesh.topology();
    // Sixfold order over the whole sheet, |mean of exp(6iθ)| over the edges: 1 for a triangular
    // lattice; 0.5 would be a sheet with one dominant lattice.
    let order: DVec2 = topology
        .edges()
        .iter()
        .filter(|edge| !edge.is_boundary())
        .map(|edge| {
            let [a, b] = edge.vertices.map(|v| uv[v.index()]);
            DVec2::from_angle(6.0 * (b - a).to_angle())
        })
        .sum();
    let order = order.length() / topology.edges().len() as f64;
    assert!(order < 0.3, "{order}");
    // Edges within 5° of one of the six directions of a lattice: by chance 10° of 60°, a sixth;
    // in a lattice all of them.
    let along = |angle: f64| {
        let near = topology.edges().iter().filter(|edge| {
            let [a, b] = edge.vertices.map(|v| uv[v.index()]);
            let off = ((b - a).to_angle() - angle).rem_euclid(PI / 3.0);
            !edge.is_boundary() && off.min(PI / 3.0 - off) < 5.0_f64.to_radians()
        });
        near.count() as f64 / topology.edges().len() as f64
    };
    for k in 0..6 {
        let share = along(f64::from(k) * PI / 18.0);
        assert!(share < 0.35, "{share} of the edges lie along {k} · 10°");
    }
}

/// FNV-1a of everything in the mesh.
fn checksum(mesh: &Mesh) -> u64 {
    let numbers = mesh.material_coordinates().iter().flat_map(|c| [c.x, c.y]);
    let numbers = numbers.map(f64::to_bits);
    let faces = mesh.topology().face_indices().into_iter().flatten();
    let words = numbers.chain(faces.map(u64::from));
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        word.to_le_bytes().iter().fold(hash, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    })
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    // Recorded once on x86-64; any other machine must agree. A new value here means that all
    // meshes made from a seed change, and with them every data set made on them.
    assert_eq!(checksum(&unit_square(289, 42).mesh), GOLDEN_289_42);
    assert_eq!(unit_square(289, 42), unit_square(289, 42));
    assert_ne!(unit_square(289, 42), unit_square(289, 43));
}

const GOLDEN_289_42: u64 = 17_240_291_985_909_377_471;

#[test]
fn size_only_scales() {
    let (one, big) = (unit_square(120, 5).mesh, square(120, 4.0, 5).unwrap().mesh);
    assert_eq!(one.topology(), big.topology());
    let scaled = one.material_coordinates().iter().map(|c| 4.0 * *c);
    assert_eq!(scaled.collect::<Vec<_>>(), big.material_coordinates());
}

#[test]
fn wrong_numbers_are_errors() {
    let error = |vertices, size| square(vertices, size, 0).unwrap_err().to_string();
    let few = "a sheet of this shape needs at least 4 vertices, found 3";
    assert_eq!(error(3, 1.0), few);
    let many = "vertices must be at most 1000000, found 1000001";
    assert_eq!(error(MOST_VERTICES + 1, 1.0), many);
    for size in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        let text = format!("size must be finite and positive, found {size} m");
        assert_eq!(error(10, size), text);
    }
}

fn area(sheet: &FlatSheet) -> f64 {
    let of = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| sheet.points[v as usize]);
        crate::geometry::signed_area_2d(a, b, c)
    };
    assert!(sheet.faces.iter().all(|f| of(f) > 0.0));
    sheet.faces.iter().map(of).sum()
}

#[test]
fn an_outline_without_area_or_that_crosses_itself_is_an_error() {
    let polygon = |points: &[(f64, f64)]| -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    };
    let cut = |outline| Cut::of(outline, DVec2::ONE, Vec::new());
    let square = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)];
    let shapes = [
        vec![polygon(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])],
        vec![polygon(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])],
        vec![polygon(&[(0.0, 0.0), (1.0, 1.0), (1.0, 1.0 + 1e-6)])],
        vec![polygon(&square), polygon(&square)],
        vec![polygon(&[(0.0, 0.0), (1.0, f64::NAN), (1.0, 0.0)])],
        vec![],
    ];
    for loops in shapes {
        let cut = Cut {
            loops,
            ..cut(vec![])
        };
        let error = sheet_from_outline(&cut, 60, 0).unwrap_err().to_string();
        assert!(error.starts_with("the outline encloses"), "{error}");
    }
    let bow = vec![DVec2::ZERO, DVec2::ONE, DVec2::X, DVec2::Y * 0.9];
    let error = sheet_from_outline(&cut(bow), 60, 0)
        .unwrap_err()
        .to_string();
    let crossed = "the sheet cannot be triangulated";
    assert!(error.starts_with(crossed), "{error}");
    // A strip across the diagonal, a thousandth of the rectangle around it, is covered.
    let strip = polygon(&[(0.0, 0.0), (1.0, 1.0), (1.0, 1.002)]);
    let sheet = sheet_from_outline(&cut(strip), 60, 0).unwrap();
    assert!((area(&sheet) - 0.001).abs() < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Any seed, from 16 vertices on (fewer leave no room for choice): the right count, and no
    /// angle below the 28° that we promise; the relaxation aims at 30°.
    #[test]
    fn any_square_is_sound(vertices in 16..400_usize, seed in any::<u64>()) {
        let sheet = unit_square(vertices, seed);
        prop_assert_eq!(sheet.mesh.topology().vertex_count(), vertices);
        let (angle, ..) = quality(&sheet.mesh);
        prop_assert!(angle > 28.0, "{}°", angle);
    }
}

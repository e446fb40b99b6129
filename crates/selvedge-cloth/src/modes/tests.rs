//! Modes of squares against their closed form, and the properties that others rely on.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::Modes;
use crate::generate::{SquareSpec, square};
use crate::{Cloth, Handles, Mesh};

fn sheet(vertices: usize, seed: u64) -> Mesh {
    let spec = SquareSpec {
        vertices,
        size: 1.0,
        seed,
    };
    square(&spec).expect("a square").mesh
}

fn cloth(mesh: &Mesh) -> Cloth {
    let handles = Handles::new(&[0], mesh.positions().len()).expect("a handle");
    Cloth::of_mesh(mesh, 0.2, handles).expect("a cloth")
}

/// Σ over modes of e^(-λ t) φ_i φ_j a_j: what a heat source of vertex j is at vertex i.
fn heat(modes: &Modes, time: f64, from: usize, to: usize) -> f64 {
    let count = modes.count();
    let at = |vertex: usize| &modes.values[vertex * count..][..count];
    let waves = at(from).iter().zip(at(to)).zip(&modes.eigenvalues);
    waves
        .map(|((a, b), lambda)| a * b * (-lambda * time).exp())
        .sum()
}

#[test]
fn a_square_has_the_waves_of_a_square() {
    let modes = Modes::of(&cloth(&sheet(1600, 1)), 12);
    let mut expected: Vec<f64> = (0..6)
        .flat_map(|a| (0..6).map(move |b| PI * PI * f64::from(a * a + b * b)))
        .collect();
    expected.sort_by(f64::total_cmp);
    assert!(modes.eigenvalues[0].abs() < 1e-6, "{:?}", modes.eigenvalues);
    for (found, expected) in modes.eigenvalues.iter().zip(&expected).skip(1) {
        // Linear elements of 25 mm with lumped areas: (k h)² / 12 and the irregular mesh.
        assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
    }
}

#[test]
fn modes_are_orthonormal_under_the_shares_of_area() {
    for (vertices, count) in [(400, 32), (64, 16), (25, 40)] {
        let modes = Modes::of(&cloth(&sheet(vertices, 2)), count);
        assert_eq!(modes.count(), count.min(vertices));
        assert!((modes.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let count = modes.count();
        let rows = modes.values.chunks_exact(count).zip(&modes.shares);
        let mut products = vec![0.0; count * count];
        for (row, share) in rows {
            for (k, a) in row.iter().enumerate() {
                for (l, b) in row.iter().enumerate() {
                    products[k * count + l] += share * a * b;
                }
            }
        }
        for (place, product) in products.iter().enumerate() {
            let expected = f64::from(place % count == place / count);
            assert!((product - expected).abs() < 1e-9, "{vertices}: {product}");
        }
    }
}

#[test]
fn a_subspace_finds_what_the_whole_matrix_has() {
    let cloth = cloth(&sheet(200, 3));
    // 150 modes of 200 vertices take the dense way, 20 the other.
    let [few, many] = [20, 150].map(|count| Modes::of(&cloth, count));
    assert!((few.next / many.eigenvalues[20] - 1.0).abs() < 1e-6);
    for (a, b) in few.eigenvalues.iter().zip(&many.eigenvalues).skip(1) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
    let whole = Modes {
        eigenvalues: many.eigenvalues[..20].to_vec(),
        values: many
            .values
            .chunks_exact(150)
            .flat_map(|row| row[..20].to_vec())
            .collect(),
        ..many
    };
    for (from, to) in [(0, 0), (3, 90), (150, 77)] {
        let [a, b] = [&few, &whole].map(|modes| heat(modes, 0.01, from, to));
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn the_numbering_of_vertices_does_not_matter() {
    let mesh = sheet(300, 4);
    let count = mesh.positions().len();
    let number = |v: usize| (v * 7 + 11) % count;
    let mut places = vec![DVec3::ZERO; count];
    let mut flat = vec![DVec2::ZERO; count];
    for v in 0..count {
        places[number(v)] = mesh.positions()[v];
        flat[number(v)] = mesh.pattern().points()[v];
    }
    let faces: Vec<[u32; 3]> = mesh.topology().face_indices();
    let faces: Vec<_> = faces
        .iter()
        .map(|face| face.map(|v| number(v as usize) as u32))
        .collect();
    let shapes: Vec<_> = faces
        .iter()
        .map(|face| face.map(|v| flat[v as usize]))
        .collect();
    let other = Mesh::sewn(&faces, &shapes, places).expect("a mesh");
    let [one, two] = [&mesh, &other].map(|mesh| Modes::of(&cloth(mesh), 24));
    for (from, to) in [(0, 1), (5, 200), (299, 31)] {
        let a = heat(&one, 0.02, from, to);
        let b = heat(&two, 0.02, number(from), number(to));
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

/// Heat of a source at x after some time at y, on a rod of length 1 that lets none out.
fn rod(time: f64, x: f64, y: f64) -> f64 {
    let wave = |k: i32| {
        let number = PI * f64::from(k);
        2.0 * (-number * number * time).exp() * (number * x).cos() * (number * y).cos()
    };
    1.0 + (1..20).map(wave).sum::<f64>()
}

#[test]
fn heat_spreads_as_on_a_square_on_coarse_and_fine_meshes() {
    let time = 0.05;
    for vertices in [196, 1024] {
        let mesh = sheet(vertices, 5);
        let modes = Modes::of(&cloth(&mesh), 32);
        let points = mesh.pattern().points();
        let least = points.iter().fold(DVec2::MAX, |least, p| least.min(*p));
        let places: Vec<DVec2> = points.iter().map(|p| *p - least).collect();
        let mut worst = 0.0_f64;
        for from in (0..vertices).step_by(17) {
            for to in 0..vertices {
                let [a, b] = [from, to].map(|v| places[v]);
                let expected = rod(time, a.x, b.x) * rod(time, a.y, b.y);
                worst = worst.max((heat(&modes, time, from, to) - expected).abs());
            }
        }
        // Of up to 6.4 at the corners, whose share of the area is a quarter of the others'.
        assert!(worst < 0.15, "{vertices}: {worst}");
    }
}

//! Small irregular cloths for the tests of this crate: jittered grids, hanging and rippled.

use glam::{DVec2, DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{Environment, Handles, Mesh};

use crate::frame::Yaw;
use crate::graph::ClothParts;

/// A hanging square of `side` × `side` vertices, handles at its upper corners, at rest slightly
/// rippled; the air moves.
pub(crate) fn parts(side: usize, seed: u64) -> ClothParts {
    let mesh = mesh(side, seed);
    let rest = mesh.rest_shape(0.15);
    let positions = mesh.positions().iter().map(|p| p.as_vec3()).collect();
    let coordinates = mesh.material_coordinates();
    let (last, corner) = (side * side - 1, side * (side - 1));
    ClothParts {
        topology: mesh.topology().clone(),
        handles: Handles::new(&[last as u32, corner as u32], side * side).expect("two corners"),
        vertex_mass: rest.vertex_mass.iter().map(|&m| m as f32).collect(),
        face_area: rest.face_area.iter().map(|&a| a as f32).collect(),
        material_coordinates: coordinates
            .iter()
            .map(|c| Vec2::new(c.x as f32, c.y as f32))
            .collect(),
        rest_positions: positions,
        environment: Environment {
            wind: DVec3::new(0.4, 0.1, -0.7),
            air_drag: 0.3,
            ..Environment::default()
        },
        frame_rate: 60.0,
    }
}

fn mesh(side: usize, seed: u64) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let step = 1.0 / (side - 1) as f64;
    let mut coordinates = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let jitter = DVec2::new(rng.random::<f64>(), rng.random::<f64>()) - 0.5;
            let place = DVec2::new(column as f64, row as f64);
            coordinates.push(step * (place + 0.3 * jitter));
        }
    }
    let mut faces = Vec::new();
    for row in 0..side as u32 - 1 {
        for column in 0..side as u32 - 1 {
            let a = row * side as u32 + column;
            let (b, c, d) = (a + 1, a + 1 + side as u32, a + side as u32);
            let split = if rng.random::<bool>() {
                [[a, b, c], [c, d, a]]
            } else {
                [[b, c, d], [d, a, b]]
            };
            faces.extend(split);
        }
    }
    let positions = coordinates
        .iter()
        .map(|c| DVec3::new(0.05 * (9.0 * c.x).sin() * (1.0 - c.y), c.y - 1.0, c.x - 0.5))
        .collect();
    Mesh::new(&faces, coordinates, positions).expect("a jittered grid")
}

/// `positions` moved at random by up to `size` [m] per coordinate.
pub(crate) fn shaken(positions: &[Vec3], size: f32, seed: u64) -> Vec<Vec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || size * (2.0 * rng.random::<f32>() - 1.0);
    positions
        .iter()
        .map(|&p| p + Vec3::new(draw(), draw(), draw()))
        .collect()
}

/// `positions` turned about the vertical and moved, rounded once.
pub(crate) fn turn(positions: &[Vec3], yaw: Yaw, by: Vec3) -> Vec<Vec3> {
    positions
        .iter()
        .map(|p| (yaw.to_world_f64(p.as_dvec3()) + by.as_dvec3()).as_vec3())
        .collect()
}

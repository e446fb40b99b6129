//! Small irregular cloths for the tests of this crate, hanging and rippled.

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{Environment, Handles};

use crate::graph::ClothParts;
use crate::graph::frame::Yaw;

/// A hanging square of `side`² vertices, its handles the upper corners (right one first), at rest
/// slightly rippled; the air moves.
pub(crate) fn parts(side: usize, seed: u64) -> ClothParts {
    let vertices = side * side;
    let spec = SquareSpec {
        vertices,
        size: 1.0,
        seed,
    };
    let sheet = square(&spec).expect("a square");
    let [left, right] = sheet.labels["upper-corners"][..] else {
        panic!("two upper corners");
    };
    let (mesh, rest) = (&sheet.mesh, sheet.mesh.rest_shape(0.15));
    let coordinates = mesh.material_coordinates().iter().map(|c| c.as_vec2());
    let ripple = |p: &DVec3| DVec3::new(0.05 * (9.0 * p.z).sin() * p.y, p.y, p.z);
    ClothParts {
        topology: mesh.topology().clone(),
        handles: Handles::new(&[right, left], vertices).expect("two corners"),
        vertex_mass: rest.vertex_mass.iter().map(|&m| m as f32).collect(),
        face_area: rest.face_area.iter().map(|&a| a as f32).collect(),
        material_coordinates: coordinates.collect(),
        rest_positions: mesh
            .positions()
            .iter()
            .map(|p| ripple(p).as_vec3())
            .collect(),
        environment: Environment {
            wind: DVec3::new(0.4, 0.1, -0.7),
            air_drag: 0.3,
            ..Environment::default()
        },
        frame_rate: 60.0,
    }
}

/// `positions` moved at random by up to `size` `[m]` per coordinate.
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

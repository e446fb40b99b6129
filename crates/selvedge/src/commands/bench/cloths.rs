//! Cloths to measure rollouts on: an irregular square, or, where that would take longer to make
//! than to measure, a sheet of squares with diagonals.

use anyhow::Context;
use glam::{Vec2, Vec3};
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles, Topology};
use selvedge_model::ClothGraph;

use super::scale::sheet;

/// Most vertices of an irregular square.
const MOST_IRREGULAR: usize = 4096;

/// Of a light fabric [kg/m²].
const DENSITY: f32 = 0.15;

/// A hanging cloth of 1 m with about so many vertices, held at two corners.
///
/// # Errors
/// When it cannot be made.
pub(super) fn hanging(vertices: usize) -> anyhow::Result<ClothGraph> {
    let (topology, uv) = if vertices <= MOST_IRREGULAR {
        irregular(vertices)?
    } else {
        regular(vertices)?
    };
    let area = |face: &[selvedge_cloth::VertexId; 3]| {
        let [a, b, c] = face.map(|v| uv[v.index()]);
        0.5 * (b - a).perp_dot(c - a).abs()
    };
    let face_area: Vec<f32> = topology.faces().iter().map(area).collect();
    let mut vertex_mass = vec![0.0; uv.len()];
    for (face, area) in topology.faces().iter().zip(&face_area) {
        for v in face {
            vertex_mass[v.index()] += DENSITY * area / 3.0;
        }
    }
    let held = [0, 1].map(|side| {
        let corner = Vec2::new(side as f32, 1.0);
        let distance = |v: &usize| uv[*v].distance_squared(corner);
        (0..uv.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    });
    let held = held.map(|v| v.unwrap_or(0) as u32);
    let ripple = |c: &Vec2| Vec3::new(0.02 * (12.0 * c.x).sin() * (1.0 - c.y), c.y, c.x);
    let arrays = ClothArrays {
        rest_positions: uv.iter().map(ripple).collect(),
        material_coordinates: uv,
        vertex_mass,
        face_area,
    };
    let handles = Handles::new(&held, arrays.rest_positions.len())?;
    let cloth = Cloth::new(topology, handles, arrays)?;
    ClothGraph::new(&cloth, Environment::default(), 60.0).context("a cloth to measure on")
}

fn irregular(vertices: usize) -> anyhow::Result<(Topology, Vec<Vec2>)> {
    let spec = SquareSpec {
        vertices,
        size: 1.0,
        seed: 1,
    };
    let made = square(&spec).context("making a cloth to measure on")?;
    let coordinates = made.mesh.material_coordinates().iter();
    let uv = coordinates.map(|c| c.as_vec2()).collect();
    Ok((made.mesh.topology().clone(), uv))
}

fn regular(vertices: usize) -> anyhow::Result<(Topology, Vec<Vec2>)> {
    let topology = sheet(vertices)?;
    let columns = vertices.isqrt().max(2);
    let lines = topology.vertex_count() / columns;
    let last = [columns, lines].map(|count| (count - 1) as f32);
    let at = |v: usize| {
        Vec2::new(
            (v % columns) as f32 / last[0],
            (v / columns) as f32 / last[1],
        )
    };
    let uv = (0..topology.vertex_count()).map(at).collect();
    Ok((topology, uv))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloths_weigh_what_they_should_and_hang_by_their_corners() {
        for vertices in [100, 5000] {
            let graph = hanging(vertices).unwrap();
            assert!(graph.vertex_count().abs_diff(vertices) < 100);
            let mass: f32 = graph.vertex_mass().iter().sum();
            assert!((mass - DENSITY).abs() < 1e-3, "{mass} kg of 1 m²");
            let held = graph.handles().select(graph.rest_positions());
            assert!((held[1].z - held[0].z - 1.0).abs() < 0.1);
        }
    }
}

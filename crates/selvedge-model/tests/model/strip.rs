//! A strip of cloth as a network sees it.

use glam::DVec2;
use selvedge_cloth::{Cloth, Environment, Handles, Mesh};
use selvedge_model::{ClothGraph, Connectivity};

/// A strip of `columns` × 2 quads: interior and boundary edges, vertices of several degrees.
pub(crate) fn strip(columns: u32) -> Connectivity {
    let mut faces = Vec::new();
    for c in 0..columns {
        for row in 0..2 {
            let v = 3 * c + row;
            faces.push([v, v + 3, v + 1]);
            faces.push([v + 1, v + 3, v + 4]);
        }
    }
    let count = 3 * (columns as usize + 1);
    // Uneven columns, so that no two waves are of the same length.
    let place = |v: u32| DVec2::new(f64::from(v / 3).powf(1.1), f64::from(v % 3)) * 0.07;
    let positions = (0..count as u32).map(|v| place(v).extend(0.0)).collect();
    let shapes: Vec<_> = faces.iter().map(|face| face.map(place)).collect();
    let mesh = Mesh::sewn(&faces, &shapes, positions).expect("a strip");
    let handles = Handles::new(&[0], count).expect("a handle");
    let cloth = Cloth::of_mesh(&mesh, 0.2, handles).expect("a cloth");
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph");
    graph.connectivity().clone()
}

//! A scene as `peers.py` writes it, in SI units, and the springs and hinges of its sheet.

use std::collections::BTreeMap;

use serde::Deserialize;

#[derive(Deserialize)]
pub struct Scene {
    pub positions: Vec<[f64; 3]>,
    pub faces: Vec<[u32; 3]>,
    pub held: Vec<u32>,
    /// Radius of a fixed ball about the origin, m.
    pub ball: Option<f64>,
    pub rate: f64,
    pub density: f64,
    pub youngs_modulus: f64,
    pub poissons_ratio: f64,
    pub thickness: f64,
    /// Proportional to stiffness, s.
    pub damping: f64,
    pub friction: f64,
    pub gravity: f64,
}

/// An edge with the area of its one or two faces.
pub struct Edge {
    pub length: f64,
    pub area: f64,
}

impl Scene {
    /// Edges by their vertices, the lower first.
    pub fn edges(&self) -> BTreeMap<[u32; 2], Edge> {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &self.faces {
            let area = self.area([a, b, c]);
            for [p, q] in [[a, b], [b, c], [c, a]] {
                let (p, q) = (p.min(q), p.max(q));
                let length = norm(sub(self.at(q), self.at(p)));
                edges
                    .entry([p, q])
                    .or_insert(Edge { length, area: 0.0 })
                    .area += area;
            }
        }
        edges
    }

    /// Masses of the vertices, a third of each face's, kg.
    pub fn masses(&self) -> Vec<f64> {
        let mut masses = vec![0.0; self.positions.len()];
        for &face in &self.faces {
            for vertex in face {
                masses[vertex as usize] += self.density * self.area(face) / 3.0;
            }
        }
        masses
    }

    /// Stiffness of the spring in the place of an edge, N/m: E h A / l², A the area of its faces.
    pub fn spring(&self, edge: &Edge) -> f64 {
        self.youngs_modulus * self.thickness * edge.area / edge.length.powi(2)
    }

    /// Stiffness of the hinge of an edge, N m: D l² / A, as Selvedge has it.
    pub fn hinge(&self, edge: &Edge) -> f64 {
        let plate = self.youngs_modulus * self.thickness.powi(3)
            / (12.0 * (1.0 - self.poissons_ratio.powi(2)));
        plate * edge.length.powi(2) / edge.area
    }

    fn at(&self, vertex: u32) -> [f64; 3] {
        self.positions[vertex as usize]
    }

    fn area(&self, [a, b, c]: [u32; 3]) -> f64 {
        let [u, v] = [sub(self.at(b), self.at(a)), sub(self.at(c), self.at(a))];
        0.5 * norm([
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ])
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

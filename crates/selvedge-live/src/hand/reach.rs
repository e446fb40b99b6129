//! How far handles can be apart: along the edges of the cloth between them, and a little more.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use selvedge_cloth::{Cloth, Handles};

/// Distance over the way along the edges: cloth gives so much, and then resists.
const GIVES: f64 = 1.1;

/// Handles beyond which nothing is limited: that many are not pulled apart by a hand.
const MOST: usize = 16;

/// The greatest distances between handles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reach {
    handles: Handles,
    /// `[m]`, `[handles][handles]`; infinite where no cloth is between them.
    most: Vec<f64>,
}

impl Reach {
    /// Those of `handles` on `cloth`.
    pub(crate) fn of(cloth: &Cloth, handles: &Handles) -> Self {
        let count = handles.len();
        let mut most = vec![f64::INFINITY; count * count];
        if (2..=MOST).contains(&count) {
            let ways = Ways::of(cloth);
            for (row, from) in handles.vertices().iter().enumerate() {
                let along = ways.from(from.index());
                for (column, to) in handles.vertices().iter().enumerate() {
                    most[row * count + column] = GIVES * along[to.index()];
                }
            }
        }
        Self {
            handles: handles.clone(),
            most,
        }
    }

    /// Returns true if this is of these handles.
    pub(crate) fn is_of(&self, handles: &Handles) -> bool {
        self.handles == *handles
    }

    /// The greatest distance between two handles `[m]`.
    pub(super) fn between(&self, one: usize, other: usize) -> f64 {
        let count = self.handles.len();
        let place = one * count + other;
        self.most.get(place).copied().unwrap_or(f64::INFINITY)
    }
}

/// The edges at each vertex, with their lengths.
struct Ways {
    neighbours: Vec<Vec<(usize, f64)>>,
}

impl Ways {
    fn of(cloth: &Cloth) -> Self {
        let mut neighbours = vec![Vec::new(); cloth.vertex_count()];
        let lengths = cloth.pattern().edge_lengths();
        for (edge, length) in cloth.topology().edges().iter().zip(lengths) {
            let [a, b] = edge.vertices.map(|v| v.index());
            neighbours[a].push((b, length));
            neighbours[b].push((a, length));
        }
        Self { neighbours }
    }

    /// Lengths of the shortest ways from a vertex `[m]`, `[vertices]` (Dijkstra).
    fn from(&self, start: usize) -> Vec<f64> {
        let mut lengths = vec![f64::INFINITY; self.neighbours.len()];
        lengths[start] = 0.0;
        // Lengths are not negative, so that their bits have their order.
        let mut open = BinaryHeap::from([Reverse((0_u64, start))]);
        while let Some(Reverse((bits, vertex))) = open.pop() {
            let length = f64::from_bits(bits);
            if length > lengths[vertex] {
                continue;
            }
            for &(next, edge) in &self.neighbours[vertex] {
                let way = length + edge;
                if way < lengths[next] {
                    lengths[next] = way;
                    open.push(Reverse((way.to_bits(), next)));
                }
            }
        }
        lengths
    }
}

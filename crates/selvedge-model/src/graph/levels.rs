//! Coarse levels of a cloth: fewer and fewer of its vertices, joined by links, so that what a handle does
//! reaches the far end of the cloth in a few blocks instead of one edge at a time.
//!
//! Each level has a quarter of the vertices of the one before, one after another the farthest from those
//! that are chosen already (farthest-point sampling, Gonzalez 1985), along the edges of the flat cloth, so that
//! no pose has a say in it `[eq:coarse-levels]`; of equally far ones the one with the smaller number. Handles come
//! first, where they are more than half of a level the first of them alone. Every vertex of the level before belongs to the chosen one that is nearest; two
//! chosen ones are linked where their cells touch, as Delaunay's triangulation links the centres of Voronoi's
//! cells. Pieces that do not hang together are never linked.
//!
//! The links of all levels and the edges of the mesh are one graph, as in GraphCast (Lam et al. 2023): a block
//! passes messages on all levels at once. It is not a U, in which the levels follow one another.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use glam::Vec3;
use selvedge_cloth::Topology;

/// An edge of a coarse level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Its vertices, the smaller one first.
    pub ends: [u32; 2],
    /// 1 for the finest of the coarse levels.
    pub level: u32,
    /// The arc that `ends[0]` sends, then its reverse.
    pub arcs: [u32; 2],
    /// `ends[0]` - `ends[1]` at rest, in the rest pose's local frame `[m]`.
    pub rest_vector: Vec3,
}

/// All arcs of a cloth, by receiver, level and sender.
pub(crate) struct Arcs {
    pub(crate) senders: Vec<u32>,
    pub(crate) receivers: Vec<u32>,
    /// The number of the edge of each; of a link, the number of edges more than its own.
    pub(crate) numbers: Vec<u32>,
    /// The arcs of each edge and then of each link: that sent by its first vertex, and its reverse.
    pub(crate) pairs: Vec<[u32; 2]>,
}

impl Arcs {
    /// Those of a mesh and of links with their levels.
    pub(crate) fn new(topology: &Topology, links: &[([u32; 2], u32)]) -> Self {
        let edges = topology
            .edges()
            .iter()
            .map(|edge| edge.vertices.map(|v| v.0));
        let ends: Vec<[u32; 2]> = edges.chain(links.iter().map(|(ends, _)| *ends)).collect();
        let levels = std::iter::repeat_n(0, topology.edges().len());
        let levels = levels.chain(links.iter().map(|(_, level)| *level));
        let both = ends.iter().zip(levels).zip(0u32..);
        let mut arcs: Vec<[u32; 4]> = both
            .flat_map(|((&[a, b], level), number)| [[b, level, a, number], [a, level, b, number]])
            .collect();
        arcs.sort_unstable();
        let mut pairs = vec![[0; 2]; ends.len()];
        for (&[_, _, sender, number], arc) in arcs.iter().zip(0u32..) {
            let reverse = sender != ends[number as usize][0];
            pairs[number as usize][usize::from(reverse)] = arc;
        }
        Self {
            receivers: arcs.iter().map(|arc| arc[0]).collect(),
            senders: arcs.iter().map(|arc| arc[2]).collect(),
            numbers: arcs.iter().map(|arc| arc[3]).collect(),
            pairs,
        }
    }
}

/// Each level has one of so many vertices of the level before.
const RATIO: usize = 4;

/// Nobody's cell.
const NOBODY: u32 = u32::MAX;

/// Which vertices are joined and at which distance, by the pair, the smaller one first.
type Lengths = BTreeMap<[u32; 2], f64>;

/// The links of up to `levels` coarse levels, in the order of the levels: their vertices and their level.
/// Fewer where a level would have a single vertex. No pair stands twice, nor one that is an edge.
pub(crate) fn links(
    topology: &Topology,
    edge_lengths: &[f32],
    handles: &[u32],
    levels: usize,
) -> Vec<([u32; 2], u32)> {
    let edges = topology.edges().iter().zip(edge_lengths);
    let mut lengths: Lengths = edges
        .map(|(edge, &length)| (sorted(edge.vertices.map(|v| v.0)), f64::from(length)))
        .collect();
    let mut members: Vec<u32> = (0..topology.vertex_count() as u32).collect();
    let mut known: BTreeSet<[u32; 2]> = lengths.keys().copied().collect();
    let mut out = Vec::new();
    for level in 1..=levels as u32 {
        let count = members.len().div_ceil(RATIO);
        if count < 2 {
            break;
        }
        let mut cells = Cells::new(topology.vertex_count(), &lengths, &members);
        let chosen = cells.choose(count, handles);
        lengths = cells.touching(&lengths);
        let new = lengths.keys().filter(|&&ends| known.insert(ends));
        out.extend(new.map(|&ends| (ends, level)));
        members = chosen;
    }
    out
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The nearest chosen vertex of every vertex.
struct Cells {
    /// `[vertices]`, with the distance to it.
    neighbours: Vec<Vec<(u32, f64)>>,
    owner: Vec<u32>,
    distance: Vec<f64>,
    /// Members by their distances, among others that have become shorter since.
    far: BinaryHeap<(Far, Reverse<u32>)>,
}

/// A distance that has an order.
#[derive(Clone, Copy, PartialEq)]
struct Far(f64);

impl Eq for Far {}

impl PartialOrd for Far {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Far {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Cells {
    fn new(vertices: usize, lengths: &Lengths, members: &[u32]) -> Self {
        let mut neighbours = vec![Vec::new(); vertices];
        for (&[a, b], &length) in lengths {
            neighbours[a as usize].push((b, length));
            neighbours[b as usize].push((a, length));
        }
        let far = members.iter().map(|&v| (Far(f64::INFINITY), Reverse(v)));
        Self {
            neighbours,
            owner: vec![NOBODY; vertices],
            distance: vec![f64::INFINITY; vertices],
            far: far.collect(),
        }
    }

    /// Chooses `count` of the members, fewer where the others lie where they do, and gives every member that can be
    /// reached from one of them to the nearest.
    fn choose(&mut self, count: usize, handles: &[u32]) -> Vec<u32> {
        let mut chosen = Vec::with_capacity(count);
        let first = if 2 * handles.len() <= count {
            handles.len()
        } else {
            1
        };
        for &handle in handles.iter().take(first) {
            self.add(handle);
            chosen.push(handle);
        }
        while chosen.len() < count {
            let Some((Far(distance), Reverse(vertex))) = self.far.pop() else {
                break;
            };
            if distance > 0.0 && distance == self.distance[vertex as usize] {
                self.add(vertex);
                chosen.push(vertex);
            }
        }
        chosen.sort_unstable();
        chosen
    }

    /// Makes `seed` a chosen one: takes all vertices that are nearer to it than to their own (Dijkstra 1959).
    fn add(&mut self, seed: u32) {
        let mut near = BinaryHeap::from([(Reverse(Far(0.0)), seed)]);
        self.take(seed, seed, 0.0);
        while let Some((Reverse(Far(distance)), vertex)) = near.pop() {
            if distance > self.distance[vertex as usize] {
                continue;
            }
            for number in 0..self.neighbours[vertex as usize].len() {
                let (next, length) = self.neighbours[vertex as usize][number];
                let distance = distance + length;
                if distance < self.distance[next as usize] {
                    self.take(next, seed, distance);
                    near.push((Reverse(Far(distance)), next));
                }
            }
        }
    }

    fn take(&mut self, vertex: u32, seed: u32, distance: f64) {
        self.owner[vertex as usize] = seed;
        self.distance[vertex as usize] = distance;
        self.far.push((Far(distance), Reverse(vertex)));
    }

    /// The chosen ones whose cells touch, with the shortest way from one to the other over such a place.
    fn touching(&self, lengths: &Lengths) -> Lengths {
        let mut all = Lengths::new();
        for (ends, length) in lengths {
            let ends = ends.map(|v| v as usize);
            let [a, b] = ends.map(|v| self.owner[v]);
            if a != b && a != NOBODY && b != NOBODY {
                let way = self.distance[ends[0]] + length + self.distance[ends[1]];
                let shortest = all.entry(sorted([a, b])).or_insert(way);
                *shortest = shortest.min(way);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests;

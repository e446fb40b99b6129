//! Coarse levels of a cloth: fewer and fewer of its vertices, joined by links, so that the motion
//! of a handle reaches the far end of the cloth in a few blocks instead of one edge at a time.
//!
//! Each level has a quarter of the vertices of the level before, chosen by farthest-point sampling
//! (Gonzalez 1985) `[eq:coarse-levels]`. Distances run along the edges of the flat cloth, so that
//! no pose changes the choice; ties go to the smaller number. Handles come first; if they are more
//! than half of a level, only the first of them does. Every vertex of the level before belongs to
//! the nearest chosen vertex. Two chosen vertices are linked if their cells touch, as in Delaunay's
//! triangulation of the centres of Voronoi cells. Pieces of cloth that are not connected are never
//! linked.
//!
//! The links of all levels and the edges of the mesh are one graph, as in GraphCast (Lam et al.
//! 2023): a block passes messages on all levels at once. It is not a U, in which the levels follow
//! one another.

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
    /// Number of the edge of each arc; for a link, the number of edges plus its own number.
    pub(crate) numbers: Vec<u32>,
    /// Arcs of each edge and then of each link: the arc that its first vertex sends, and its
    /// reverse.
    pub(crate) pairs: Vec<[u32; 2]>,
}

impl Arcs {
    /// The arcs of a mesh and of links with their levels.
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

/// Vertices of the level before for each vertex of a level.
const RATIO: usize = 4;

/// Owner of a vertex that belongs to no cell.
const NO_OWNER: u32 = u32::MAX;

/// Distances of joined vertices, by the pair, the smaller vertex first.
type Lengths = BTreeMap<[u32; 2], f64>;

/// The links of up to `levels` coarse levels, in the order of the levels: their vertices and their
/// level. The levels end before one with a single vertex. No pair occurs twice, and none is an
/// edge.
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

fn sorted(ends: [u32; 2]) -> [u32; 2] {
    let [a, b] = ends;
    [a.min(b), a.max(b)]
}

/// The nearest chosen vertex of every vertex.
struct Cells {
    /// Neighbours of each vertex with their distances, `[vertices]`.
    neighbours: Vec<Vec<(u32, f64)>>,
    owner: Vec<u32>,
    distance: Vec<f64>,
    /// Members by their distances; also holds outdated, longer distances.
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
            owner: vec![NO_OWNER; vertices],
            distance: vec![f64::INFINITY; vertices],
            far: far.collect(),
        }
    }

    /// Chooses `count` of the members, fewer if the others coincide with them, and gives every
    /// reachable member to the nearest chosen one.
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

    /// Chooses `seed`: takes all vertices that are nearer to it than to their owners (Dijkstra
    /// 1959).
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

    /// Pairs of chosen vertices whose cells touch, with the shortest way from one to the other
    /// through a contact.
    fn touching(&self, lengths: &Lengths) -> Lengths {
        let mut all = Lengths::new();
        for (ends, length) in lengths {
            let ends = ends.map(|v| v as usize);
            let [a, b] = ends.map(|v| self.owner[v]);
            if a != b && a != NO_OWNER && b != NO_OWNER {
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

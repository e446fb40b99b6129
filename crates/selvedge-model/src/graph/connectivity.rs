//! The graph as the network sees it: arcs sorted by receiver, as plain arrays, for one cloth or
//! for several side by side (a disjoint union).

use selvedge_cloth::Topology;

use crate::graph::partition::{Partition, partitions};

/// Arcs of one or several cloths. Arc `a` goes from `senders[a]` to `receivers[a]`; those into
/// vertex `v` are `first_arc[v]..first_arc[v + 1]`; `reverse_arcs[a]` is the same edge the other
/// way.
#[derive(Clone, Debug, PartialEq)]
pub struct Connectivity {
    pub(crate) vertex_count: usize,
    pub(crate) senders: Vec<u32>,
    pub(crate) receivers: Vec<u32>,
    pub(crate) first_arc: Vec<u32>,
    pub(crate) reverse_arcs: Vec<u32>,
    pub(crate) partitions: Vec<Partition>,
    cloths: Vec<ClothSize>,
}

/// Size of one cloth of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClothSize {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of arcs.
    pub arcs: usize,
}

/// All arcs of a cloth, by receiver and sender.
pub(crate) struct Arcs {
    pub(crate) senders: Vec<u32>,
    pub(crate) receivers: Vec<u32>,
    /// Number of the edge of each arc.
    pub(crate) numbers: Vec<u32>,
    /// Arcs of each edge: the arc that its first vertex sends, and its reverse.
    pub(crate) pairs: Vec<[u32; 2]>,
}

impl Arcs {
    /// The arcs of a mesh.
    pub(crate) fn new(topology: &Topology) -> Self {
        let edges = topology.edges().iter();
        let ends: Vec<[u32; 2]> = edges.map(|edge| edge.vertices.map(|v| v.0)).collect();
        let mut arcs: Vec<[u32; 3]> = ends
            .iter()
            .zip(0u32..)
            .flat_map(|(&[a, b], number)| [[b, a, number], [a, b, number]])
            .collect();
        arcs.sort_unstable();
        let mut pairs = vec![[0; 2]; ends.len()];
        for (&[_, sender, number], arc) in arcs.iter().zip(0u32..) {
            let reverse = sender != ends[number as usize][0];
            pairs[number as usize][usize::from(reverse)] = arc;
        }
        Self {
            receivers: arcs.iter().map(|arc| arc[0]).collect(),
            senders: arcs.iter().map(|arc| arc[1]).collect(),
            numbers: arcs.iter().map(|arc| arc[2]).collect(),
            pairs,
        }
    }
}

impl Connectivity {
    /// The arcs of a mesh.
    pub fn of(topology: &Topology) -> Self {
        let arcs = Arcs::new(topology);
        let count = topology.vertex_count();
        Self::of_arcs(count, arcs.senders, arcs.receivers, &arcs.pairs)
    }

    /// Arcs from `senders` to `receivers`, and the two arcs of every edge.
    pub(crate) fn of_arcs(
        vertex_count: usize,
        senders: Vec<u32>,
        receivers: Vec<u32>,
        pairs: &[[u32; 2]],
    ) -> Self {
        let mut reverse_arcs = vec![0; senders.len()];
        for &[forward, back] in pairs {
            reverse_arcs[forward as usize] = back;
            reverse_arcs[back as usize] = forward;
        }
        let mut first_arc = vec![0; vertex_count + 1];
        for &receiver in &receivers {
            first_arc[receiver as usize + 1] += 1;
        }
        for vertex in 0..vertex_count {
            first_arc[vertex + 1] += first_arc[vertex];
        }
        Self {
            vertex_count,
            senders,
            receivers,
            partitions: partitions(&first_arc),
            cloths: vec![ClothSize {
                vertices: vertex_count,
                arcs: first_arc[vertex_count] as usize,
            }],
            first_arc,
            reverse_arcs,
        }
    }

    /// Several graphs as one without arcs between them: vertices and arcs of the parts follow
    /// each other in order.
    pub fn union<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut whole = Self {
            vertex_count: 0,
            senders: Vec::new(),
            receivers: Vec::new(),
            first_arc: vec![0],
            reverse_arcs: Vec::new(),
            partitions: Vec::new(),
            cloths: Vec::new(),
        };
        for part in parts {
            let (vertices, arcs) = (whole.vertex_count as u32, whole.arc_count() as u32);
            whole.vertex_count += part.vertex_count;
            whole
                .senders
                .extend(part.senders.iter().map(|v| v + vertices));
            whole
                .receivers
                .extend(part.receivers.iter().map(|v| v + vertices));
            whole
                .first_arc
                .extend(part.first_arc[1..].iter().map(|a| a + arcs));
            whole.cloths.extend(&part.cloths);
            whole
                .reverse_arcs
                .extend(part.reverse_arcs.iter().map(|a| a + arcs));
        }
        whole.partitions = partitions(&whole.first_arc);
        whole
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Number of arcs, two per edge.
    pub fn arc_count(&self) -> usize {
        self.senders.len()
    }

    /// Vertex that each arc comes from, `[arcs]`.
    pub fn senders(&self) -> &[u32] {
        &self.senders
    }

    /// The vertex that each arc arrives at, in ascending order, `[arcs]`.
    pub fn receivers(&self) -> &[u32] {
        &self.receivers
    }

    /// First arc into each vertex, and the number of arcs, `[vertices + 1]`.
    pub fn first_arc(&self) -> &[u32] {
        &self.first_arc
    }

    /// Reverse of each arc, the same edge the other way, `[arcs]`.
    pub fn reverse_arcs(&self) -> &[u32] {
        &self.reverse_arcs
    }

    /// Sizes of the cloths, in order.
    pub fn cloths(&self) -> &[ClothSize] {
        &self.cloths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(first: u32) -> Topology {
        let faces = [[0, 1, 2], [2, 1, 3], [2, 3, 4]];
        let count = if first == 0 { 5 } else { 4 };
        Topology::new(count, &faces[..count - 2]).expect("a strip")
    }

    #[test]
    fn reverse_arcs_are_the_same_edge_the_other_way() {
        let graph = Connectivity::of(&strip(0));
        for a in 0..graph.arc_count() {
            let reverse = graph.reverse_arcs[a] as usize;
            assert_eq!(graph.senders[a], graph.receivers[reverse]);
            assert_eq!(graph.receivers[a], graph.senders[reverse]);
            assert_eq!(graph.reverse_arcs[reverse] as usize, a);
        }
    }

    #[test]
    fn a_union_keeps_its_parts_apart_and_in_order() {
        let parts = [Connectivity::of(&strip(0)), Connectivity::of(&strip(1))];
        let whole = Connectivity::union(&parts);
        let (vertices, arcs) = (parts[0].vertex_count as u32, parts[0].arc_count());
        assert_eq!(whole.vertex_count(), 9);
        for a in 0..parts[1].arc_count() {
            assert_eq!(whole.senders[arcs + a], parts[1].senders[a] + vertices);
            assert_eq!(
                whole.reverse_arcs[arcs + a],
                parts[1].reverse_arcs[a] + arcs as u32
            );
        }
        for v in 0..whole.vertex_count() {
            for a in whole.first_arc[v]..whole.first_arc[v + 1] {
                assert_eq!(whole.receivers[a as usize] as usize, v);
            }
        }
    }
}

//! The graph as the network sees it: arcs sorted by receiver, as plain arrays, for one cloth or
//! for several side by side (a disjoint union).

use std::ops::Range;

use selvedge_cloth::{Topology, VertexId};

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

/// Arcs of each edge of a mesh: the arc that its first vertex sends, and its reverse, `[edges, 2]`.
pub(crate) fn edge_arcs(topology: &Topology) -> Vec<[u32; 2]> {
    let edges = topology.edges();
    let mut pairs = vec![[0; 2]; edges.len()];
    for (arc, number) in topology.arcs().iter().zip(0..) {
        let edge = arc.edge.index();
        let is_reverse = arc.sender != edges[edge].vertices[0];
        pairs[edge][usize::from(is_reverse)] = number;
    }
    pairs
}

impl Connectivity {
    /// The arcs of a mesh.
    pub fn of(topology: &Topology) -> Self {
        let (arcs, vertices) = (topology.arcs(), topology.vertex_count());
        let mut reverse_arcs = vec![0; arcs.len()];
        for [forward, back] in edge_arcs(topology) {
            reverse_arcs[forward as usize] = back;
            reverse_arcs[back as usize] = forward;
        }
        let first = |vertex| topology.arcs_into(VertexId(vertex)).start as u32;
        let first_arc = (0..vertices as u32).map(first).chain([arcs.len() as u32]);
        let first_arc: Vec<u32> = first_arc.collect();
        Self {
            vertex_count: vertices,
            senders: arcs.iter().map(|arc| arc.sender.0).collect(),
            receivers: arcs.iter().map(|arc| arc.receiver.0).collect(),
            partitions: partitions(&first_arc),
            cloths: vec![ClothSize {
                vertices,
                arcs: arcs.len(),
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
            for (all, own, before) in [
                (&mut whole.senders, &part.senders[..], vertices),
                (&mut whole.receivers, &part.receivers, vertices),
                (&mut whole.first_arc, &part.first_arc[1..], arcs),
                (&mut whole.reverse_arcs, &part.reverse_arcs, arcs),
            ] {
                all.extend(own.iter().map(|number| number + before));
            }
            whole.cloths.extend(&part.cloths);
        }
        whole.partitions = partitions(&whole.first_arc);
        whole
    }

    /// The vertices of each partition.
    pub(crate) fn vertex_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.partitions.iter().map(|rows| rows.vertices.clone())
    }

    /// The arcs of each partition.
    pub(crate) fn arc_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.partitions.iter().map(|rows| rows.arcs.clone())
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

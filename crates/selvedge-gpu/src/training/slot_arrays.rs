//! The arrays of rollout slots in a union. All slots have the same sizes, so that schedules stay
//! the same whatever cloths the slots show. A cloth that changes is written to its own slot alone.
//!
//! Where cloths differ, every slot has at least one vertex more than its cloth. The padding of a
//! slot belongs to such vertices: arcs and edges from one to itself, faces without area. They are
//! handles, and none of them reaches a loss or the gradient of a weight.

use std::sync::Arc;

use selvedge_model::{ClothGraph, Connectivity};

use crate::cloths::losses::{LossArrays, SlotSizes};
use crate::cloths::{ClothArrays, Statics, UnionSizes};
use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::Region;

/// The handle number of a vertex of the padding.
const SOME_HANDLE: u32 = 0;

/// The sizes of a slot that fits every one of some cloths.
pub(super) fn sizes_of<'a>(graphs: impl IntoIterator<Item = &'a Arc<ClothGraph>>) -> SlotSizes {
    let sizes: Vec<SlotSizes> = graphs
        .into_iter()
        .map(|graph| SlotSizes {
            vertices: graph.vertex_count(),
            arcs: graph.arc_count(),
            faces: graph.topology().faces().len(),
        })
        .collect();
    let most = |of: fn(&SlotSizes) -> usize| sizes.iter().map(of).max().unwrap_or(0);
    let most = SlotSizes {
        vertices: most(|s| s.vertices),
        arcs: most(|s| s.arcs),
        faces: most(|s| s.faces),
    };
    let same = sizes.iter().all(|sizes| *sizes == most);
    SlotSizes {
        vertices: most.vertices + usize::from(!same),
        ..most
    }
}

/// The sizes of a union of slots. It has no handles of its own: they are uploaded as positions.
pub(super) fn union_sizes(slots: usize, slot: SlotSizes) -> UnionSizes {
    UnionSizes {
        cloths: slots,
        vertices: slots * slot.vertices,
        arcs: slots * slot.arcs,
        faces: slots * slot.faces,
        ..UnionSizes::default()
    }
}

/// Contents of one slot's part of a region.
enum Words {
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
    Indices {
        /// The indices in the first slot.
        words: Vec<u32>,
        /// The difference between the indices of two slots.
        step: usize,
    },
}

/// One slot's part of a region.
struct Part {
    region: Region,
    /// Elements between two slots.
    apart: usize,
    words: Words,
}

impl Part {
    /// `apart` floats per slot, `padding` after those of a cloth.
    fn floats(region: Region, mut values: Vec<f32>, apart: usize, padding: f32) -> Self {
        values.resize(apart, padding);
        Self {
            region,
            apart,
            words: Words::Floats(values),
        }
    }

    /// All indices of a slot, which grow by `step` from slot to slot.
    fn indices(region: Region, words: Vec<u32>, apart: usize, step: usize) -> Self {
        let words = Words::Indices { words, step };
        Self {
            region,
            apart,
            words,
        }
    }

    /// Writes the part of a slot.
    fn upload(self, loaded: &mut dyn Loaded, slot: usize) -> Result<(), DeviceError> {
        let first = slot * self.apart;
        let region = |count: usize| self.region.part(first..first + count);
        match self.words {
            Words::Floats(values) => loaded.put(region(values.len()), &values),
            Words::Doubles(values) => loaded.put_doubles(region(values.len()), &values),
            Words::Indices { mut words, step } => {
                let offset = (slot * step) as u32;
                words.iter_mut().for_each(|word| *word += offset);
                loaded.upload(region(words.len()), &words)
            }
        }
    }
}

/// The arrays of a union into which cloths are written slot by slot.
pub(super) struct SlotArrays<'a> {
    pub(super) cloths: &'a ClothArrays,
    pub(super) losses: &'a LossArrays,
}

impl SlotArrays<'_> {
    /// Writes a cloth to a slot.
    pub(super) fn upload(
        &self,
        loaded: &mut dyn Loaded,
        slot: usize,
        graph: &ClothGraph,
        connectivity: &Connectivity,
    ) -> Result<(), DeviceError> {
        let parts = [
            self.vertices(graph),
            self.faces(graph),
            self.arcs(graph),
            self.connectivity(connectivity),
            self.edges(graph),
            self.hinges(graph),
        ];
        for part in parts.into_iter().flatten() {
            part.upload(loaded, slot)?;
        }
        Ok(())
    }

    fn vertices(&self, graph: &ClothGraph) -> Vec<Part> {
        let (cloths, vertices) = (self.cloths, self.losses.slot.vertices);
        let mut of = Statics::default();
        of.add_vertices(0, graph);
        let mut cloth_of = of.cloth_of;
        cloth_of.resize(vertices, 0);
        let mut handle_of = of.handle_of;
        handle_of.resize(vertices, SOME_HANDLE);
        vec![
            Part::indices(cloths.cloth_of, cloth_of, vertices, 1),
            Part::indices(cloths.handle_of, handle_of, vertices, 0),
            Part::floats(cloths.mass, of.mass, vertices, 1.0),
            Part::floats(cloths.air, of.air, 6, 0.0),
        ]
    }

    fn faces(&self, graph: &ClothGraph) -> Vec<Part> {
        let cloths = self.cloths;
        let SlotSizes {
            vertices, faces, ..
        } = self.losses.slot;
        let mut of = Statics::default();
        of.add_faces(0, graph);
        let first_face = offsets(of.first_face, of.faces.len(), vertices, 3 * faces);
        // Faces of the padding have the first vertex of the padding as corners, and no area.
        let mut corners = of.corners;
        corners.resize(3 * faces, graph.vertex_count() as u32);
        let mut of_vertices = of.faces;
        of_vertices.resize(3 * faces, faces.saturating_sub(1) as u32);
        vec![
            Part::indices(cloths.corners, corners, 3 * faces, vertices),
            Part::floats(cloths.areas, of.areas, faces, 0.0),
            Part::indices(cloths.first_face, first_face, vertices, 3 * faces),
            Part::indices(cloths.faces, of_vertices, 3 * faces, faces),
        ]
    }

    fn arcs(&self, graph: &ClothGraph) -> Vec<Part> {
        let cloths = self.cloths;
        let SlotSizes { vertices, arcs, .. } = self.losses.slot;
        let mut of = Statics::default();
        of.add_arcs(0, graph);
        let mut hinges = of.hinges;
        hinges.resize(4 * arcs, 0);
        vec![
            Part::floats(cloths.arc_rest, of.arc_rest, 4 * arcs, 0.0),
            Part::floats(cloths.arc_material, of.arc_material, 3 * arcs, 0.0),
            Part::indices(cloths.hinges, hinges, 4 * arcs, vertices),
        ]
    }

    fn connectivity(&self, connectivity: &Connectivity) -> Vec<Part> {
        let graph = &self.cloths.graph;
        let SlotSizes { vertices, arcs, .. } = self.losses.slot;
        let (real, count) = (connectivity.vertex_count(), connectivity.arc_count());
        let first_arc = connectivity.first_arc()[..real].to_vec();
        let first_arc = offsets(first_arc, count, vertices, arcs);
        // Arcs of the padding lead from a vertex of the padding to itself.
        let ends = |of: &[u32]| {
            let mut ends = of.to_vec();
            for v in real..vertices {
                let own = first_arc[v + 1] - first_arc[v];
                ends.extend(std::iter::repeat_n(v as u32, own as usize));
            }
            ends
        };
        let (senders, receivers) = (ends(connectivity.senders()), ends(connectivity.receivers()));
        let mut reverse_arcs = connectivity.reverse_arcs().to_vec();
        reverse_arcs.extend(count as u32..arcs as u32);
        vec![
            Part::indices(graph.senders, senders, arcs, vertices),
            Part::indices(graph.receivers, receivers, arcs, vertices),
            Part::indices(graph.reverse_arcs, reverse_arcs, arcs, arcs),
            Part::indices(graph.first_arc, first_arc, vertices, arcs),
        ]
    }

    fn edges(&self, graph: &ClothGraph) -> Vec<Part> {
        let (losses, slot) = (self.losses, self.losses.slot);
        let (vertices, edges, arcs) = (slot.vertices, slot.edges(), slot.arcs);
        let of_graph = graph.topology().edges();
        // Edges of the padding lead from the first vertex of the padding to itself.
        let padding = graph.vertex_count().min(vertices.saturating_sub(1)) as u32;
        let ends = of_graph.iter().flat_map(|e| e.vertices.map(|v| v.0));
        let mut ends: Vec<u32> = ends.collect();
        ends.resize(2 * edges, padding);
        let mut arc_edges = graph.arc_edges().to_vec();
        let extra = arc_edges.len()..arcs;
        arc_edges.extend(extra.map(|arc| (arc / 2) as u32));
        let mut edge_arcs = graph.edge_arcs().concat();
        edge_arcs.extend(edge_arcs.len() as u32..arcs as u32);
        let share = |count: usize| 1.0 / count.max(1) as f64;
        let handles = graph.handle_mask().iter();
        let free = handles.filter(|handle| !**handle).count();
        vec![
            Part::indices(losses.ends, ends, 2 * edges, vertices),
            Part::indices(losses.arc_edges, arc_edges, arcs, edges),
            Part::indices(losses.edge_arcs, edge_arcs, 2 * edges, arcs),
            Part {
                region: losses.shares,
                apart: 2,
                words: Words::Doubles(vec![share(free), share(of_graph.len())]),
            },
        ]
    }

    fn hinges(&self, graph: &ClothGraph) -> Vec<Part> {
        let (losses, slot) = (self.losses, self.losses.slot);
        let (vertices, edges) = (slot.vertices, slot.edges());
        let mut hinges = vec![0; 4 * edges];
        let mut of_vertex = vec![Vec::new(); vertices];
        for hinge in graph.hinges() {
            let corners = [hinge.from, hinge.to, hinge.left, hinge.right];
            let first = 4 * hinge.edge as usize;
            hinges[first..first + 4].copy_from_slice(&corners);
            for (number, vertex) in corners.into_iter().enumerate() {
                of_vertex[vertex as usize].push((first + number) as u32);
            }
        }
        let mut corner_ends = Vec::with_capacity(2 * vertices);
        let mut corners: Vec<u32> = Vec::with_capacity(4 * edges);
        for own in of_vertex {
            let first = corners.len();
            corners.extend(own);
            corner_ends.extend([first as u32, corners.len() as u32]);
        }
        corners.resize(4 * edges, 0);
        vec![
            Part::indices(losses.hinges, hinges, 4 * edges, vertices),
            Part::indices(losses.corner_ends, corner_ends, 2 * vertices, 4 * edges),
            Part::indices(losses.corners, corners, 4 * edges, 4 * edges),
        ]
    }
}

/// Offsets of the lists of a slot's vertices, and the end of the last list. `first` has the offsets
/// of a cloth's vertices, whose lists have `count` entries. The vertices of the padding share the
/// rest of `entries` about equally.
fn offsets(first: Vec<u32>, count: usize, vertices: usize, entries: usize) -> Vec<u32> {
    let mut all = first;
    let padding = vertices - all.len();
    let more = entries - count;
    all.extend((0..padding).map(|k| (count + k * more / padding) as u32));
    all.push(entries as u32);
    all
}

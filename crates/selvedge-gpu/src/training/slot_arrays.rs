//! The places of rollout slots in a union, all of the same sizes: schedules stay the same whatever
//! cloths the slots show. A cloth that changes is written to its slot's place alone.
//!
//! Where cloths differ, every place has at least one vertex more than its cloth. The rest of a
//! place belongs to such vertices: arcs and edges from one to itself, faces without area. They are
//! handles, and none of them reaches a loss or the gradient of a weight.

use std::sync::Arc;

use selvedge_model::{ClothGraph, Connectivity};

use crate::cloths::losses::{LossArrays, PlaceSizes};
use crate::cloths::{ClothArrays, Statics, UnionSizes};
use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::Region;

/// Handle of a vertex that is left over.
const SOME_HANDLE: u32 = 0;

/// Sizes that every one of some cloths fits into.
pub(super) fn sizes_of<'a>(graphs: impl IntoIterator<Item = &'a Arc<ClothGraph>>) -> PlaceSizes {
    let sizes: Vec<PlaceSizes> = graphs
        .into_iter()
        .map(|graph| PlaceSizes {
            vertices: graph.vertex_count(),
            arcs: graph.arc_count(),
            faces: graph.topology().faces().len(),
        })
        .collect();
    let most = |of: fn(&PlaceSizes) -> usize| sizes.iter().map(of).max().unwrap_or(0);
    let most = PlaceSizes {
        vertices: most(|s| s.vertices),
        arcs: most(|s| s.arcs),
        faces: most(|s| s.faces),
    };
    let same = sizes.iter().all(|sizes| *sizes == most);
    PlaceSizes {
        vertices: most.vertices + usize::from(!same),
        ..most
    }
}

/// The sizes of a union of so many places; edges are known to the losses alone, and handles to
/// nobody.
pub(super) fn union_sizes(slots: usize, place: PlaceSizes) -> UnionSizes {
    UnionSizes {
        cloths: slots,
        vertices: slots * place.vertices,
        arcs: slots * place.arcs,
        faces: slots * place.faces,
        ..UnionSizes::default()
    }
}

/// Numbers for a region of which every place has a part.
enum Words {
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
    /// Each grows by this from place to place.
    Indices(Vec<u32>, usize),
}

struct Part {
    region: Region,
    /// Elements from place to place.
    apart: usize,
    words: Words,
}

/// A cloth as it is written to any place.
pub(super) struct SlotArrays<'a> {
    pub(super) cloths: &'a ClothArrays,
    pub(super) losses: &'a LossArrays,
}

impl SlotArrays<'_> {
    /// Writes a cloth to the place of a slot.
    pub(super) fn upload(
        &self,
        loaded: &mut dyn Loaded,
        slot: usize,
        graph: &ClothGraph,
        connectivity: &Connectivity,
    ) -> Result<(), DeviceError> {
        let mut parts = self.of_cloth(graph);
        parts.extend(self.of_arcs(connectivity));
        parts.extend(self.of_losses(graph));
        for part in parts {
            let first = slot * part.apart;
            let region = |count: usize| part.region.part(first..first + count);
            match part.words {
                Words::Floats(values) => loaded.put(region(values.len()), &values)?,
                Words::Doubles(values) => loaded.put_doubles(region(values.len()), &values)?,
                Words::Indices(mut words, step) => {
                    words
                        .iter_mut()
                        .for_each(|word| *word += (slot * step) as u32);
                    loaded.upload(region(words.len()), &words)?;
                }
            }
        }
        Ok(())
    }

    fn of_cloth(&self, graph: &ClothGraph) -> Vec<Part> {
        let (cloths, place) = (self.cloths, self.losses.place);
        let PlaceSizes {
            vertices, faces, ..
        } = place;
        let mut statics = Statics::default();
        statics.add_vertices(0, graph);
        statics.add_faces(0, graph);
        statics.add_arcs(0, graph);
        let left_over = graph.vertex_count();
        let padded = |values: Vec<f32>, count: usize, value: f32| {
            let mut values = values;
            values.resize(count, value);
            Words::Floats(values)
        };
        let indices = |words: Vec<u32>, count: usize, value: usize, step: usize| {
            let mut words = words;
            words.resize(count, value as u32);
            Words::Indices(words, step)
        };
        let bounds = csr(
            statics.first_face,
            statics.faces.len(),
            [vertices, 3 * faces],
        );
        let arcs = place.arcs;
        let all = [
            (
                cloths.cloth_of,
                vertices,
                indices(statics.cloth_of, vertices, 0, 1),
            ),
            (
                cloths.handle_of,
                vertices,
                indices(statics.handle_of, vertices, SOME_HANDLE as usize, 0),
            ),
            (cloths.mass, vertices, padded(statics.mass, vertices, 1.0)),
            (
                cloths.inverse_mass,
                vertices,
                padded(statics.inverse_mass, vertices, 0.0),
            ),
            (
                cloths.rest,
                3 * vertices,
                padded(statics.rest, 3 * vertices, 0.0),
            ),
            (cloths.air, 6, Words::Floats(statics.air)),
            (
                cloths.corners,
                3 * faces,
                indices(statics.corners, 3 * faces, left_over, vertices),
            ),
            (cloths.areas, faces, padded(statics.areas, faces, 0.0)),
            (
                cloths.first_face,
                vertices,
                Words::Indices(bounds, 3 * faces),
            ),
            (
                cloths.faces,
                3 * faces,
                indices(statics.faces, 3 * faces, faces.saturating_sub(1), faces),
            ),
            (
                cloths.arc_rest,
                4 * arcs,
                padded(statics.arc_rest, 4 * arcs, 0.0),
            ),
            (
                cloths.arc_material,
                3 * arcs,
                padded(statics.arc_material, 3 * arcs, 0.0),
            ),
            (
                cloths.hinges,
                4 * arcs,
                indices(statics.hinges, 4 * arcs, 0, vertices),
            ),
        ];
        all.map(Part::new).into()
    }

    fn of_arcs(&self, connectivity: &Connectivity) -> Vec<Part> {
        let (graph, place) = (&self.cloths.graph, self.losses.place);
        let PlaceSizes { vertices, arcs, .. } = place;
        let (real, count) = (connectivity.vertex_count(), connectivity.arc_count());
        let first_arc = csr(
            connectivity.first_arc()[..real].to_vec(),
            count,
            [vertices, arcs],
        );
        // Vertices that are left over have arcs from themselves.
        let ends = |of: &[u32]| {
            let mut ends = of.to_vec();
            for v in real..vertices {
                let own = first_arc[v + 1] - first_arc[v];
                ends.extend(std::iter::repeat_n(v as u32, own as usize));
            }
            Words::Indices(ends, vertices)
        };
        let mut twins = connectivity.reverse_arcs().to_vec();
        twins.extend(count as u32..arcs as u32);
        let all = [
            (graph.senders, arcs, ends(connectivity.senders())),
            (graph.receivers, arcs, ends(connectivity.receivers())),
            (graph.reverse_arcs, arcs, Words::Indices(twins, arcs)),
            (
                graph.first_arc,
                vertices,
                Words::Indices(first_arc.clone(), arcs),
            ),
        ];
        all.map(Part::new).into()
    }

    fn of_losses(&self, graph: &ClothGraph) -> Vec<Part> {
        let (losses, place) = (self.losses, self.losses.place);
        let (vertices, edges) = (place.vertices, place.edges());
        let of_graph = graph.topology().edges();
        let left_over = graph.vertex_count().min(vertices.saturating_sub(1)) as u32;
        let mut ends: Vec<u32> = of_graph
            .iter()
            .flat_map(|e| e.vertices.map(|v| v.0))
            .collect();
        ends.resize(2 * edges, left_over);
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
        let mut arc_edges = graph.arc_edges().to_vec();
        let extra = arc_edges.len()..place.arcs;
        arc_edges.extend(extra.map(|arc| (arc / 2) as u32));
        let mut edge_arcs = graph.edge_arcs().concat();
        edge_arcs.extend(edge_arcs.len() as u32..place.arcs as u32);
        let share = |count: usize| 1.0 / count.max(1) as f64;
        let free = graph
            .handle_mask()
            .iter()
            .filter(|handle| !**handle)
            .count();
        let all = [
            (losses.ends, 2 * edges, Words::Indices(ends, vertices)),
            (losses.hinges, 4 * edges, Words::Indices(hinges, vertices)),
            (
                losses.arc_edges,
                place.arcs,
                Words::Indices(arc_edges, edges),
            ),
            (
                losses.edge_arcs,
                2 * edges,
                Words::Indices(edge_arcs, place.arcs),
            ),
            (
                losses.corner_ends,
                2 * vertices,
                Words::Indices(corner_ends, 4 * edges),
            ),
            (
                losses.corners,
                4 * edges,
                Words::Indices(corners, 4 * edges),
            ),
            (
                losses.shares,
                2,
                Words::Doubles(vec![share(free), share(of_graph.len())]),
            ),
        ];
        all.map(Part::new).into()
    }
}

impl Part {
    fn new((region, apart, words): (Region, usize, Words)) -> Self {
        Self {
            region,
            apart,
            words,
        }
    }
}

/// Where the lists of vertices begin, and where the last one ends: those of `first` (a number per
/// vertex of the cloth), `count` entries in all, and for what is left over of `entries` and
/// `vertices`, shares of about the same size.
fn csr(first: Vec<u32>, count: usize, [vertices, entries]: [usize; 2]) -> Vec<u32> {
    let mut all = first;
    let left_over = vertices - all.len();
    let more = entries - count;
    all.extend((0..left_over).map(|k| (count + k * more / left_over) as u32));
    all.push(entries as u32);
    all
}

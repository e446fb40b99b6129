//! The check of an input before the network runs. Behind it a ReLU may make 0 of what is no number,
//! on some processors and not on others.

use selvedge_cloth::VertexId;

use crate::graph::connectivity::Connectivity;
use crate::network::Input;
use crate::spec::ModelSpec;

/// The first vertex with a feature that is not finite, or else the vertex that such an arc leads
/// to.
pub(crate) fn first_non_finite(
    spec: &ModelSpec,
    graph: &Connectivity,
    input: Input<'_, f32>,
) -> Option<VertexId> {
    let row = |values: &[f32], width: usize, rows: usize| {
        let place = values.iter().position(|x| !x.is_finite())?;
        Some(place / width % rows)
    };
    let vertex = row(input.nodes, spec.node_width(), graph.vertex_count());
    let vertex = vertex.or_else(|| {
        let arc = row(input.arcs, spec.edge_width(), graph.arc_count())?;
        Some(graph.receivers[arc] as usize)
    });
    vertex.map(|vertex| VertexId(vertex as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Encoder;
    use crate::test_cloth::parts;

    #[test]
    fn the_vertex_of_a_feature_is_found_in_any_frame_of_the_window() {
        let graph = parts(4, 1).graph();
        let graph = graph.connectivity();
        let spec = ModelSpec::physical(Encoder::Gru { window: 3 }, 8, 1);
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        let mut nodes = vec![1.0; 3 * vertices * spec.node_width()];
        let mut edges = vec![1.0; 3 * arcs * spec.edge_width()];
        let found = |nodes: &[f32], arcs: &[f32]| {
            first_non_finite(&spec, graph, Input { nodes, arcs }).map(|vertex| vertex.index())
        };
        assert_eq!(found(&nodes, &edges), None);
        edges[(2 * arcs + 7) * spec.edge_width() + 1] = f32::NAN;
        assert_eq!(found(&nodes, &edges), Some(graph.receivers[7] as usize));
        nodes[(vertices + 5) * spec.node_width() + 3] = f32::INFINITY;
        assert_eq!(found(&nodes, &edges), Some(5));
    }
}

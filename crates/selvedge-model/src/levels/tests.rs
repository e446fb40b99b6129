//! Coarse levels keep what farthest-point sampling promises, and reach far.

use super::*;
use crate::connectivity::Connectivity;
use crate::graph::{ClothGraph, ClothParts};
use crate::test_cloth::parts;
use selvedge_cloth::{Handles, Topology};

fn levelled(side: usize, seed: u64, levels: usize) -> ClothGraph {
    let graph = ClothGraph::new(parts(side, seed)).expect("a cloth");
    graph.with_coarse_levels(levels)
}

/// The vertices that links of a level join.
fn joined(graph: &ClothGraph, level: u32) -> BTreeSet<u32> {
    let links = graph.links().iter().filter(|link| link.level == level);
    links.flat_map(|link| link.ends).collect()
}

/// All distances along the edges (Floyd 1962), `[vertices][vertices]`.
fn distances(graph: &ClothGraph) -> Vec<Vec<f64>> {
    let count = graph.vertex_count();
    let uv = graph.material_coordinates();
    let mut all = vec![vec![f64::INFINITY; count]; count];
    for (v, row) in all.iter_mut().enumerate() {
        row[v] = 0.0;
    }
    for edge in graph.topology().edges() {
        let [a, b] = edge.vertices.map(|v| v.index());
        let length = f64::from(uv[a].distance(uv[b]));
        (all[a][b], all[b][a]) = (length, length);
    }
    for via in 0..count {
        let through = all[via].clone();
        for row in &mut all {
            let first = row[via];
            for (way, rest) in row.iter_mut().zip(&through) {
                *way = way.min(first + rest);
            }
        }
    }
    all
}

/// Arcs from `start` to the farthest vertex.
fn most_hops(graph: &Connectivity, start: u32) -> usize {
    let mut hops = vec![usize::MAX; graph.vertex_count()];
    let mut front = vec![start];
    hops[start as usize] = 0;
    for count in 1.. {
        let mut next = Vec::new();
        for (&sender, &receiver) in graph.senders().iter().zip(graph.receivers()) {
            if hops[sender as usize] == count - 1 && hops[receiver as usize] == usize::MAX {
                hops[receiver as usize] = count;
                next.push(receiver);
            }
        }
        if next.is_empty() {
            break;
        }
        front = next;
    }
    hops[front[0] as usize]
}

#[test]
fn the_first_level_lies_as_farthest_points_do() {
    for seed in 1..4 {
        let graph = levelled(10, seed, 1);
        let chosen = joined(&graph, 1);
        assert_eq!(chosen.len(), 25);
        for handle in graph.handles().vertices() {
            assert!(chosen.contains(&handle.0), "handles come first");
        }
        // Nobody is farther from the chosen ones than two of those that were chosen by distance are from
        // each other: else that vertex would have been chosen. Here the handles are the width apart.
        let all = distances(&graph);
        let to_nearest = |v: usize| {
            let others = chosen.iter().map(|&c| c as usize).filter(|&c| c != v);
            others.map(|c| all[v][c]).fold(f64::INFINITY, f64::min)
        };
        let apart = chosen.iter().map(|&c| to_nearest(c as usize));
        let apart = apart.fold(f64::INFINITY, f64::min);
        let farthest = (0..graph.vertex_count()).map(to_nearest);
        let uncovered = farthest
            .enumerate()
            .filter(|(v, _)| !chosen.contains(&(*v as u32)));
        for (v, distance) in uncovered {
            assert!(distance <= apart, "vertex {v}: {distance} > {apart}");
        }
    }
}

#[test]
fn links_join_each_level_to_one_piece_and_repeat_no_pair() {
    let graph = levelled(12, 5, 3);
    let of_mesh = graph.topology().edges().iter();
    let mut pairs: BTreeSet<[u32; 2]> = of_mesh.map(|e| sorted(e.vertices.map(|v| v.0))).collect();
    for link in graph.links() {
        assert!(link.ends[0] < link.ends[1]);
        assert!(pairs.insert(link.ends), "{link:?} is there already");
    }
    // 144 → 36 → 9 → 3, each among those of the level before.
    let members = [1, 2, 3].map(|level| joined(&graph, level));
    assert_eq!(members.each_ref().map(BTreeSet::len), [36, 9, 3]);
    assert!(members[1].is_subset(&members[0]) && members[2].is_subset(&members[1]));
}

#[test]
fn whole_cloths_are_a_few_arcs_across() {
    let start = |graph: &ClothGraph| graph.handles().vertices()[0].0;
    let hops = [0, 1, 2, 3].map(|levels| {
        let graph = levelled(20, 1, levels);
        most_hops(&Connectivity::of_cloth(&graph), start(&graph))
    });
    // Edges: across and down at least, since no edge is longer than a diagonal of its grid. Each level halves
    // what is left of it but for the way up and down the levels.
    assert!(hops[0] >= 19, "{hops:?}");
    assert!(hops[3] <= 8, "{hops:?}");
    assert!(hops.is_sorted_by(|a, b| a >= b), "{hops:?}");
}

#[test]
fn arcs_of_edges_and_links_name_each_other() {
    let graph = levelled(9, 2, 2);
    let connectivity = Connectivity::of_cloth(&graph);
    let edges = graph.topology().edges().iter();
    let of_edges = edges
        .map(|e| e.vertices.map(|v| v.0))
        .zip(graph.edge_arcs());
    let of_links = graph.links().iter().map(|link| (link.ends, &link.arcs));
    let mut seen = vec![false; graph.arc_count()];
    for (number, (ends, arcs)) in of_edges.chain(of_links).enumerate() {
        for (arc, [sender, receiver]) in arcs.iter().zip([ends, [ends[1], ends[0]]]) {
            let arc = *arc as usize;
            assert_eq!(graph.senders()[arc], sender);
            assert_eq!(graph.receivers()[arc], receiver);
            assert_eq!(graph.arc_edges()[arc] as usize, number);
            assert!(!std::mem::replace(&mut seen[arc], true));
        }
        assert_eq!(connectivity.twins()[arcs[0] as usize], arcs[1]);
        assert_eq!(connectivity.twins()[arcs[1] as usize], arcs[0]);
    }
    assert!(seen.into_iter().all(|seen| seen));
    assert!(graph.receivers().is_sorted());
    for v in 0..graph.vertex_count() {
        let [first, end] = [0, 1].map(|k| connectivity.first_arc()[v + k] as usize);
        assert!(
            graph.receivers()[first..end]
                .iter()
                .all(|&r| r as usize == v)
        );
    }
}

#[test]
fn without_levels_a_cloth_is_its_mesh() {
    let graph = ClothGraph::new(parts(7, 3)).expect("a cloth");
    assert_eq!(
        Connectivity::of_cloth(&graph),
        Connectivity::of(graph.topology())
    );
    let back = graph.clone().with_coarse_levels(2).with_coarse_levels(0);
    assert_eq!(back, graph);
}

#[test]
fn pieces_that_do_not_hang_together_are_not_linked() {
    let one = parts(6, 1);
    let count = one.topology.vertex_count() as u32;
    let faces = one.topology.faces().iter().map(|face| face.map(|v| v.0));
    let faces: Vec<[u32; 3]> = faces
        .clone()
        .chain(faces.map(|face| face.map(|v| v + count)))
        .collect();
    let twice = |values: &[f32]| [values, values].concat();
    let graph = ClothGraph::new(ClothParts {
        topology: Topology::new(2 * count as usize, &faces).expect("two squares"),
        handles: Handles::new(&[], 2 * count as usize).expect("none"),
        vertex_mass: twice(&one.vertex_mass),
        face_area: twice(&one.face_area),
        material_coordinates: one.material_coordinates.repeat(2),
        rest_positions: one.rest_positions.repeat(2),
        ..one
    });
    let graph = graph.expect("a cloth").with_coarse_levels(3);
    for piece in [0..count, count..2 * count] {
        let of_piece = |v: &u32| piece.contains(v);
        assert!(joined(&graph, 1).iter().filter(|v| of_piece(v)).count() > 5);
    }
    for link in graph.links() {
        assert_eq!(link.ends[0] < count, link.ends[1] < count, "{link:?}");
    }
}

//! Coarse levels keep what farthest-point sampling promises, and reach far.

use super::*;
use crate::graph::ClothGraph;
use crate::graph::connectivity::Connectivity;
use crate::test_cloth::parts;
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};

fn levelled(side: usize, seed: u64, levels: usize) -> ClothGraph {
    let graph = parts(side, seed).graph();
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
        // Nobody is farther from the chosen ones than two of those that were chosen by distance are
        // from each other: else that vertex would have been chosen. Here the handles are the width
        // apart.
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

/// The vertices that can be reached from the first of `members` over `pairs`.
fn reached(members: &BTreeSet<u32>, pairs: &[[u32; 2]]) -> BTreeSet<u32> {
    let mut reached = BTreeSet::from([*members.first().expect("a vertex")]);
    loop {
        let more: Vec<u32> = pairs
            .iter()
            .filter(|ends| ends.iter().any(|v| reached.contains(v)))
            .flatten()
            .copied()
            .filter(|v| !reached.contains(v))
            .collect();
        if more.is_empty() {
            return reached;
        }
        reached.extend(more);
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
    for (level, members) in (1..).zip(&members) {
        let links = graph.links().iter().filter(|link| link.level == level);
        let pairs: Vec<[u32; 2]> = links.map(|link| link.ends).collect();
        assert_eq!(reached(members, &pairs), *members, "level {level}");
    }
}

#[test]
fn two_vertices_are_linked_where_their_cells_touch() {
    let graph = levelled(10, 4, 1);
    let chosen: Vec<u32> = joined(&graph, 1).into_iter().collect();
    let all = distances(&graph);
    // On an irregular mesh no vertex is as far from two of them.
    let cell = |v: u32| {
        let nearest = chosen.iter().min_by(|&&a, &&b| {
            let to = |c: u32| all[v as usize][c as usize];
            to(a).total_cmp(&to(b))
        });
        *nearest.expect("somebody")
    };
    let edges = graph
        .topology()
        .edges()
        .iter()
        .map(|e| e.vertices.map(|v| v.0));
    let of_mesh: BTreeSet<[u32; 2]> = edges.clone().map(sorted).collect();
    let touching: BTreeSet<[u32; 2]> = edges
        .map(|ends| sorted(ends.map(cell)))
        .filter(|[a, b]| a != b)
        .filter(|ends| !of_mesh.contains(ends))
        .collect();
    let links: BTreeSet<[u32; 2]> = graph.links().iter().map(|link| link.ends).collect();
    assert_eq!(links, touching);
}

#[test]
fn handles_that_are_too_many_for_a_level_leave_room_for_others() {
    let mut few = parts(8, 2);
    let many: Vec<u32> = (0..12).collect();
    let handles = Handles::new(&many, 64).expect("a row and a half");
    few.cloth = few.cloth.with_handles(handles).expect("handles");
    let graph = few.graph();
    // 64 → 16 → 4: twelve are more than half of sixteen, so that only the first of them comes
    // first.
    let graph = graph.with_coarse_levels(2);
    let chosen = joined(&graph, 1);
    assert_eq!(chosen.len(), 16);
    assert!(chosen.contains(&0) && joined(&graph, 2).contains(&0));
    assert!(
        chosen.iter().filter(|v| many.contains(v)).count() < 8,
        "{chosen:?}"
    );
}

#[test]
fn cloths_without_room_or_extent_have_what_they_can() {
    // Four vertices: one would be chosen, and nobody to link it with.
    let graph = levelled(2, 1, 3);
    assert!(graph.links().is_empty());
    assert_eq!(graph.coarse_levels(), 3);
    // Nobody said where it lies flat: then distances are those of the rest pose.
    let mut lost = parts(6, 3);
    let mut arrays = lost.cloth.arrays().clone();
    arrays.material_coordinates.fill(glam::Vec2::ZERO);
    let (topology, handles) = (lost.cloth.topology().clone(), lost.cloth.handles().clone());
    lost.cloth = Cloth::new(topology, handles, arrays).expect("a cloth");
    let graph = lost.graph().with_coarse_levels(1);
    assert_eq!(joined(&graph, 1).len(), 9);
}

#[test]
fn whole_cloths_are_a_few_arcs_across() {
    let start = |graph: &ClothGraph| graph.handles().vertices()[0].0;
    let hops = [0, 1, 2, 3].map(|levels| {
        let graph = levelled(20, 1, levels);
        most_hops(graph.connectivity(), start(&graph))
    });
    // Edges: across and down at least, since no edge is longer than a diagonal of its grid. What a
    // level saves is half of the way on it, but for the way up and down the levels.
    assert!(hops[0] >= 19, "{hops:?}");
    assert!(hops.is_sorted_by(|a, b| a > b), "{hops:?}");
    assert!(hops[3] <= 6, "{hops:?}");
}

#[test]
fn arcs_of_edges_and_links_name_each_other() {
    let graph = levelled(9, 2, 2);
    let connectivity = graph.connectivity();
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
        assert_eq!(connectivity.reverse_arcs()[arcs[0] as usize], arcs[1]);
        assert_eq!(connectivity.reverse_arcs()[arcs[1] as usize], arcs[0]);
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
    let graph = parts(7, 3).graph();
    let arcs = Connectivity::of(graph.topology());
    let shares = graph.connectivity().shares().to_vec();
    assert_eq!(*graph.connectivity(), arcs.with_shares(shares));
    let arcs = graph.topology().arcs().iter();
    let ends = graph.senders().iter().zip(graph.receivers());
    assert!(arcs.map(|arc| (&arc.sender.0, &arc.receiver.0)).eq(ends));
    let back = graph.clone().with_coarse_levels(2).with_coarse_levels(0);
    assert_eq!(back, graph);
}

#[test]
fn pieces_that_do_not_hang_together_are_not_linked() {
    let mut hanging = parts(6, 1);
    let one = &hanging.cloth;
    let count = one.vertex_count() as u32;
    let faces = one.topology().faces().iter().map(|face| face.map(|v| v.0));
    let faces: Vec<[u32; 3]> = faces
        .clone()
        .chain(faces.map(|face| face.map(|v| v + count)))
        .collect();
    let twice = |values: &[f32]| [values, values].concat();
    let arrays = ClothArrays {
        vertex_mass: twice(one.vertex_mass()),
        face_area: twice(one.face_area()),
        material_coordinates: one.material_coordinates().repeat(2),
        rest_positions: one.rest_positions().repeat(2),
    };
    let topology = Topology::new(2 * count as usize, &faces).expect("two squares");
    let none = Handles::new(&[], 2 * count as usize).expect("none");
    hanging.cloth = Cloth::new(topology, none, arrays).expect("two cloths");
    let graph = hanging.graph().with_coarse_levels(3);
    for piece in [0..count, count..2 * count] {
        let of_piece = |v: &u32| piece.contains(v);
        assert!(joined(&graph, 1).iter().filter(|v| of_piece(v)).count() > 5);
    }
    for link in graph.links() {
        assert_eq!(link.ends[0] < count, link.ends[1] < count, "{link:?}");
    }
}

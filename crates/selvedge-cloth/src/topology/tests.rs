//! Topology: each defect with its numbers, and the identities of a sound mesh.

use std::collections::HashSet;

use proptest::prelude::*;

use super::*;
use crate::generate::square;

fn sheet(vertices: usize, seed: u64) -> Topology {
    square(vertices, 1.0, seed).unwrap().mesh.topology().clone()
}

/// Everything that holds of any valid topology.
fn check_identities(topology: &Topology) {
    let (faces, edges, arcs) = (topology.faces(), topology.edges(), topology.arcs());
    // Each face has three sides; an edge is one or two of them.
    let inner = edges.iter().filter(|edge| !edge.is_boundary()).count();
    assert_eq!(3 * faces.len(), edges.len() + inner);
    let ends = edges.iter().map(|edge| edge.vertices.iter());
    let keys: Vec<_> = ends.map(|ends| (ends.clone().min(), ends.max())).collect();
    assert!(keys.is_sorted_by(|a, b| a < b));
    for (number, edge) in edges.iter().enumerate() {
        let [a, b] = edge.vertices;
        let runs = |face: FaceId, from, to, opposite| {
            let corners = faces[face.index()];
            (0..3).any(|k| {
                let listed = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
                let its_edge = topology.face_edges()[face.index()][k].index();
                listed == [from, to, opposite] && its_edge == number
            })
        };
        assert!(runs(edge.faces.0, a, b, edge.opposite.0));
        match (edge.faces.1, edge.opposite.1) {
            (Some(face), Some(opposite)) => {
                assert!(face > edge.faces.0 && runs(face, b, a, opposite));
            }
            (None, None) => {}
            half => panic!("edge {number} has half a second face: {half:?}"),
        }
    }
    check_arcs(topology);
    let boundary = topology.boundary_vertices();
    for (vertex, &on_boundary) in boundary.iter().enumerate() {
        let here = arcs[topology.arcs_into(VertexId(vertex as u32))].iter();
        let touching = here.filter(|arc| edges[arc.edge.index()].is_boundary());
        assert_eq!(touching.count() > 0, on_boundary);
    }
}

/// Every edge has two arcs that are each other's reverse, and those into a vertex are together.
fn check_arcs(topology: &Topology) {
    let arcs = topology.arcs();
    assert_eq!(arcs.len(), 2 * topology.edges().len());
    assert!(arcs.is_sorted_by_key(|arc| (arc.receiver, arc.sender)));
    let directions = arcs.iter().map(|a| (a.sender, a.receiver, a.edge));
    let directions: HashSet<_> = directions.collect();
    assert_eq!(directions.len(), arcs.len());
    for arc in arcs {
        assert!(directions.contains(&(arc.receiver, arc.sender, arc.edge)));
        let ends = topology.edges()[arc.edge.index()].vertices;
        assert!(ends == [arc.sender, arc.receiver] || ends == [arc.receiver, arc.sender]);
    }
    let mut next = 0;
    for vertex in 0..topology.vertex_count() as u32 {
        let range = topology.arcs_into(VertexId(vertex));
        assert_eq!(range.start, next);
        let mut here = arcs[range.clone()].iter();
        assert!(here.all(|arc| arc.receiver.0 == vertex));
        next = range.end;
    }
    assert_eq!(next, arcs.len());
}

fn euler(topology: &Topology) -> i64 {
    let (v, e) = (topology.vertex_count(), topology.edges().len());
    (v + topology.faces().len()) as i64 - e as i64
}

#[test]
fn a_pair_of_triangles() {
    let topology = Topology::new(4, &[[2, 3, 0], [0, 1, 2]]).unwrap();
    check_identities(&topology);
    // Edges by (smaller, larger) vertex: 0-1, 0-2, 0-3, 1-2, 2-3.
    let diagonal = topology.edges()[1];
    assert_eq!(diagonal.vertices, [VertexId(0), VertexId(2)]);
    assert_eq!(diagonal.faces, (FaceId(0), Some(FaceId(1))));
    assert_eq!(diagonal.opposite, (VertexId(3), Some(VertexId(1))));
    let face_edges = topology.face_edges();
    assert_eq!(face_edges[0].map(|e| e.0), [4, 2, 1]);
    assert_eq!(face_edges[1].map(|e| e.0), [0, 3, 1]);
    let into_2 = topology.arcs()[topology.arcs_into(VertexId(2))].iter();
    let senders: Vec<u32> = into_2.map(|arc| arc.sender.0).collect();
    assert_eq!(senders, [0, 1, 3]);
    assert_eq!(topology.boundary_vertices(), [true; 4]);
    assert_eq!(topology.face_indices(), [[2, 3, 0], [0, 1, 2]]);
}

#[test]
fn closed_and_separate_sheets_have_their_euler_characteristic() {
    // A tetrahedron is a sphere: 2, and no boundary.
    let sphere = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let topology = Topology::new(4, &sphere).unwrap();
    check_identities(&topology);
    assert_eq!(euler(&topology), 2);
    assert_eq!(topology.boundary_vertices(), [false; 4]);
    // Two triangles apart are two discs; joined in one vertex the count is one less.
    let apart = Topology::new(6, &[[0, 1, 2], [3, 4, 5]]).unwrap();
    let joined = Topology::new(5, &[[0, 1, 2], [2, 3, 4]]).unwrap();
    check_identities(&apart);
    check_identities(&joined);
    assert_eq!((euler(&apart), euler(&joined)), (2, 1));
}

#[test]
fn each_defect_has_its_numbers() {
    let (twice, same) = ("face 1 names vertex 2 twice", "faces 0 and 1 have the same");
    let cases: [(usize, &[[u32; 3]], &str); 10] = [
        (3, &[], "the mesh has no faces"),
        (
            4,
            &[[0, 1, 2], [0, 4, 3]],
            "face 1 names vertex 4, but the mesh has 4 vertices (0 to 3)",
        ),
        (3, &[[0, 1, 2], [2, 2, 0]], twice),
        (3, &[[0, 1, 2], [0, 2, 2]], twice),
        (3, &[[0, 1, 2], [2, 0, 2]], twice),
        (3, &[[0, 1, 2], [1, 2, 0]], same),
        (3, &[[0, 1, 2], [0, 2, 1]], same),
        (
            5,
            &[[0, 1, 2], [1, 0, 3], [0, 1, 4]],
            "edge 0-1 is shared by more than two faces ([0, 1, 2])",
        ),
        (
            4,
            &[[0, 1, 2], [0, 1, 3]],
            "faces 0 and 1 run through edge 0-1 in the same direction",
        ),
        (
            6,
            &[[0, 1, 3]],
            "vertex 2 belongs to no face (one of 3): remove",
        ),
    ];
    for (count, faces, words) in cases {
        let error = Topology::new(count, faces).unwrap_err().to_string();
        assert!(error.starts_with(words), "{error}");
    }
    let huge = Topology::new(LARGEST + 1, &[[0, 1, 3]]).unwrap_err();
    assert!(huge.to_string().contains("715827882"), "{huge}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn sheets_keep_the_identities(vertices in 4..200_usize, seed in any::<u64>()) {
        let topology = sheet(vertices, seed);
        check_identities(&topology);
        prop_assert_eq!(euler(&topology), 1);
    }

    /// Neither the order of the faces nor where each begins changes edges and arcs.
    #[test]
    fn the_listing_of_faces_does_not_matter(seed in any::<u64>(), shift in 0..100_usize) {
        let topology = sheet(60, seed);
        let mut faces = topology.face_indices();
        let count = faces.len();
        faces.rotate_left(shift % count);
        for (number, face) in faces.iter_mut().enumerate() {
            face.rotate_left((number + shift) % 3);
        }
        let other = Topology::new(60, &faces).unwrap();
        check_identities(&other);
        prop_assert_eq!(other.arcs(), topology.arcs());
        for (a, b) in other.edges().iter().zip(topology.edges()) {
            // The same edge, its first face perhaps the other one, with all that follows from it.
            let [from, to] = b.vertices;
            let same = a.vertices == [from, to] && a.opposite == b.opposite;
            let swapped = a.vertices == [to, from]
                && Some(a.opposite.0) == b.opposite.1
                && a.opposite.1 == Some(b.opposite.0);
            prop_assert!(same || swapped);
        }
    }
}

#[test]
fn sheets_are_connected_pieces_in_the_order_of_their_vertices() {
    // Two triangles that share an edge, one that does not, numbered in between; and two fans that
    // share a vertex are one piece.
    let topology = Topology::new(7, &[[0, 2, 4], [4, 2, 6], [1, 3, 5]]).unwrap();
    assert_eq!(topology.sheets(), [0, 1, 0, 1, 0, 1, 0]);
    let fans = Topology::new(5, &[[0, 1, 2], [2, 3, 4]]).unwrap();
    assert_eq!(fans.sheets(), [0; 5]);
}

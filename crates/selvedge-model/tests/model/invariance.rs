//! What the network sees of a cloth does not depend on how its vertices are numbered, in which order
//! its faces come, which corner each begins with or which way its edges run. That it does not depend
//! on where the cloth stands and which way it faces is a test of the stepper.
//!
//! An edge runs counter-clockwise through the first of its faces, so the order of faces turns the
//! edges between two of them round; those on the boundary run as their only face does, and turn
//! only with all faces. A hinge begins at its smaller vertex, so renumbering turns hinges round.
//! Arcs are matched by their ends.

use std::collections::BTreeMap;

use glam::{DVec3, Vec2, Vec3};
use proptest::prelude::*;
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles, Topology, VertexId};
use selvedge_model::{ClothGraph, EdgeFeature, Encoder, Frames, ModelSpec, Place, Window, Yaw};

/// Every feature over a window of two frames.
fn spec() -> ModelSpec {
    let mut spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 4, 1);
    spec.edge_features.insert(EdgeFeature::MaterialVector);
    spec
}

/// A cloth and its motion, before anything is done to it.
#[derive(Clone, Debug)]
struct Case {
    faces: Vec<[u32; 3]>,
    handles: Vec<u32>,
    mass: Vec<f32>,
    area: Vec<f32>,
    material: Vec<Vec2>,
    rest: Vec<Vec3>,
    frames: Vec<Vec<Vec3>>,
}

/// Random positions about a hanging square: ripples of up to 6 cm, moves of up to 2 cm.
fn case(side: usize, seed: u64, noise: &[f32]) -> Case {
    let vertices = side * side;
    let sheet = square(vertices, 1.0, seed).expect("a square");
    let shape = sheet.mesh.rest_shape(0.2);
    let draw = |k: usize, size: f32| {
        Vec3::from_array([0, 1, 2].map(|axis| size * noise[(3 * k + axis) % noise.len()]))
    };
    let rest: Vec<Vec3> = sheet.mesh.positions().iter().map(|p| p.as_vec3()).collect();
    let rest: Vec<Vec3> = (0..vertices).map(|v| rest[v] + draw(7 * v, 0.03)).collect();
    let frames: Vec<Vec<Vec3>> = (0..spec().history())
        .map(|frame| {
            let place = |v: usize| rest[v] + draw(11 * v + 5, 0.06) + draw(v + 131 * frame, 0.02);
            (0..vertices).map(place).collect()
        })
        .collect();
    let handles = sheet.labels["upper-corners"].clone();
    Case {
        faces: sheet
            .mesh
            .topology()
            .faces()
            .iter()
            .map(|f| f.map(|v| v.0))
            .collect(),
        handles,
        mass: shape.vertex_mass.iter().map(|&m| m as f32).collect(),
        area: shape.face_area.iter().map(|&a| a as f32).collect(),
        material: (0..vertices)
            .map(|v| sheet.mesh.material_coordinates()[v].as_vec2())
            .collect(),
        rest,
        frames,
    }
}

/// Features by vertex, and by the ends of arcs; each over the window.
struct Seen {
    nodes: Vec<Vec<f32>>,
    arcs: BTreeMap<(u32, u32), Vec<f32>>,
}

fn seen(case: &Case) -> Seen {
    let vertices = case.rest.len();
    let arrays = ClothArrays {
        vertex_mass: case.mass.clone(),
        face_area: case.area.clone(),
        material_coordinates: case.material.clone(),
        rest_positions: case.rest.clone(),
    };
    let topology = Topology::new(vertices, &case.faces).expect("a mesh");
    let handles = Handles::new(&case.handles, vertices).expect("corners");
    let cloth = Cloth::new(topology, handles, arrays).expect("a cloth");
    let environment = Environment {
        air_drag: 0.3,
        wind: DVec3::new(0.7, 0.2, -0.4),
        ..Environment::default()
    };
    let graph = ClothGraph::new(&cloth, environment, 60.0).expect("a graph");
    let spec = spec();
    let handles = graph.handles().select(&case.frames[case.frames.len() - 1]);
    let frames = Frames {
        positions: &case.frames,
        next_handles: &[],
        yaw: graph.frame().yaw(&handles, Yaw::WORLD),
    };
    let mut window = Window::default();
    let place = Place::alone(&graph);
    window.write(&spec, &graph, frames, &place);
    let rows = |values: &[f32], row: usize, count: usize, width: usize| -> Vec<f32> {
        let steps = values.chunks_exact(count * width);
        steps
            .flat_map(|step| step[row * width..][..width].to_vec())
            .collect()
    };
    let node = |v| rows(&window.nodes, v, vertices, spec.node_width());
    let arc = |a| rows(&window.arcs, a, graph.arc_count(), spec.edge_width());
    let ends = graph
        .connectivity()
        .senders()
        .iter()
        .zip(graph.connectivity().receivers())
        .enumerate();
    Seen {
        nodes: (0..vertices).map(node).collect(),
        arcs: ends.map(|(a, (&s, &r))| ((s, r), arc(a))).collect(),
    }
}

/// The largest difference between two rows.
fn apart(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}

/// The largest value of a row.
fn size(row: &[f32]) -> f32 {
    row.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// A rearrangement of `count` things: thing k becomes number `order[k]`.
fn order(count: usize) -> impl Strategy<Value = Vec<u32>> {
    Just((0..count as u32).collect::<Vec<u32>>()).prop_shuffle()
}

const SIDE: usize = 4;

fn noise() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(-1.0..1.0_f32, 97)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn the_order_of_faces_and_their_first_corners_do_not_show(
        seed in 0..5_u64, noise in noise(), shuffle in order(18), corners in prop::collection::vec(0..3_usize, 18),
    ) {
        let start = case(SIDE, seed, &noise);
        prop_assume!(start.faces.len() <= 18);
        let count = start.faces.len();
        let kept: Vec<usize> = shuffle.iter().map(|&k| k as usize).filter(|&k| k < count).collect();
        let turned = Case {
            faces: kept.iter().map(|&k| {
                let mut face = start.faces[k];
                face.rotate_left(corners[k]);
                face
            }).collect(),
            area: kept.iter().map(|&k| start.area[k]).collect(),
            ..start.clone()
        };
        let (before, after) = (seen(&start), seen(&turned));
        for (a, b) in before.nodes.iter().zip(&after.nodes) {
            // Forces are sums over faces in another order: of up to 8 numbers as large as the sum
            // or larger, each rounded.
            prop_assert!(apart(a, b) <= 1e-6 * size(a).max(0.1));
        }
        prop_assert_eq!(before.arcs, after.arcs);
    }

    #[test]
    fn the_numbers_of_vertices_do_not_show(
        seed in 0..5_u64, noise in noise(), order in order(SIDE * SIDE),
    ) {
        let start = case(SIDE, seed, &noise);
        let renumbered = renumbered(&start, &order);
        let (before, after) = (seen(&start), seen(&renumbered));
        for (v, row) in before.nodes.iter().enumerate() {
            prop_assert!(apart(row, &after.nodes[order[v] as usize]) < 2e-6);
        }
        for ((sender, receiver), row) in &before.arcs {
            let ends = (order[*sender as usize], order[*receiver as usize]);
            // A hinge seen from its other end: the same angle up to rounding.
            prop_assert!(apart(row, &after.arcs[&ends]) < 2e-4, "{ends:?}");
        }
    }

    #[test]
    fn the_two_arcs_of_an_edge_are_each_others_reverse(seed in 0..5_u64, noise in noise()) {
        let seen = seen(&case(SIDE, seed, &noise));
        let signs = signs_of_reversal();
        for (&(sender, receiver), row) in &seen.arcs {
            let back = &seen.arcs[&(receiver, sender)];
            prop_assert_eq!(row.len() % signs.len(), 0);
            for (k, (there, back)) in row.iter().zip(back).enumerate() {
                prop_assert_eq!(*there, signs[k % signs.len()] * back, "column {}", k);
            }
        }
    }

    #[test]
    fn turning_all_faces_over_turns_every_edge_and_shows_in_the_sign_of_bending_alone(
        seed in 0..5_u64, noise in noise(),
    ) {
        let start = case(SIDE, seed, &noise);
        let mut over = start.clone();
        for face in &mut over.faces {
            face.swap(1, 2);
        }
        let ends = ends_of_edges(&start).into_iter().zip(ends_of_edges(&over));
        for (there, back) in ends {
            prop_assert_eq!(back, [there[1], there[0]], "the boundary, too");
        }
        let (before, after) = (seen(&start), seen(&over));
        for (a, b) in before.nodes.iter().zip(&after.nodes) {
            // The air presses on either side of a face alike; its velocity is a sum of three.
            prop_assert!(apart(a, b) < 2e-6);
        }
        let signs = signs_of_turning_over();
        for (ends, row) in &before.arcs {
            for (k, (a, b)) in row.iter().zip(&after.arcs[ends]).enumerate() {
                let difference = a - signs[k % signs.len()] * b;
                // π and -π are the same fold; angles at slivers are off by some tens of roundings.
                let whole = std::f32::consts::TAU * (difference / std::f32::consts::TAU).round();
                prop_assert!((difference - whole).abs() < 2e-4, "{ends:?}, column {k}");
            }
        }
    }
}

/// Change of each column of an arc in the reverse arc: vectors turn round, scalars stay.
fn signs_of_reversal() -> Vec<f32> {
    let spec = spec();
    let signs = spec.edge_features.iter().flat_map(|feature| match feature {
        EdgeFeature::Vector | EdgeFeature::RestVector => vec![-1.0, -1.0, -1.0, 1.0],
        EdgeFeature::MaterialVector => vec![-1.0, -1.0, 1.0],
        scalar => vec![1.0; scalar.width()],
    });
    signs.collect()
}

/// Change of each column of an arc when all faces are turned over: a ridge is then a valley.
fn signs_of_turning_over() -> Vec<f32> {
    let spec = spec();
    let signs = spec.edge_features.iter().flat_map(|feature| match feature {
        EdgeFeature::BendingAngle => vec![-1.0],
        other => vec![1.0; other.width()],
    });
    signs.collect()
}

/// The first and the second end of every edge; the numbers of edges do not depend on faces.
fn ends_of_edges(case: &Case) -> Vec<[u32; 2]> {
    let topology = Topology::new(case.rest.len(), &case.faces).expect("a cloth");
    let edges = topology.edges().iter();
    edges.map(|edge| edge.vertices.map(|v| v.0)).collect()
}

/// Vertex v becomes vertex `order[v]`.
fn renumbered(case: &Case, order: &[u32]) -> Case {
    let mut old = vec![0; order.len()];
    for (v, &new) in order.iter().enumerate() {
        old[new as usize] = v;
    }
    let number = |v: u32| order[VertexId(v).index()];
    fn moved<T: Copy>(values: &[T], old: &[usize]) -> Vec<T> {
        old.iter().map(|&v| values[v]).collect()
    }
    Case {
        faces: case.faces.iter().map(|face| face.map(number)).collect(),
        handles: case.handles.iter().map(|&v| number(v)).collect(),
        mass: moved(&case.mass, &old),
        area: case.area.clone(),
        material: moved(&case.material, &old),
        rest: moved(&case.rest, &old),
        frames: case.frames.iter().map(|frame| moved(frame, &old)).collect(),
    }
}

//! Columns and corrections turn with the cloth, half turns change signs only, and a correction is
//! the inverse of its target.

use glam::DQuat;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{Cloth, Environment, Handles};

use super::*;
use crate::test_cloth::parts;

const TURNS: [HalfTurns; 4] = [
    turns(false, false),
    turns(true, false),
    turns(false, true),
    turns(true, true),
];

const fn turns(along: bool, over: bool) -> HalfTurns {
    HalfTurns { along, over }
}

/// The stiffness of a soft knit.
pub(crate) const SOFT: Stiffness = Stiffness {
    stretch: 20.0,
    bend: 2e-5,
    density: 0.15,
};

/// A state of a cloth that owns its rows.
#[derive(Clone)]
pub(crate) struct Shape {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) velocities: Vec<DVec3>,
}

impl Shape {
    /// `places` shaken by up to `size` `[m]`, at velocities of that size per frame.
    pub(crate) fn near(places: &[DVec3], size: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || {
            let mut one = || size * (2.0 * rng.random::<f64>() - 1.0);
            DVec3::new(one(), one(), one())
        };
        Self {
            positions: places.iter().map(|p| *p + draw()).collect(),
            velocities: places.iter().map(|_| 60.0 * draw()).collect(),
        }
    }

    pub(crate) fn as_motion(&self) -> MotionState<'_> {
        MotionState {
            positions: &self.positions,
            velocities: &self.velocities,
        }
    }

    fn turned(&self, by: DQuat, moved: DVec3) -> Self {
        Self {
            positions: self.positions.iter().map(|p| by * *p + moved).collect(),
            velocities: self.velocities.iter().map(|v| by * *v).collect(),
        }
    }
}

/// The columns over frames.
pub(crate) fn of_frames(neighbours: Neighbours) -> ColumnSet {
    ColumnSet {
        neighbours,
        differences: Differences::Frames,
    }
}

/// A predicted frame with the states before it, and the truth.
struct Case {
    graph: ClothGraph,
    /// Before, last, predicted, true.
    shapes: [Shape; 4],
    wind: DVec3,
    gravity: DVec3,
}

fn case(side: usize, seed: u64) -> Case {
    let graph = parts(side, seed).graph();
    let rest: Vec<DVec3> = graph
        .rest_positions()
        .iter()
        .map(|p| p.as_dvec3())
        .collect();
    Case {
        shapes: [10, 11, 12, 13].map(|of| Shape::near(&rest, 0.01, seed + of)),
        wind: DVec3::new(0.4, 0.1, -0.7),
        gravity: DVec3::new(0.0, -9.81, 0.0),
        graph,
    }
}

impl Case {
    fn frame(&self) -> PredictedFrame<'_> {
        PredictedFrame {
            before: Some(self.shapes[0].as_motion()),
            substeps: None,
            last: self.shapes[1].as_motion(),
            predicted: self.shapes[2].as_motion(),
            wind: self.wind,
            gravity: self.gravity,
            held: self.graph.handle_mask(),
        }
    }

    fn columns(&self, turns: HalfTurns) -> CorrectionColumns {
        self.columns_of(Neighbours::Arcs, turns)
    }

    fn columns_of(&self, neighbours: Neighbours, turns: HalfTurns) -> CorrectionColumns {
        let mut columns =
            CorrectionColumns::new(&self.graph, SOFT, 1.0 / 60.0, of_frames(neighbours));
        columns.write(&self.graph, &self.frame(), turns);
        columns
    }

    fn target(&self, columns: &CorrectionColumns) -> Vec<f32> {
        let mut rows = Vec::new();
        let [_, _, predicted, truth] = &self.shapes;
        columns.target(predicted.as_motion(), truth.as_motion(), &mut rows);
        rows
    }
}

#[track_caller]
fn assert_near(found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{k}: {a} {b}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn columns_and_corrections_turn_with_the_cloth(
        seed in 0_u64..1000,
        axis in prop::array::uniform3(-1.0..1.0_f64),
        angle in 0.0..6.0_f64,
    ) {
        let axis = DVec3::from_array(axis);
        prop_assume!(axis.length() > 0.1);
        let by = DQuat::from_axis_angle(axis.normalize(), angle);
        let case = case(4, seed);
        let turned = Case {
            graph: case.graph.clone(),
            shapes: case.shapes.each_ref().map(|s| s.turned(by, DVec3::new(3.0, -2.0, 5.0))),
            wind: by * case.wind,
            gravity: by * case.gravity,
        };
        let there = turned.columns(HalfTurns::default());
        let here = case.columns(HalfTurns::default());
        // Rounding of f32 in frames, strains and angles of edges of a third of a metre.
        assert_near(&there.nodes, &here.nodes, 1e-5);
        assert_near(&there.arcs, &here.arcs, 1e-5);
        // Columns that see nothing would not change either.
        let wind = Case { wind: turned.wind + DVec3::splat(5.0), ..turned };
        let moved = wind.columns(HalfTurns::default());
        prop_assert!(moved.nodes.iter().zip(&here.nodes).any(|(a, b)| (a - b).abs() > 1e-3));
        // The same rows are the same correction, turned.
        let rows = case.target(&here);
        assert_near(&wind.target(&there), &rows, 1e-6);
        let apply = |case: &Case, columns: &CorrectionColumns| {
            let Shape { mut positions, mut velocities } = case.shapes[2].clone();
            columns.apply(&rows, case.graph.handle_mask(), &mut positions, &mut velocities);
            Shape { positions, velocities }
        };
        let expected = apply(&case, &here).turned(by, DVec3::new(3.0, -2.0, 5.0));
        let found = apply(&wind, &there);
        for (a, b) in found.positions.iter().zip(&expected.positions) {
            prop_assert!(a.distance(*b) < 1e-7, "{a} {b}");
        }
        for (a, b) in found.velocities.iter().zip(&expected.velocities) {
            prop_assert!(a.distance(*b) < 1e-5, "{a} {b}");
        }
    }
}

#[test]
fn half_turns_change_the_signs_of_components_only() {
    let case = case(4, 5);
    let straight = case.columns(HalfTurns::default());
    let straight_target = case.target(&straight);
    for turns in TURNS {
        let columns = case.columns(turns);
        let [x, z] = [turns.along, turns.over].map(|turn| if turn { -1.0 } else { 1.0 });
        let axes = [x, x * z, z];
        let mut nodes = straight.nodes.clone();
        for row in nodes.as_chunks_mut::<NODE_COLUMNS>().0 {
            (0..18).for_each(|k| row[k] *= axes[k % 3]);
        }
        assert_near(&columns.nodes, &nodes, 1e-6);
        let mut arcs = straight.arcs.clone();
        for row in arcs.as_chunks_mut::<ARC_COLUMNS>().0 {
            (0..12).for_each(|k| row[k] *= axes[k % 3]);
            // The sender's normal is turned as well as the axes it is written in.
            (12..15).for_each(|k| row[k] *= z * axes[k % 3]);
            // Both bending angles, and sin 2φ.
            for k in [17, 18, 20] {
                row[k] *= z;
            }
        }
        assert_near(&columns.arcs, &arcs, 1e-6);
        let mut target = straight_target.clone();
        for row in target.as_chunks_mut::<6>().0 {
            (0..6).for_each(|k| row[k] *= axes[k % 3]);
        }
        assert_near(&case.target(&columns), &target, 1e-6);
    }
}

/// The sums over the arcs of each vertex from the columns of the arcs themselves, in the order in
/// which the vertex has them.
fn sums_by_hand(graph: &ClothGraph, arcs: &[f32]) -> Vec<Vec<f32>> {
    let mut sums = vec![vec![0.0_f64; SUM_COLUMNS]; graph.vertex_count()];
    let mut counts = vec![0.0; graph.vertex_count()];
    let vectors = graph.material_vectors();
    for (edge, both) in graph.edge_arcs().iter().enumerate() {
        for (side, &arc) in both.iter().enumerate() {
            let receiver = graph.receivers()[arc as usize] as usize;
            let row = &arcs[arc as usize * ARC_COLUMNS..][..ARC_COLUMNS];
            let angle = f64::from(vectors[edge][side].to_angle());
            let (double_cosine, double_sine) = ((2.0 * angle).cos(), (2.0 * angle).sin());
            let of_vectors = [angle.cos(), angle.sin(), 1.0, double_cosine, double_sine];
            let sum = &mut sums[receiver];
            for field in 0..4 {
                for (k, weight) in of_vectors.iter().enumerate() {
                    for axis in 0..3 {
                        sum[(5 * field + k) * 3 + axis] +=
                            weight * f64::from(row[3 * field + axis]);
                    }
                }
            }
            for scalar in 0..4 {
                for (k, weight) in of_vectors[2..].iter().enumerate() {
                    sum[60 + 3 * scalar + k] += weight * f64::from(row[15 + scalar]);
                }
            }
            for k in 0..3 {
                sum[72 + k] += f64::from(row[21 + k]);
            }
            counts[receiver] += 1.0;
        }
    }
    let means = sums.iter().zip(&counts);
    means
        .map(|(sum, count)| sum.iter().map(|x| (x / count) as f32).collect())
        .collect()
}

#[test]
fn sums_are_those_of_the_columns_of_the_arcs() {
    let case = case(4, 3);
    let straight = HalfTurns::default();
    let arcs = case.columns(straight);
    let sums = case.columns_of(Neighbours::Sums, straight);
    assert!(sums.arcs.is_empty());
    let expected = sums_by_hand(&case.graph, &arcs.arcs);
    let rows = sums
        .nodes
        .chunks_exact(of_frames(Neighbours::Sums).node_columns());
    let own = arcs.nodes.as_chunks::<NODE_COLUMNS>().0;
    for ((row, own), expected) in rows.zip(own).zip(&expected) {
        assert_eq!(&row[..NODE_COLUMNS], own);
        // Rounding of f32 in sums of about six arcs.
        assert_near(&row[NODE_COLUMNS..], expected, 1e-5);
    }
    let widths = of_frames(Neighbours::Sums)
        .groups()
        .map(|groups| groups.iter().sum::<usize>());
    assert_eq!(widths, [of_frames(Neighbours::Sums).node_columns(), 0, 6]);
}

#[test]
fn half_turns_change_the_signs_of_sums_only() {
    let case = case(4, 5);
    let straight = case.columns_of(Neighbours::Sums, HalfTurns::default());
    for turns in TURNS {
        let [x, z] = [turns.along, turns.over].map(|turn| if turn { -1.0 } else { 1.0 });
        let axes = [x, x * z, z];
        // Of cos φ, sin φ, 1, cos 2φ, sin 2φ.
        let weights = [x, x * z, 1.0, 1.0, z];
        let mut nodes = straight.nodes.clone();
        for row in nodes.chunks_exact_mut(of_frames(Neighbours::Sums).node_columns()) {
            (0..18).for_each(|k| row[k] *= axes[k % 3]);
            let sums = &mut row[NODE_COLUMNS..];
            (0..60).for_each(|k| sums[k] *= axes[k % 3] * weights[k / 3 % 5]);
            // Strains, then the two angles, whose sign is that of the side.
            (0..12).for_each(|k| sums[60 + k] *= weights[2 + k % 3] * if k < 6 { 1.0 } else { z });
        }
        assert_near(
            &case.columns_of(Neighbours::Sums, turns).nodes,
            &nodes,
            1e-6,
        );
    }
}

#[test]
fn a_target_leads_to_the_truth_and_held_vertices_stay() {
    let case = case(4, 9);
    let [_, _, predicted, truth] = &case.shapes;
    let held = case.graph.handle_mask();
    assert_eq!(held.iter().filter(|held| **held).count(), 2);
    for turns in TURNS {
        let columns = case.columns(turns);
        let Shape {
            mut positions,
            mut velocities,
        } = predicted.clone();
        columns.apply(
            &case.target(&columns),
            held,
            &mut positions,
            &mut velocities,
        );
        for (v, &held) in held.iter().enumerate() {
            let to = if held { predicted } else { truth };
            let off = positions[v].distance(to.positions[v]);
            assert!(off < 1e-8, "{turns:?} {v}: {off}");
            let off = velocities[v].distance(to.velocities[v]);
            assert!(off < 1e-6, "{turns:?} {v}: {off}");
        }
    }
}

#[test]
fn the_frames_of_a_flat_sheet_lie_along_its_threads() {
    let sheet = square(&SquareSpec {
        vertices: 16,
        size: 1.0,
        seed: 3,
    })
    .expect("a square");
    let handles = Handles::new(&[0], 16).expect("a handle");
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).expect("a cloth");
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph");
    let uv = graph.material_coordinates();
    // The pattern laid flat in another plane: u along `u`, v along `w`.
    let (u, w) = (DVec3::new(0.0, 0.6, 0.8), DVec3::new(1.0, 0.0, 0.0));
    let place = |p: &glam::Vec2| f64::from(p.x) * u + f64::from(p.y) * w;
    let flat = Shape {
        positions: uv.iter().map(place).collect(),
        velocities: vec![DVec3::ZERO; 16],
    };
    let gravity = DVec3::new(0.0, -9.81, 0.0);
    let frame = PredictedFrame {
        before: None,
        substeps: None,
        last: flat.as_motion(),
        predicted: flat.as_motion(),
        wind: DVec3::ZERO,
        gravity,
        held: &[false; 16],
    };
    let mut columns = CorrectionColumns::new(&graph, SOFT, 1.0 / 60.0, of_frames(Neighbours::Arcs));
    columns.write(&graph, &frame, HalfTurns::default());
    let normal = u.cross(w);
    let down = gravity / 3600.0;
    for row in columns.nodes.as_chunks::<NODE_COLUMNS>().0 {
        let expected = [u, w, normal].map(|axis| axis.dot(down) as f32);
        assert_near(&row[15..18], &expected, 1e-6);
        assert_near(&row[..15], &[0.0; 15], 1e-7);
        assert_near(&row[18..], &[0.0, 0.0], 0.0);
    }
    // Vectors along arcs are those of the pattern, and nothing is strained or bent.
    for (&arcs, edge) in graph.edge_arcs().iter().zip(graph.topology().edges()) {
        let [a, b] = edge.vertices.map(|v| uv[v.index()]);
        let d = (a - b).normalize();
        let rows = columns.arcs.as_chunks::<ARC_COLUMNS>().0;
        for (arc, sign) in arcs.iter().zip([1.0, -1.0]) {
            let row = &rows[*arc as usize];
            assert_near(&row[..3], &[sign * d.x, sign * d.y, 0.0], 1e-5);
            assert_near(&row[12..15], &[0.0, 0.0, 1.0], 1e-6);
            assert_near(&row[15..19], &[0.0; 4], 1e-5);
            let double = [d.x * d.x - d.y * d.y, 2.0 * d.x * d.y];
            assert_near(&row[19..21], &double, 1e-5);
            assert_near(&row[21..22], &[(a - b).length().ln()], 1e-5);
        }
    }
}

#[test]
fn an_arc_has_the_stiffness_of_the_face_to_its_left() {
    let case = case(5, 1);
    let stiff = Stiffness {
        stretch: 40.0,
        bend: 8e-5,
        density: 0.3,
    };
    let of = |face: FaceId| {
        if face.index().is_multiple_of(3) {
            stiff
        } else {
            SOFT
        }
    };
    let arcs = |stiffness: &dyn Fn(FaceId) -> Stiffness| {
        let mut columns = CorrectionColumns::of_faces(
            &case.graph,
            stiffness,
            1.0 / 60.0,
            of_frames(Neighbours::Arcs),
        );
        columns.write(&case.graph, &case.frame(), HalfTurns::default());
        columns.arcs
    };
    let [mixed, all_stiff, all_soft] = [arcs(&of), arcs(&|_| stiff), arcs(&|_| SOFT)];
    assert_eq!(all_soft, case.columns(HalfTurns::default()).arcs);
    let row = |arcs: &[f32], arc: u32| arcs.as_chunks::<ARC_COLUMNS>().0[arc as usize];
    for (&pair, edge) in case
        .graph
        .edge_arcs()
        .iter()
        .zip(case.graph.topology().edges())
    {
        let faces = [edge.faces.0, edge.faces.1.unwrap_or(edge.faces.0)];
        for (arc, face) in pair.into_iter().zip(faces) {
            let own = if of(face) == stiff {
                &all_stiff
            } else {
                &all_soft
            };
            assert_eq!(row(&mixed, arc), row(own, arc));
            assert_ne!(row(&all_stiff, arc), row(&all_soft, arc));
        }
    }
}

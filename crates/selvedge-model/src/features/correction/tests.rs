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

/// A predicted frame with the states before it, and the truth.
struct Case {
    graph: ClothGraph,
    /// One substep before the frame, at its start, one before its end, at its end, and in truth.
    shapes: [Shape; 5],
    smoothed: [Vec<DVec3>; 2],
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
        shapes: [9, 10, 11, 12, 13].map(|of| Shape::near(&rest, 0.01, seed + of)),
        smoothed: [14, 15].map(|of| Shape::near(&rest, 0.01, seed + of).velocities),
        wind: DVec3::new(0.4, 0.1, -0.7),
        gravity: DVec3::new(0.0, -9.81, 0.0),
        graph,
    }
}

impl Case {
    fn frame(&self) -> PredictedFrame<'_> {
        PredictedFrame {
            substeps: FrameSubsteps {
                earlier: Some(self.shapes[0].as_motion()),
                middle: self.shapes[2].as_motion(),
                part: 0.5,
                smoothed: &self.smoothed,
                fell_back: 0.5,
            },
            last: self.shapes[1].as_motion(),
            predicted: self.shapes[3].as_motion(),
            wind: self.wind,
            gravity: self.gravity,
            held: self.graph.handle_mask(),
        }
    }

    fn columns(&self, turns: HalfTurns) -> CorrectionColumns {
        let mut columns = CorrectionColumns::new(&self.graph, SOFT, 1.0 / 60.0);
        columns.write(&self.graph, &self.frame(), turns);
        columns
    }

    fn target(&self, columns: &CorrectionColumns) -> Vec<f32> {
        let mut rows = Vec::new();
        let [.., predicted, truth] = &self.shapes;
        columns.target(predicted.as_motion(), truth.as_motion(), &mut rows);
        columns.to_metres(&mut rows);
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
            smoothed: case.smoothed.each_ref().map(|rows| rows.iter().map(|x| by * *x).collect()),
            wind: by * case.wind,
            gravity: by * case.gravity,
        };
        let there = turned.columns(HalfTurns::default());
        let here = case.columns(HalfTurns::default());
        // Rounding of f32 in frames, strains and angles of edges of a third of a metre.
        assert_near(&there.nodes, &here.nodes, 1e-5);
        // Columns that see nothing would not change either.
        let wind = Case { wind: turned.wind + DVec3::splat(5.0), ..turned };
        let moved = wind.columns(HalfTurns::default());
        prop_assert!(moved.nodes.iter().zip(&here.nodes).any(|(a, b)| (a - b).abs() > 1e-3));
        // The same rows are the same correction, turned.
        let rows = case.target(&here);
        assert_near(&wind.target(&there), &rows, 1e-6);
        let apply = |case: &Case, columns: &CorrectionColumns| {
            let Shape { mut positions, mut velocities } = case.shapes[3].clone();
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
fn half_turns_change_signs_only() {
    let case = case(4, 5);
    let straight = case.columns(HalfTurns::default());
    let straight_target = case.target(&straight);
    for turns in TURNS {
        let columns = case.columns(turns);
        let [x, z] = [turns.along, turns.over].map(|turn| if turn { -1.0 } else { 1.0 });
        let axes = [x, x * z, z];
        // Of cos φ, sin φ, 1, cos 2φ, sin 2φ.
        let weights = [x, x * z, 1.0, 1.0, z];
        let mut nodes = straight.nodes.clone();
        for row in nodes.as_chunks_mut::<NODE_COLUMNS>().0 {
            (0..30).for_each(|k| row[k] *= axes[k % 3]);
            let sums = &mut row[OWN_COLUMNS..];
            (0..60).for_each(|k| sums[k] *= axes[k % 3] * weights[k / 3 % 5]);
            // Strains, then the two angles, whose sign is that of the side.
            (0..12).for_each(|k| sums[60 + k] *= weights[2 + k % 3] * if k < 6 { 1.0 } else { z });
        }
        assert_near(&columns.nodes, &nodes, 1e-6);
        let mut target = straight_target.clone();
        for row in target.as_chunks_mut::<6>().0 {
            (0..6).for_each(|k| row[k] *= axes[k % 3]);
        }
        assert_near(&case.target(&columns), &target, 1e-6);
    }
}

/// The sums over the arcs of each vertex, arc by arc, from positions, velocities and angles.
fn sums_by_hand(case: &Case, columns: &CorrectionColumns) -> Vec<Vec<f32>> {
    let graph = &case.graph;
    let [earlier, last, middle, predicted, _] = &case.shapes;
    let mut sums = vec![vec![0.0_f64; SUM_COLUMNS]; graph.vertex_count()];
    let mut counts = vec![0.0; graph.vertex_count()];
    let vectors = graph.material_vectors();
    let h = 1.0 / 60.0;
    let second = |v: usize| h * (predicted.velocities[v] - middle.velocities[v]);
    let third = |v: usize| second(v) - h * (middle.velocities[v] - last.velocities[v]);
    assert_eq!(earlier.positions.len(), sums.len());
    for (number, edge) in graph.topology().edges().iter().enumerate() {
        let [a, b] = edge.vertices.map(|v| v.index());
        let length = f64::from(columns.lengths[number]);
        for (side, (sender, receiver)) in [(a, b), (b, a)].into_iter().enumerate() {
            let axes = columns.frames[receiver].as_dmat3().transpose();
            let scale = f64::from(columns.scales[receiver]);
            let along = |x: DVec3, y: DVec3, unit: f64| axes * (x - y) / unit;
            let of_arc = [
                along(
                    predicted.positions[sender],
                    predicted.positions[receiver],
                    length,
                ),
                along(
                    h * last.velocities[sender],
                    h * last.velocities[receiver],
                    length,
                ),
                along(second(sender), second(receiver), scale),
                along(third(sender), third(receiver), scale),
            ];
            let strain =
                |shape: &Shape| shape.positions[a].distance(shape.positions[b]) / length - 1.0;
            let [bent, bends] = columns.angles[number].map(f64::from);
            let scalars = [strain(last), strain(predicted), bends, bends - bent];
            let angle = f64::from(vectors[number][side].to_angle());
            let (double_sine, double_cosine) = (2.0 * angle).sin_cos();
            let weights = [angle.cos(), angle.sin(), 1.0, double_cosine, double_sine];
            let sum = &mut sums[receiver];
            for (field, vector) in of_arc.iter().enumerate() {
                for (k, weight) in weights.iter().enumerate() {
                    for axis in 0..3 {
                        sum[(5 * field + k) * 3 + axis] += weight * vector[axis];
                    }
                }
            }
            for (field, scalar) in scalars.iter().enumerate() {
                for (k, weight) in weights[2..].iter().enumerate() {
                    sum[60 + 3 * field + k] += weight * scalar;
                }
            }
            for k in 0..3 {
                sum[72 + k] += f64::from(columns.still[number][side][2 + k]);
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
fn sums_are_over_the_arcs_of_a_vertex() {
    let case = case(4, 3);
    let columns = case.columns(HalfTurns::default());
    let expected = sums_by_hand(&case, &columns);
    let rows = columns.nodes.as_chunks::<NODE_COLUMNS>().0;
    for (row, expected) in rows.iter().zip(&expected) {
        // Rounding of f32 in sums of about six arcs.
        assert_near(&row[OWN_COLUMNS..], expected, 2e-5);
    }
    let widths = correction_groups().map(|groups| groups.iter().sum::<usize>());
    assert_eq!(widths, [NODE_COLUMNS, 6]);
}

#[test]
fn a_target_leads_to_the_truth_and_held_vertices_stay() {
    let case = case(4, 9);
    let [.., predicted, truth] = &case.shapes;
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
    let smoothed = [0; 2].map(|_| vec![DVec3::ZERO; 16]);
    let frame = PredictedFrame {
        substeps: FrameSubsteps {
            earlier: None,
            middle: flat.as_motion(),
            part: 0.5,
            smoothed: &smoothed,
            fell_back: 0.0,
        },
        last: flat.as_motion(),
        predicted: flat.as_motion(),
        wind: DVec3::ZERO,
        gravity,
        held: &[false; 16],
    };
    let mut columns = CorrectionColumns::new(&graph, SOFT, 1.0 / 60.0);
    columns.write(&graph, &frame, HalfTurns::default());
    let normal = u.cross(w);
    let down = gravity / 3600.0;
    for row in columns.nodes.as_chunks::<NODE_COLUMNS>().0 {
        let expected = [u, w, normal].map(|axis| axis.dot(down) as f32);
        assert_near(&row[27..30], &expected, 1e-6);
        assert_near(&row[..27], &[0.0; 27], 1e-7);
        assert_near(&row[30..32], &[0.0, 0.0], 0.0);
        // Nothing is strained or bent.
        assert_near(&row[OWN_COLUMNS + 60..][..12], &[0.0; 12], 1e-5);
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
    let still = |stiffness: &dyn Fn(FaceId) -> Stiffness| {
        CorrectionColumns::of_faces(&case.graph, stiffness, 1.0 / 60.0).still
    };
    let [mixed, all_stiff, all_soft] = [still(&of), still(&|_| stiff), still(&|_| SOFT)];
    assert_eq!(all_soft, case.columns(HalfTurns::default()).still);
    for (number, edge) in case.graph.topology().edges().iter().enumerate() {
        let faces = [edge.faces.0, edge.faces.1.unwrap_or(edge.faces.0)];
        for (side, face) in faces.into_iter().enumerate() {
            let own = if of(face) == stiff {
                &all_stiff
            } else {
                &all_soft
            };
            assert_eq!(mixed[number][side], own[number][side]);
            assert_ne!(all_stiff[number][side], all_soft[number][side]);
        }
    }
}

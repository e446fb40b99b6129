//! Columns whose differences are over substeps: by hand from the states, the same for a motion in
//! proportion but for the columns that are absolute, and turned with the cloth. A correction is the
//! inverse of its target.

use glam::DQuat;

use super::super::tests::{SOFT, Shape};
use super::super::{ColumnSet, HalfTurns, MotionState, Neighbours};
use super::*;
use crate::spec::Differences;
use crate::test_cloth::parts;

const H: f64 = 1.0 / 60.0;
const TIMES: FrameTimes = FrameTimes {
    frame: H,
    substep: 0.5 * H,
};

/// A frame of two substeps.
struct Case {
    graph: ClothGraph,
    /// One substep before the frame, at its start, one before its end, at its end, and in truth.
    shapes: [Shape; 5],
    smoothed: [Vec<DVec3>; 2],
    wind: DVec3,
    gravity: DVec3,
}

/// Shapes that lie `size` times as far from a hanging square as random numbers say.
fn case(size: f64) -> Case {
    let graph = parts(4, 7).graph();
    let rest: Vec<DVec3> = graph
        .rest_positions()
        .iter()
        .map(|p| p.as_dvec3())
        .collect();
    let shapes = [1, 2, 3, 4, 5].map(|seed| Shape::near(&rest, 1e-3 * size, seed));
    let mut smoothed = [Vec::new(), Vec::new()];
    let states = [1, 2, 3].map(|k: usize| shapes[k].as_motion());
    rough_fields(states, TIMES, &mut smoothed);
    // Any linear map will do for that of the solver.
    for field in &mut smoothed {
        field.iter_mut().for_each(|value| *value *= 0.3);
    }
    Case {
        graph,
        shapes,
        smoothed,
        wind: DVec3::ZERO,
        gravity: DVec3::new(0.0, -9.81, 0.0),
    }
}

impl Case {
    fn frame(&self, knows_earlier: bool) -> PredictedFrame<'_> {
        let [earlier, last, middle, predicted, _] = self.shapes.each_ref().map(Shape::as_motion);
        PredictedFrame {
            before: None,
            substeps: Some(FrameSubsteps {
                earlier: knows_earlier.then_some(earlier),
                middle,
                part: 0.5,
                smoothed: &self.smoothed,
                fell_back: 0.5,
            }),
            last,
            predicted,
            wind: self.wind,
            gravity: self.gravity,
            held: self.graph.handle_mask(),
        }
    }

    fn columns(&self, neighbours: Neighbours, knows_earlier: bool) -> CorrectionColumns {
        let of_model = ColumnSet {
            neighbours,
            differences: Differences::Substeps,
        };
        let mut columns = CorrectionColumns::new(&self.graph, SOFT, H, of_model);
        columns.write(
            &self.graph,
            &self.frame(knows_earlier),
            HalfTurns::default(),
        );
        columns
    }

    /// Third differences of the velocity of vertex `v` in the two substeps, times the frame `[m]`.
    fn third(&self, v: usize) -> [DVec3; 2] {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| H * self.shapes[k].velocities[v]);
        [d - c - (c - b), c - b - (b - a)]
    }

    fn scale(&self, v: usize) -> f64 {
        let mut vertices = vec![v];
        for (&s, &r) in self.graph.senders().iter().zip(self.graph.receivers()) {
            if r as usize == v {
                vertices.push(s as usize);
            }
        }
        let squares = vertices.iter().flat_map(|&v| self.third(v));
        (squares.map(|d| d.length_squared()).sum::<f64>() / vertices.len() as f64).sqrt()
    }
}

#[track_caller]
fn assert_near(found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{k}: {a} {b}");
    }
}

#[test]
fn columns_are_the_differences_of_the_states_over_the_scale() {
    let case = case(1.0);
    let columns = case.columns(Neighbours::Arcs, true);
    let lack = |from: &Shape, to: &Shape, v: usize| {
        to.positions[v] - from.positions[v] - 0.25 * H * (from.velocities[v] + to.velocities[v])
    };
    for (v, row) in columns.nodes.chunks_exact(34).enumerate() {
        let scale = case.scale(v);
        assert!((f64::from(columns.scales()[v]) / scale - 1.0).abs() < 1e-5);
        let [earlier, last, middle, end, _] = &case.shapes;
        let second = H * (end.velocities[v] - middle.velocities[v]);
        let [now, before] = case.third(v);
        let vectors = [
            second / scale,
            now / scale,
            before / scale,
            lack(middle, end, v) / scale,
            lack(last, middle, v) / scale,
            lack(earlier, last, v) / scale,
            0.3 * now / scale,
            0.3 * lack(middle, end, v) / scale,
            -H * last.velocities[v],
            H * H * case.gravity,
        ];
        let axes = columns.frames[v].transpose();
        let expected: Vec<f32> = vectors
            .iter()
            .flat_map(|vector| (axes * vector.as_vec3()).to_array())
            .collect();
        assert_near(&row[..30], &expected, 1e-4);
        let held = f32::from(u8::from(case.graph.handle_mask()[v]));
        assert_near(&row[30..], &[held, 1.0, scale.ln() as f32, 0.5], 1e-5);
    }
    // Along arcs, second and third differences are over the scale of the receiver.
    let arcs = case.graph.senders().iter().zip(case.graph.receivers());
    for ((&s, &r), row) in arcs.zip(columns.arcs.chunks_exact(24)) {
        let (s, r) = (s as usize, r as usize);
        let [_, _, middle, end, _] = &case.shapes;
        let second = |v: usize| H * (end.velocities[v] - middle.velocities[v]);
        let scale = f64::from(columns.scales()[r]);
        let axes = columns.frames[r].transpose();
        let expected = [second(s) - second(r), case.third(s)[0] - case.third(r)[0]];
        let expected: Vec<f32> = expected
            .iter()
            .flat_map(|d| (axes * (*d / scale).as_vec3()).to_array())
            .collect();
        assert_near(&row[6..12], &expected, 1e-4);
    }
    let groups = columns.of_model().groups();
    assert_eq!(groups.map(|g| g.iter().sum::<usize>()), [34, 24, 6]);
}

#[test]
fn a_first_substep_that_starts_anew_has_no_differences_from_before() {
    let case = case(1.0);
    for row in case.columns(Neighbours::Arcs, false).nodes.chunks_exact(34) {
        assert_eq!(
            (&row[6..9], &row[15..18], row[31]),
            (&[0.0; 3][..], &[0.0; 3][..], 0.0)
        );
    }
}

#[test]
fn a_motion_in_proportion_has_the_same_columns_and_corrections_in_proportion() {
    let (slow, fast) = (case(0.1), case(0.2));
    for neighbours in [Neighbours::Arcs, Neighbours::Sums] {
        let [a, b] = [&slow, &fast].map(|case| case.columns(neighbours, true));
        let width = a.of_model().node_columns();
        for (v, (p, q)) in a
            .nodes
            .chunks_exact(width)
            .zip(b.nodes.chunks_exact(width))
            .enumerate()
        {
            // The frames of the predicted cloth differ by 1e-4 m over edges of a third of a metre.
            assert_near(&p[..24], &q[..24], 1e-2);
            assert!((b.scales()[v] / a.scales()[v] - 2.0).abs() < 1e-4);
            assert!((q[32] - p[32] - 2.0_f32.ln()).abs() < 1e-4);
        }
        let mut rows = vec![1.0; 6 * slow.graph.vertex_count()];
        a.to_metres(&mut rows);
        for (row, scale) in rows.chunks_exact(6).zip(a.scales()) {
            assert_eq!(row, [*scale; 6]);
        }
    }
}

#[test]
fn a_cloth_at_rest_has_columns_that_are_numbers() {
    let mut case = case(0.0);
    let start = case.shapes[1].clone();
    case.shapes
        .iter_mut()
        .for_each(|shape| *shape = start.clone());
    let columns = case.columns(Neighbours::Sums, true);
    assert!(columns.nodes.iter().all(|x| x.is_finite()));
    assert!(columns.scales().iter().all(|&scale| scale == AT_REST));
}

#[test]
fn columns_and_corrections_turn_with_the_cloth() {
    let case = case(3.0);
    let by = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1);
    let turned = Case {
        graph: case.graph.clone(),
        shapes: case.shapes.clone().map(|shape| Shape {
            positions: shape.positions.iter().map(|p| by * *p).collect(),
            velocities: shape.velocities.iter().map(|v| by * *v).collect(),
        }),
        smoothed: case
            .smoothed
            .clone()
            .map(|f| f.iter().map(|x| by * *x).collect()),
        wind: by * case.wind,
        gravity: by * case.gravity,
    };
    for neighbours in [Neighbours::Arcs, Neighbours::Sums] {
        let [here, there] = [&case, &turned].map(|case| case.columns(neighbours, true));
        // Rounding of f32 in frames and in differences of positions over scales of 3 mm.
        assert_near(&there.nodes, &here.nodes, 2e-4);
        assert_near(&there.arcs, &here.arcs, 2e-4);
    }
}

#[test]
fn a_target_leads_to_the_truth() {
    let case = case(1.0);
    let columns = case.columns(Neighbours::Sums, true);
    let [predicted, truth] = [3, 4].map(|k: usize| case.shapes[k].as_motion());
    let mut rows = Vec::new();
    columns.target(predicted, truth, &mut rows);
    columns.to_metres(&mut rows);
    let Shape {
        mut positions,
        mut velocities,
    } = case.shapes[3].clone();
    let held = case.graph.handle_mask();
    columns.apply(&rows, held, &mut positions, &mut velocities);
    let MotionState {
        positions: to,
        velocities: at,
    } = truth;
    for v in (0..held.len()).filter(|&v| !held[v]) {
        assert!(positions[v].distance(to[v]) < 1e-9, "{v}");
        assert!(velocities[v].distance(at[v]) < 1e-7, "{v}");
    }
}

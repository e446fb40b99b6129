//! Differences over substeps: by hand from the states, and the same for a motion in proportion but
//! for the columns that are absolute.

use super::super::tests::{SOFT, Shape};
use super::super::{HalfTurns, NODE_COLUMNS, OWN_COLUMNS};
use super::*;
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
            substeps: FrameSubsteps {
                earlier: knows_earlier.then_some(earlier),
                middle,
                part: 0.5,
                smoothed: &self.smoothed,
                fell_back: 0.5,
            },
            last,
            predicted,
            wind: self.wind,
            gravity: self.gravity,
            held: self.graph.handle_mask(),
        }
    }

    fn columns(&self, knows_earlier: bool) -> CorrectionColumns {
        let mut columns = CorrectionColumns::new(&self.graph, SOFT, H);
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
    let columns = case.columns(true);
    let lack = |from: &Shape, to: &Shape, v: usize| {
        to.positions[v] - from.positions[v] - 0.25 * H * (from.velocities[v] + to.velocities[v])
    };
    for (v, row) in columns.nodes.chunks_exact(NODE_COLUMNS).enumerate() {
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
        assert_near(
            &row[30..OWN_COLUMNS],
            &[held, 1.0, scale.ln() as f32, 0.5],
            1e-5,
        );
    }
}

#[test]
fn a_first_substep_that_starts_anew_has_no_differences_from_before() {
    let case = case(1.0);
    for row in case.columns(false).nodes.chunks_exact(NODE_COLUMNS) {
        assert_eq!(
            (&row[6..9], &row[15..18], row[31]),
            (&[0.0; 3][..], &[0.0; 3][..], 0.0)
        );
    }
}

#[test]
fn a_motion_in_proportion_has_the_same_columns_and_corrections_in_proportion() {
    let (slow, fast) = (case(0.1), case(0.2));
    let [a, b] = [&slow, &fast].map(|case| case.columns(true));
    let rows = |columns: &CorrectionColumns| columns.nodes.as_chunks::<NODE_COLUMNS>().0.to_vec();
    for (v, (p, q)) in rows(&a).iter().zip(&rows(&b)).enumerate() {
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

#[test]
fn a_cloth_at_rest_has_columns_that_are_numbers() {
    let mut case = case(0.0);
    let start = case.shapes[1].clone();
    case.shapes
        .iter_mut()
        .for_each(|shape| *shape = start.clone());
    let columns = case.columns(true);
    assert!(columns.nodes.iter().all(|x| x.is_finite()));
    assert!(columns.scales().iter().all(|&scale| scale == AT_REST));
}

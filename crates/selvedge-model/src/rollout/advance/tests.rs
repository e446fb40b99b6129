//! A frame and its inverse, both ways.

use glam::{DVec3, Vec3};

use super::*;
use crate::test_cloth::{parts, shaken};

struct Case {
    graph: ClothGraph,
    previous: Vec<Vec3>,
    current: Vec<Vec3>,
    next_handles: Vec<Vec3>,
    yaw: Yaw,
}

fn case() -> Case {
    let graph = parts(5, 1).graph();
    let [previous, current, next] =
        [1, 2, 3].map(|seed| shaken(graph.cloth().rest_positions(), 0.02, seed));
    Case {
        next_handles: graph.handles().select(&next),
        yaw: Yaw::from_angle(0.7),
        graph,
        previous,
        current,
    }
}

impl Case {
    fn two(&self) -> TwoFrames<'_, Vec3> {
        TwoFrames {
            graph: &self.graph,
            previous: &self.previous,
            current: &self.current,
        }
    }

    fn advance(&self, rows: &[f32]) -> Result<Vec<Vec3>, NonFinite> {
        let mut next = vec![Vec3::ZERO; self.graph.vertex_count()];
        let acceleration = LocalAcceleration {
            yaw: self.yaw,
            rows,
        };
        advance(&self.two(), &self.next_handles, acceleration, &mut next)?;
        Ok(next)
    }

    fn is_free(&self, vertex: usize) -> bool {
        !self.graph.handle_mask()[vertex]
    }
}

/// Some accelerations of a few millimetres, `[vertices, 3]`.
fn accelerations(vertices: usize) -> Vec<f32> {
    let row = |k: usize| 1e-3 * ((k * 37 % 23) as f32 - 11.0);
    (0..3 * vertices).map(row).collect()
}

#[test]
fn in_f64_and_local_axes_it_is_the_same_equation() {
    let case = case();
    let local = |positions: &[Vec3]| -> Vec<DVec3> {
        let rows = positions.iter();
        rows.map(|p| case.yaw.to_local_f64(p.as_dvec3())).collect()
    };
    let (previous, current) = (local(&case.previous), local(&case.current));
    let frames = TwoFrames {
        graph: &case.graph,
        previous: &previous,
        current: &current,
    };
    let given = accelerations(case.graph.vertex_count());
    let rows = given.as_chunks::<3>().0.iter();
    let rows: Vec<DVec3> = rows.map(|a| Vec3::from_array(*a).as_dvec3()).collect();
    let mut next = vec![DVec3::ZERO; rows.len()];
    let handles = local(&case.next_handles);
    frames.moved(rows.iter().copied(), handles.iter().copied(), &mut next);
    let world = case.advance(&given).expect("finite");
    assert_eq!(case.graph.handles().select(&world), case.next_handles);
    for (v, (found, expected)) in next.iter().zip(local(&world)).enumerate() {
        assert!(found.distance(expected) < 1e-6);
        let back = frames.acceleration_to(*found, v);
        assert!(!case.is_free(v) || back.distance(rows[v]) < 1e-15);
    }
}

#[test]
fn a_position_that_is_not_finite_is_named() {
    let case = case();
    let mut rows = accelerations(case.graph.vertex_count());
    let free = (0..case.graph.vertex_count()).rfind(|&v| case.is_free(v));
    let free = free.expect("a free vertex");
    rows[3 * free + 1] = f32::NAN;
    let vertex = VertexId(free as u32);
    assert_eq!(case.advance(&rows), Err(NonFinite { vertex }));
}

#[test]
fn the_gradient_is_the_slope_of_the_frame() {
    let case = case();
    let rows = accelerations(case.graph.vertex_count());
    let count = case.graph.vertex_count();
    let by_next: Vec<Vec3> = (0..count)
        .map(
            |v| {
                if case.is_free(v) { Vec3::new(v as f32, -1.0, 0.5) } else { Vec3::ZERO }
            },
        )
        .collect();
    let [mut previous, mut current] = [(); 2].map(|()| vec![Vec3::ZERO; count]);
    advance_backward(&by_next, &mut previous, &mut current);
    let step = |v: usize| 0.01 * Vec3::new(1.0, v as f32 % 3.0, -0.5);
    let objective = |sign: f32| {
        let mut moved = self::case();
        for v in 0..count {
            moved.previous[v] += sign * step(v);
            moved.current[v] -= 2.0 * sign * step(v);
        }
        let next = moved.advance(&rows).expect("finite");
        let dots = next.iter().zip(&by_next);
        dots.map(|(p, g)| f64::from(p.dot(*g))).sum::<f64>()
    };
    let expected = 0.5 * (objective(1.0) - objective(-1.0));
    let dots = (0..count)
        .map(|v| f64::from(previous[v].dot(step(v))) - 2.0 * f64::from(current[v].dot(step(v))));
    let found: f64 = dots.sum();
    // Linear in the positions: f32 rounding of some two dozen terms.
    let allowed = 1e-4 * expected.abs().max(1.0);
    assert!((found - expected).abs() < allowed, "{found}, {expected}");
}

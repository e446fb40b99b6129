//! A frame and its inverse, both ways, and what comes after the integration.

use glam::{DVec3, Vec3};

use super::*;
use crate::spec::{EdgeLimits, Encoder};
use crate::test_cloth::{parts, shaken};

const KINDS: [Integration; 2] = [
    Integration::Inertial {},
    Integration::Carried {
        damping: 0.03,
        stiffness: 0.004,
    },
];

struct Case {
    graph: ClothGraph,
    previous: Vec<Vec3>,
    current: Vec<Vec3>,
    next_handles: Vec<Vec3>,
    yaw: Yaw,
    reference: Vec<Vec3>,
}

fn case(integration: Integration) -> Case {
    let graph = parts(5, 1).graph();
    let [previous, current, next] =
        [1, 2, 3].map(|seed| shaken(graph.rest_positions(), 0.02, seed));
    let mut case = Case {
        next_handles: graph.handles().select(&next),
        yaw: Yaw::from_angle(0.7),
        reference: Vec::new(),
        graph,
        previous,
        current,
    };
    let mut reference = Vec::new();
    integration.reference(&case.frames(), &mut reference);
    case.reference = reference;
    case
}

impl Case {
    fn frames(&self) -> LastFrames<'_> {
        LastFrames {
            graph: &self.graph,
            previous: &self.previous,
            current: &self.current,
            next_handles: &self.next_handles,
            yaw: self.yaw,
        }
    }

    fn two(&self) -> TwoFrames<'_, Vec3> {
        TwoFrames {
            graph: &self.graph,
            reference: &self.reference,
            current: &self.current,
        }
    }

    fn spec(&self, integration: Integration) -> ModelSpec {
        let mut spec = ModelSpec::physical(Encoder::MLP, 8, 1);
        spec.integration = integration;
        spec
    }

    fn advance(&self, spec: &ModelSpec, rows: &[f32]) -> Result<Vec<Vec3>, NonFinite> {
        let mut next = vec![Vec3::ZERO; self.graph.vertex_count()];
        let acceleration = LocalAcceleration {
            yaw: self.yaw,
            rows,
        };
        advance(
            spec,
            &self.two(),
            &self.next_handles,
            acceleration,
            &mut next,
        )?;
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
fn positions_lead_back_to_their_acceleration() {
    for integration in KINDS {
        let case = case(integration);
        let given = accelerations(case.graph.vertex_count());
        let next = case
            .advance(&case.spec(integration), &given)
            .expect("finite");
        let found = target_acceleration(&case.two(), case.yaw, &next);
        for (k, (found, given)) in found.iter().zip(&given).enumerate() {
            // Half a dozen roundings of positions of 1 m.
            let off = (found - given).abs();
            assert!(!case.is_free(k / 3) || off < 5e-7, "{integration:?}: {off}");
        }
    }
}

#[test]
fn the_acceleration_to_positions_leads_there() {
    for integration in KINDS {
        let case = case(integration);
        let mut target = shaken(case.graph.rest_positions(), 0.02, 9);
        for (vertex, p) in case
            .graph
            .handles()
            .vertices()
            .iter()
            .zip(&case.next_handles)
        {
            target[vertex.index()] = *p;
        }
        let acceleration = target_acceleration(&case.two(), case.yaw, &target);
        let spec = case.spec(integration);
        let next = case.advance(&spec, &acceleration).expect("finite");
        for (found, expected) in next.iter().zip(&target) {
            assert!(found.distance(*expected) < 1e-6, "{integration:?}");
        }
    }
}

#[test]
fn in_f64_and_local_axes_it_is_the_same_equation() {
    for integration in KINDS {
        let case = case(integration);
        let local = |positions: &[Vec3]| -> Vec<DVec3> {
            let rows = positions.iter();
            rows.map(|p| case.yaw.to_local_f64(p.as_dvec3())).collect()
        };
        let (reference, current) = (local(&case.reference), local(&case.current));
        let frames = TwoFrames {
            graph: &case.graph,
            reference: &reference,
            current: &current,
        };
        let given = accelerations(case.graph.vertex_count());
        let rows = given.as_chunks::<3>().0.iter();
        let rows: Vec<DVec3> = rows.map(|a| Vec3::from_array(*a).as_dvec3()).collect();
        let mut next = vec![DVec3::ZERO; rows.len()];
        let handles = local(&case.next_handles);
        frames.moved(rows.iter().copied(), handles.iter().copied(), &mut next);
        let world = case
            .advance(&case.spec(integration), &given)
            .expect("finite");
        for (v, (found, expected)) in next.iter().zip(local(&world)).enumerate() {
            assert!(found.distance(expected) < 1e-6, "{integration:?}");
            let back = frames.acceleration_to(*found, v);
            assert!(!case.is_free(v) || back.distance(rows[v]) < 1e-15);
        }
    }
}

#[test]
fn handles_take_their_targets_and_edges_their_limits() {
    let case = case(KINDS[0]);
    let mut spec = case.spec(KINDS[0]);
    let rows: Vec<f32> = accelerations(case.graph.vertex_count());
    let rows: Vec<f32> = rows.iter().map(|a| 30.0 * a).collect();
    let free = case.advance(&spec, &rows).expect("finite");
    assert_eq!(case.graph.handles().select(&free), case.next_handles);
    let limits = EdgeLimits {
        least: 0.9,
        most: 1.1,
        sweeps: 50,
    };
    spec.edge_limits = Some(limits);
    let limited = case.advance(&spec, &rows).expect("finite");
    assert_eq!(case.graph.handles().select(&limited), case.next_handles);
    let mut expected = free.clone();
    assert!(limits.apply(&case.graph, &mut expected) > 0);
    assert_eq!(limited, expected);
}

#[test]
fn a_position_that_is_not_finite_is_named() {
    let case = case(KINDS[0]);
    let mut rows = accelerations(case.graph.vertex_count());
    let free = (0..case.graph.vertex_count()).rfind(|&v| case.is_free(v));
    let free = free.expect("a free vertex");
    rows[3 * free + 1] = f32::NAN;
    let error = case.advance(&case.spec(KINDS[0]), &rows);
    let vertex = VertexId(free as u32);
    assert_eq!(error, Err(NonFinite { vertex }));
}

#[test]
fn the_gradient_is_the_slope_of_the_frame() {
    for integration in KINDS {
        let case = case(integration);
        let spec = case.spec(integration);
        let rows = accelerations(case.graph.vertex_count());
        let count = case.graph.vertex_count();
        let by_next: Vec<Vec3> = (0..count)
            .map(|v| match case.is_free(v) {
                true => Vec3::new(v as f32, -1.0, 0.5),
                false => Vec3::ZERO,
            })
            .collect();
        let [mut previous, mut current] = [(); 2].map(|()| vec![Vec3::ZERO; count]);
        let (frames, by) = (case.frames(), (&mut previous, &mut current));
        advance_backward(integration, &frames, &by_next, by.0, by.1);
        // Along a move of free vertices; the handles are held.
        let objective = |sign: f32| {
            let mut moved = self::case(integration);
            for v in (0..count).filter(|&v| case.is_free(v)) {
                let step = sign * 0.01 * Vec3::new(1.0, v as f32 % 3.0, -0.5);
                moved.previous[v] += step;
                moved.current[v] -= 2.0 * step;
            }
            let mut reference = Vec::new();
            integration.reference(&moved.frames(), &mut reference);
            moved.reference = reference;
            let next = moved.advance(&spec, &rows).expect("finite");
            let dots = next.iter().zip(&by_next);
            dots.map(|(p, g)| f64::from(p.dot(*g))).sum::<f64>()
        };
        let expected = 0.5 * (objective(1.0) - objective(-1.0));
        let dots = (0..count).filter(|&v| case.is_free(v)).map(|v| {
            let step = 0.01 * Vec3::new(1.0, v as f32 % 3.0, -0.5);
            f64::from(previous[v].dot(step)) - 2.0 * f64::from(current[v].dot(step))
        });
        let found: f64 = dots.sum();
        // Linear in the positions: f32 rounding of some two dozen terms.
        assert!(
            (found - expected).abs() < 1e-4 * expected.abs().max(1.0),
            "{integration:?}: {found}, {expected}"
        );
    }
}

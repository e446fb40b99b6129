//! Corrections fade where the input is unlike what was trained on; held vertices are never moved.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::features::Normalizer;
use crate::features::correction::tests::{SOFT, Shape};
use crate::features::correction::{FrameSubsteps, MotionState};
use crate::network::Network;
use crate::rollout::{LearnedStepper, Normalizers, RolloutError};
use crate::spec::{Encoder, ModelSpec};
use crate::test_cloth::parts;

fn spec() -> ModelSpec {
    ModelSpec {
        node_features: Default::default(),
        edge_features: Default::default(),
        base: Some(PhysicsBase { substeps: 2 }),
        ..ModelSpec::physical(Encoder::MLP, 8, 0)
    }
}

/// An untrained model whose columns have the given deviation.
fn model(deviation: f64) -> Arc<Model> {
    let spec = spec();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let network = Network::new(&spec).expect("a network");
    let weights = network.initialise(&mut || rng.random::<f64>());
    let even = |width: usize, deviation: f64| {
        Normalizer::new(vec![0.0; width], vec![deviation; width]).expect("statistics")
    };
    let normalizers = Normalizers {
        nodes: even(spec.node_width(), deviation),
        edges: even(spec.edge_width(), deviation),
        acceleration: even(spec.outputs(), 1e-3),
    };
    Arc::new(Model::new(&spec, weights, normalizers, String::new()).expect("a model"))
}

/// Substeps of a frame that stood still until its last one.
fn substeps<'a>(last: MotionState<'a>, smoothed: &'a [Vec<DVec3>; 2]) -> FrameSubsteps<'a> {
    FrameSubsteps {
        earlier: None,
        middle: last,
        part: 0.5,
        smoothed,
        fell_back: 0.0,
    }
}

#[test]
fn shares_fade_from_six_to_twelve_deviations() {
    let mut shares = vec![0.5; 9];
    for (value, expected) in [
        (6.0, 1.0),
        (-9.0, 0.5),
        (12.0, 0.0),
        (-1e9, 0.0),
        (f32::INFINITY, 0.0),
        (f32::NAN, 0.0),
    ] {
        let mut nodes = vec![-1.0; 9 * NODE_COLUMNS];
        nodes[3 * NODE_COLUMNS + 7] = value;
        find_shares(&nodes, &mut shares);
        for (v, &share) in shares.iter().enumerate() {
            let expected = if v == 3 { expected } else { 1.0 };
            assert!(
                (share - expected).abs() < 1e-6,
                "{value}: vertex {v}: {share}"
            );
        }
    }
}

/// Positions and velocities after a correction, and before; and what came of it.
fn corrected(
    model: &Arc<Model>,
    edit: impl FnOnce(&mut [Shape; 2]),
) -> (Shape, Shape, Familiarity) {
    let graph = parts(4, 2).graph();
    let rest: Vec<DVec3> = graph
        .rest_positions()
        .iter()
        .map(|p| p.as_dvec3())
        .collect();
    let mut shapes = [1, 2].map(|seed| Shape::near(&rest, 0.005, seed));
    edit(&mut shapes);
    let [last, predicted] = shapes;
    let mut next = predicted.clone();
    let held = graph.handle_mask().to_vec();
    let smoothed = [0; 2].map(|_| vec![DVec3::ZERO; held.len()]);
    let frame = PredictedFrame {
        substeps: substeps(last.as_motion(), &smoothed),
        last: last.as_motion(),
        predicted: predicted.as_motion(),
        wind: DVec3::ZERO,
        gravity: DVec3::new(0.0, -9.81, 0.0),
        held: &held,
    };
    let mut corrector = Corrector::new(Arc::clone(model), graph, SOFT).expect("a corrector");
    let familiarity = corrector
        .correct(&frame, &mut next.positions, &mut next.velocities)
        .unwrap();
    for (v, held) in held.iter().enumerate() {
        let moved = next.positions[v] != predicted.positions[v];
        let turned = next.velocities[v] != predicted.velocities[v];
        if *held {
            assert!(!moved && !turned, "{v} is held");
        }
    }
    (next, predicted, familiarity)
}

#[test]
fn what_is_familiar_is_corrected_and_what_is_not_stays_as_predicted() {
    let (next, predicted, familiar) = corrected(&model(100.0), |_| ());
    let moved = next.positions.iter().zip(&predicted.positions);
    let moved = moved.filter(|(p, q)| p != q).count();
    assert_eq!((moved, familiar.familiar), (14, 1.0));
    let most = (0..16).map(|v| next.positions[v].distance(predicted.positions[v]));
    let most = most.fold(0.0, f64::max);
    assert!(
        (most - familiar.largest).abs() < 1e-7,
        "{most} {familiar:?}"
    );
    let (next, predicted, strange) = corrected(&model(1e-6), |_| ());
    assert_eq!(next.positions, predicted.positions);
    assert_eq!(next.velocities, predicted.velocities);
    assert_eq!(strange, Familiarity::default());
}

#[test]
fn columns_that_are_no_numbers_leave_the_prediction() {
    // Beyond f32: its differences are infinite, and those of infinities no numbers.
    let (next, predicted, familiar) = corrected(&model(100.0), |[last, predicted]| {
        for shape in [last, predicted] {
            shape.positions[5] = DVec3::splat(1e300);
            shape.velocities[5] = DVec3::splat(1e300);
        }
    });
    assert!(familiar.familiar < 1.0 && familiar.largest.is_finite());
    assert_eq!(next.positions[5], predicted.positions[5]);
    assert!(next.positions.iter().all(|p| p.is_finite()));
    assert!(next.velocities.iter().all(|v| v.is_finite()));
}

#[test]
fn a_corrector_takes_no_other_kind_of_model_and_follows_a_new_one() {
    let graph = || parts(3, 1).graph();
    let alone = ModelSpec::mesh_graph_nets(8, 1);
    let other = crate::rollout::model_file::tests::model(&alone);
    let refused = Corrector::new(Arc::new(other), graph(), SOFT);
    assert_eq!(refused.err(), Some(NoBase));
    let start = graph().rest_positions().to_vec();
    let stepper = LearnedStepper::new(model(1.0), graph(), &[&start]);
    assert!(matches!(stepper, Err(RolloutError::NeedsPhysics)));
    let before = model(100.0);
    let mut corrector = Corrector::new(Arc::clone(&before), graph(), SOFT).expect("a corrector");
    assert_eq!(corrector.base().substeps, 2);
    let weights = before.weights().iter().map(|w| 0.5 * w).collect();
    let statistics = before.normalizers().clone();
    let after = Model::new(before.spec(), weights, statistics, String::new());
    let after = Arc::new(after.expect("a model"));
    let run = |corrector: &mut Corrector| {
        let rest: Vec<DVec3> = start.iter().map(|p| p.as_dvec3()).collect();
        let [last, state] = [1, 2].map(|seed| Shape::near(&rest, 0.005, seed));
        let smoothed = [0; 2].map(|_| vec![DVec3::ZERO; 9]);
        let frame = PredictedFrame {
            substeps: substeps(last.as_motion(), &smoothed),
            last: last.as_motion(),
            predicted: state.as_motion(),
            wind: DVec3::ZERO,
            gravity: DVec3::ZERO,
            held: &[false; 9],
        };
        let mut next = state.clone();
        corrector
            .correct(&frame, &mut next.positions, &mut next.velocities)
            .unwrap();
        next.positions
    };
    let first = run(&mut corrector);
    corrector.set_model(&after).expect("the same network");
    let second = run(&mut corrector);
    assert_ne!(first, second);
    let mut fresh = Corrector::new(after, graph(), SOFT).expect("a corrector");
    assert_eq!(run(&mut fresh), second);
}

//! Rollouts with known answers: uniform and uniformly accelerated motion, a scene that is turned
//! and moved, starts that are padded, and errors that leave everything as it was.

use crate::conformance::{HandlesEnd, check_correctable, check_stop};
use glam::DVec3;
use selvedge_cloth::VertexId;

use super::*;
use crate::features::normalizer::Normalizer;
use crate::graph::frame::Yaw;
use crate::rollout::model::Normalizers;
use crate::spec::{Encoder, ModelSpec};
use crate::test_cloth::{Hanging, parts, shaken, turn};

fn acceleration(mean: DVec3, deviation: f64) -> Normalizer {
    Normalizer::new(mean.to_array().to_vec(), vec![deviation; 3]).expect("statistics")
}

/// A model of random weights whose accelerations have these statistics; those of its inputs are as
/// of a cloth that swings by centimetres per frame.
fn model(spec: &ModelSpec, acceleration: Normalizer) -> Arc<Model> {
    let of = |width: usize, deviation: f64| {
        Normalizer::new(vec![0.0; width], vec![deviation; width]).expect("statistics")
    };
    let normalizers = Normalizers {
        nodes: of(spec.node_width(), 0.02),
        edges: of(spec.edge_width(), 0.2),
        acceleration,
    };
    Arc::new(crate::test_cloth::model(spec, normalizers, ""))
}

/// A model whose output is 0, so that its acceleration is `mean` `[m/frame²]`, local.
fn constant(spec: &ModelSpec, mean: DVec3) -> Arc<Model> {
    let random = model(spec, acceleration(mean, 1.0));
    let mut weights = random.weights().to_vec();
    for parameter in random.network().parameters() {
        if parameter.name.starts_with("decoder.4.") {
            weights[parameter.range.clone()].fill(0.0);
        }
    }
    let normalizers = random.normalizers().clone();
    Arc::new(Model::new(spec, weights, normalizers, String::new()).expect("a model"))
}

fn specs() -> [ModelSpec; 3] {
    [
        ModelSpec::physical(Encoder::MLP, 8, 2),
        ModelSpec::physical(Encoder::Gru { window: 5 }, 8, 2),
        ModelSpec::mesh_graph_nets(8, 2),
    ]
}

fn stepper(model: &Arc<Model>, parts: Hanging, start: &[Vec<Vec3>]) -> LearnedStepper {
    let start: Vec<&[Vec3]> = start.iter().map(Vec::as_slice).collect();
    LearnedStepper::new(Arc::clone(model), parts.graph(), &start).expect("a start")
}

fn targets(positions: Vec<DVec3>) -> HandleTargets {
    HandleTargets::at_frame_end(positions).expect("finite targets")
}

/// Positions of the handles of `parts` `frame` frames after rest: they swing and turn.
fn swing(parts: &Hanging, frame: usize) -> Vec<DVec3> {
    let phase = 0.2 * frame as f64;
    let yaw = Yaw::from_angle(0.3 * phase.sin());
    let handles = parts.cloth.handles().select(parts.cloth.rest_positions());
    let at =
        |p: Vec3| yaw.to_world_f64(p.as_dvec3()) + 0.1 * phase.sin() * DVec3::new(1.0, 0.5, 0.3);
    handles.into_iter().map(at).collect()
}

/// Rest, then two frames that are shaken.
fn start(parts: &Hanging) -> Vec<Vec<Vec3>> {
    let rest = parts.cloth.rest_positions();
    vec![
        rest.to_vec(),
        shaken(rest, 0.004, 1),
        shaken(rest, 0.008, 2),
    ]
}

fn rollout(mut stepper: LearnedStepper, targets: impl Fn(usize) -> Vec<DVec3>) -> Vec<Vec<Vec3>> {
    let mut frames = Vec::new();
    for frame in 1..=20 {
        stepper
            .step(&self::targets(targets(frame)))
            .expect("a step");
        assert_eq!(stepper.frame(), frame);
        frames.push(stepper.positions().to_vec());
    }
    frames
}

/// The largest distance between vertices of two rollouts `[m]`.
fn distance(a: &[Vec<Vec3>], b: &[Vec<Vec3>]) -> f32 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f32::max)
}

#[test]
fn without_acceleration_free_vertices_go_on_uniformly() {
    for spec in &specs() {
        let parts = parts(4, 3);
        // Multiples of 2^-12 m, for which the arithmetic is exact.
        let grid = |p: Vec3| (p * 4096.0).round() / 4096.0;
        let before: Vec<Vec3> = parts
            .cloth
            .rest_positions()
            .iter()
            .map(|&p| grid(p))
            .collect();
        let now: Vec<Vec3> = shaken(&before, 0.01, 1).into_iter().map(grid).collect();
        let model = constant(spec, DVec3::ZERO);
        let stepper = stepper(&model, parts.clone(), &[before.clone(), now.clone()]);
        let mask = parts.graph().handle_mask().to_vec();
        for (number, frame) in rollout(stepper, |f| swing(&parts, f)).iter().enumerate() {
            let time = (number + 1) as f32;
            for v in (0..mask.len()).filter(|&v| !mask[v]) {
                assert_eq!(frame[v], now[v] + time * (now[v] - before[v]));
            }
        }
    }
}

#[test]
fn a_constant_acceleration_acts_along_the_axes_of_the_handles() {
    let spec = &specs()[0];
    let parts = parts(4, 3);
    // The whole cloth stands turned by half a radian from rest, and its handles stay.
    let turned = turn(
        parts.cloth.rest_positions(),
        Yaw::from_angle(0.5),
        Vec3::ZERO,
    );
    let local = DVec3::new(3e-4, -2e-4, 1e-4);
    let stepper = stepper(
        &constant(spec, local),
        parts.clone(),
        std::slice::from_ref(&turned),
    );
    let handles = parts.cloth.handles().select(&turned);
    let still: Vec<DVec3> = handles.into_iter().map(|p| p.as_dvec3()).collect();
    let graph = parts.graph();
    let rest_angle = graph.frame().rest_yaw().angle();
    let world = Yaw::from_angle(rest_angle + 0.5).to_world_f64(local);
    for (number, frame) in rollout(stepper, |_| still.clone()).iter().enumerate() {
        // From rest, p_n - p_0 = a n (n + 1) / 2.
        let n = (number + 1) as f64;
        for v in (0..turned.len()).filter(|&v| !graph.handle_mask()[v]) {
            let expected = turned[v].as_dvec3() + 0.5 * n * (n + 1.0) * world;
            // Each frame rounds by 1e-7 m, and a velocity keeps it: n²/2 of that.
            assert!(frame[v].as_dvec3().distance(expected) < 2e-5);
        }
    }
}

#[test]
fn a_scene_turned_and_moved_gives_the_rollout_turned_and_moved() {
    let by = Vec3::new(0.7, -0.4, 1.1);
    for spec in specs() {
        for (angle, rest_angle) in [(0.8, 0.0), (-2.5, -2.5), (3.0, 1.2)] {
            let (yaw, rest_yaw) = (Yaw::from_angle(angle), Yaw::from_angle(rest_angle));
            let model = model(&spec, acceleration(DVec3::new(0.0, -5e-4, 2e-4), 2e-3));
            let parts = parts(4, 3);
            let start = start(&parts);
            let plain = rollout(stepper(&model, parts.clone(), &start), |f| swing(&parts, f));
            let moved = Hanging {
                environment: selvedge_cloth::Environment {
                    wind: yaw.to_world_f64(parts.environment.wind),
                    ..parts.environment
                },
                ..parts.at_rest(turn(parts.cloth.rest_positions(), rest_yaw, by))
            };
            let turned: Vec<_> = start.iter().map(|f| turn(f, yaw, by)).collect();
            let place = |p: DVec3| yaw.to_world_f64(p) + by.as_dvec3();
            let found = rollout(stepper(&model, moved, &turned), |f| {
                swing(&parts, f).into_iter().map(place).collect()
            });
            let expected: Vec<_> = plain.iter().map(|f| turn(f, yaw, by)).collect();
            // Positions round to 1e-7 m; as a velocity that is 6e-6 deviations, a gain of some ten
            // makes it 6e-5 of 2e-3 m/frame², so 2e-7 m per frame in all; a velocity keeps it,
            // so that 20 frames make 20²/2 of that: 4e-5 m.
            assert!(distance(&found, &expected) < 1e-4, "{spec:?} {angle}");
            let still = vec![start[2].clone(); plain.len()];
            assert!(distance(&plain, &still) > 0.05, "there is motion");
        }
    }
}

#[test]
fn a_short_start_stood_still_and_a_long_one_forgets() {
    for spec in specs() {
        let model = model(&spec, acceleration(DVec3::ZERO, 1e-3));
        let parts = parts(3, 3);
        let short = start(&parts)[1..].to_vec();
        let run = |start: &[Vec<Vec3>]| {
            rollout(stepper(&model, parts.clone(), start), |f| swing(&parts, f))
        };
        let mut padded = vec![short[0].clone(); spec.history() - 1];
        padded.extend(short[1..].to_vec());
        assert_eq!(padded.len(), spec.history());
        assert_eq!(run(&short), run(&padded));
        let longer = [vec![shaken(&short[0], 1.0, 9); 3], padded.clone()].concat();
        assert_eq!(run(&longer), run(&padded));
    }
}

#[test]
fn a_learned_stepper_conforms() {
    let parts = parts(3, 3);
    for spec in specs() {
        let model = model(&spec, acceleration(DVec3::ZERO, 1e-3));
        let make = || stepper(&model, parts.clone(), &start(&parts));
        check_correctable(make, HandlesEnd::AtTargets);
        check_stop(make);
    }
}

#[test]
fn a_prediction_that_is_not_finite_is_an_error() {
    let parts = parts(3, 3);
    let model = constant(&specs()[0], DVec3::new(0.0, 1e300, 0.0));
    let mut stepper = stepper(&model, parts.clone(), &start(&parts));
    for _ in 0..2 {
        let error = stepper.step(&targets(swing(&parts, 1)));
        assert!(matches!(error, Err(StepError::NonFinite { frame: 1, .. })));
        assert_eq!(
            (stepper.positions(), stepper.frame()),
            (&*start(&parts)[2], 0)
        );
    }
}

#[test]
fn a_start_that_does_not_fit_is_refused() {
    let model = constant(&specs()[0], DVec3::ZERO);
    let start = |frames: &[&[Vec3]]| {
        let stepper = LearnedStepper::new(Arc::clone(&model), parts(3, 3).graph(), frames);
        stepper.err().expect("a defect")
    };
    assert_eq!(start(&[]), RolloutError::NoFrame);
    let (expected, found) = (9, 8);
    let short = [Vec3::ZERO; 8];
    assert_eq!(start(&[&short]), RolloutError::Count { expected, found });
    let mut broken = [Vec3::ZERO; 9];
    broken[4].y = f32::NAN;
    let vertex = VertexId(4);
    assert_eq!(
        start(&[&[Vec3::ZERO; 9], &broken]),
        RolloutError::NonFinite { vertex }
    );
}

/// A vertex that is let go falls as others do, and is led on from where it is when it is taken hold
/// of again; the others are where their targets are throughout.
#[test]
fn what_is_let_go_falls_and_is_taken_hold_of_where_it_is() {
    let parts = parts(3, 1);
    let fall = DVec3::Y * -0.002;
    let mut stepper = stepper(&constant(&specs()[0], fall), parts.clone(), &start(&parts));
    let vertices = stepper.handles().vertices().to_vec();
    let mut last = stepper.positions()[vertices[1].index()];
    let mut speed = Vec3::ZERO;
    let mut led = DVec3::ZERO;
    for frame in 1..=12 {
        let is_free = (3..8).contains(&frame);
        let mut path = swing(&parts, frame);
        if frame == 8 {
            led = last.as_dvec3() - swing(&parts, 7)[1];
        }
        path[1] += led;
        let step = targets(path.clone());
        let released = vec![false, is_free];
        let step = step.releasing(released).expect("as many");
        stepper.step(&step).expect("a step");
        // A step that is undone and done again is the same.
        let done = stepper.positions().to_vec();
        stepper.undo_step();
        stepper.step(&step).expect("a step");
        assert_eq!(stepper.positions(), done);
        assert_eq!(done[vertices[0].index()], path[0].as_vec3());
        let now = done[vertices[1].index()];
        if is_free {
            speed += fall.as_vec3();
            assert!(now.distance(last + speed) < 1e-6, "{frame}");
        } else {
            assert_eq!(now, path[1].as_vec3());
            speed = now - last;
        }
        last = now;
    }
    assert!(led.length() > 0.01, "it took hold elsewhere");
}

/// A stepper of more frames than the model looks at.
fn long_started(spec: &ModelSpec, parts: &Hanging) -> LearnedStepper {
    let model = model(spec, acceleration(DVec3::ZERO, 1e-3));
    let start = start(parts);
    let start = [vec![start[0].clone(); 5], start].concat();
    stepper(&model, parts.clone(), &start)
}

/// Checks that a stepper goes on from `frames`, its own since the start, as one that starts there.
fn goes_on(mut stepper: LearnedStepper, parts: &Hanging, frames: &[Vec<Vec3>]) {
    let all = [&start(parts)[..], frames].concat();
    let mut fresh = self::stepper(&Arc::clone(&stepper.model), parts.clone(), &all);
    for frame in frames.len() + 1..=frames.len() + 3 {
        let targets = targets(swing(parts, frame));
        stepper.step(&targets).expect("a step");
        fresh.step(&targets).expect("a step");
        assert_eq!(stepper.positions(), fresh.positions());
    }
}

#[test]
fn a_frame_that_is_replaced_is_gone_on_from() {
    let parts = parts(3, 3);
    for spec in specs() {
        let mut changed = long_started(&spec, &parts);
        let mut frames = Vec::new();
        for frame in 1..=6 {
            let targets = targets(swing(&parts, frame));
            changed.step(&targets).expect("a step");
            frames.push(changed.positions().to_vec());
        }
        let other = shaken(&frames[5], 0.003, 8);
        let mut lost = other.clone();
        lost[4].y = f32::NAN;
        let error = StepError::NonFinite {
            frame: 6,
            vertex: VertexId(4),
        };
        assert_eq!(changed.replace_frame(&lost), Err(error));
        assert_eq!(changed.positions(), frames[5]);
        changed.replace_frame(&other).expect("finite");
        assert_eq!((changed.positions(), changed.frame()), (&*other, 6));
        frames[5] = other;
        goes_on(changed, &parts, &frames);
    }
}

#[test]
fn a_frame_that_is_taken_is_one_that_was_stepped_to() {
    let parts = parts(3, 3);
    for spec in specs() {
        let mut led = long_started(&spec, &parts);
        led.step(&targets(swing(&parts, 1))).expect("a step");
        let mut frames = vec![led.positions().to_vec()];
        for frame in 2..=4 {
            let taken = shaken(parts.cloth.rest_positions(), 0.01, frame);
            led.take_frame(&taken).expect("finite");
            assert_eq!((led.positions(), led.frame()), (&*taken, frame as usize));
            frames.push(taken);
        }
        goes_on(led, &parts, &frames);
    }
}

/// The energy of such a velocity is beyond the largest number of 32 bits, while the positions of
/// the next frame are not. A ReLU would make 0 of what follows from it, on some processors.
#[test]
fn an_input_that_is_no_number_is_an_error_of_the_frame() {
    let parts = parts(4, 1);
    let rest = parts.cloth.rest_positions().to_vec();
    let mut fast = rest.clone();
    let free = (0..rest.len()).find(|v| !parts.cloth.handles().mask(rest.len())[*v]);
    let free = free.expect("a free vertex");
    fast[free].x += 1e20;
    let spec = ModelSpec::physical(Encoder::MLP, 8, 2);
    let model = model(&spec, acceleration(DVec3::ZERO, 1e-3));
    let targets = targets(swing(&parts, 0));
    let mut stepper = stepper(&model, parts, &[rest, fast]);
    let error = stepper.step(&targets).expect_err("no number");
    assert!(
        matches!(error, StepError::NonFinite { frame: 1, .. }),
        "{error}"
    );
    assert_eq!(stepper.frame(), 0);
}

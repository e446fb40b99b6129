//! What a slot shows, step by step: ground truth with noise where it belongs, then the model's own
//! predictions, and when it goes back to the truth.

use selvedge_data::SectionRule;
use selvedge_model::Encoder;

use super::*;
use crate::test_data::{Swinging, config, swinging, truth};

struct Case {
    cfg: TrainConfig,
    set: TrainingSet,
    _data: Swinging,
}

fn case(edit: impl FnOnce(&mut TrainConfig)) -> Case {
    let data = swinging(&[("a", 9, 20), ("b", 12, 12)], SectionRule::Whole);
    let mut cfg = config(Encoder::Gru { window: 3 });
    edit(&mut cfg);
    Case {
        set: TrainingSet::load(&data.dataset).expect("a set"),
        cfg,
        _data: data,
    }
}

impl Case {
    fn rng(&self, step: u64) -> ChaCha8Rng {
        rng_of(self.cfg.seed, step, 0, 1)
    }

    fn show(&self, slot: &mut Slot, step: u64) -> ShownSample {
        let mut shown = ShownSample::default();
        slot.show(&self.cfg, &self.set, &mut self.rng(step), &mut shown);
        shown
    }

    /// After the acceleration 0, which leads near the truth.
    fn go_on(&self, slot: &mut Slot, shown: &ShownSample) {
        let acceleration = vec![0.0; 3 * self.graph(slot).vertex_count()];
        self.advance(slot, shown, &acceleration);
    }

    /// After `acceleration`, `[vertices, 3]`.
    fn advance(&self, slot: &mut Slot, shown: &ShownSample, acceleration: &[f32]) {
        self.advance_in(slot, shown, acceleration, 7);
    }

    /// The same with the random numbers of step `step`.
    fn advance_in(&self, slot: &mut Slot, shown: &ShownSample, acceleration: &[f32], step: u64) {
        if slot.returns_to_truth(&self.cfg, 10, &mut self.rng(step)) {
            slot.start_afresh();
        } else {
            slot.follow(&self.cfg, &self.set, shown, acceleration, None);
        }
    }

    fn truth(&self, slot: &Slot, frame: usize) -> &[Vec3] {
        self.set.motion(slot.section.trajectory).frame(frame as i64)
    }

    fn graph(&self, slot: &Slot) -> &ClothGraph {
        &self.set.motion(slot.section.trajectory).graph
    }

    /// A slot whose first sample is early in the longer trajectory, and what it shows.
    fn early(&self) -> (Slot, ShownSample) {
        let start = |step| {
            let mut slot = Slot::new();
            let shown = self.show(&mut slot, step);
            (slot, shown)
        };
        (0..500)
            .map(start)
            .find(|(slot, _)| slot.section.trajectory == 0 && slot.current < 4)
            .expect("an early sample")
    }
}

/// The target in the world `[m]`.
fn target(slot: &Slot, shown: &ShownSample, graph: &ClothGraph) -> Vec<DVec3> {
    let newest = &slot.history[slot.history.len() - 1];
    let origin = newest[graph.handles().vertices()[0].index()].as_dvec3();
    let world = |&p: &DVec3| shown.yaw.to_world_f64(p) + origin;
    shown.local[2].iter().map(world).collect()
}

fn largest(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(p, q)| p.distance(*q))
        .fold(0.0, f64::max)
}

fn doubles(positions: &[Vec3]) -> Vec<DVec3> {
    positions.iter().map(|p| p.as_dvec3()).collect()
}

/// A few roundings of f64 at a metre.
const EXACT: f64 = 1e-14;

#[test]
fn without_noise_a_sample_is_ground_truth_in_the_frame_of_its_handles() {
    let case = case(|_| ());
    for step in 0..40 {
        let mut slot = Slot::new();
        let shown = case.show(&mut slot, step);
        let current = slot.current;
        for (k, frame) in shown.frames.iter().enumerate() {
            let number = (current + k).saturating_sub(3);
            assert_eq!(frame, case.truth(&slot, number), "frame {k}");
        }
        assert_eq!(shown.frames.len(), 4);
        let graph = case.graph(&slot);
        let truth = doubles(case.truth(&slot, current + 1));
        assert!(largest(&target(&slot, &shown, graph), &truth) < EXACT);
        // The first handle is the origin, the second one on the z axis, as in the rest pose.
        let [first, second] = [0, 1].map(|h| graph.handles().vertices()[h].index());
        assert_eq!(shown.local[1][first], DVec3::ZERO);
        let angle = |p: DVec3| p.x.atan2(p.z);
        let rest = graph.cloth().rest_positions();
        let rest = (rest[second] - rest[first]).as_dvec3();
        let expected = angle(graph.frame().rest_yaw().to_local_f64(rest));
        let turned = angle(shown.local[1][second]) - expected;
        assert!(turned.sin().abs() < 1e-6 && turned.cos() > 0.0, "{turned}");
    }
}

#[test]
fn noise_goes_to_the_newest_free_positions_and_its_rest_to_the_target() {
    let (deviation, correction) = (0.003, 0.1);
    let case = case(|cfg| {
        cfg.noise = NoiseConfig {
            deviation,
            unit: NoiseUnit::Metre,
            correction,
        };
    });
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for step in 0..200 {
        let mut slot = Slot::new();
        let shown = case.show(&mut slot, step);
        let graph = case.graph(&slot);
        for (k, frame) in shown.frames[..3].iter().enumerate() {
            let number = (slot.current + k).saturating_sub(3);
            assert_eq!(frame, case.truth(&slot, number), "frame {k} is clean");
        }
        let target = target(&slot, &shown, graph);
        let next = case.truth(&slot, slot.current + 1);
        let now = case.truth(&slot, slot.current);
        for v in 0..graph.vertex_count() {
            let noise = shown.frames[3][v].as_dvec3() - now[v].as_dvec3();
            let moved = target[v] - next[v].as_dvec3();
            // The newest position is rounded to f32, 6e-8 of a metre; its target is not.
            assert!((moved - (1.0 - correction) * noise).length() < 2e-7);
            if graph.handle_mask()[v] {
                assert_eq!(noise, DVec3::ZERO);
                continue;
            }
            for x in noise.to_array() {
                sum += x;
                squares += x * x;
                count += 1.0;
            }
        }
    }
    // n draws: the mean is off by σ/√n, the deviation by σ/√(2n); five times that.
    let spread = deviation / f64::sqrt(count);
    assert!((sum / count).abs() < 5.0 * spread, "{}", sum / count);
    let found = f64::sqrt(squares / count);
    assert!((found - deviation).abs() < 4.0 * spread, "{found}");
}

#[test]
fn a_run_keeps_the_prediction_as_its_newest_positions() {
    let case = case(|cfg| cfg.scheduled_sampling.truth = truth(0.0));
    let (mut slot, mut shown) = case.early();
    let graph = case.graph(&slot);
    let local = Vec3::new(2e-3, -1e-3, 3e-3);
    let acceleration = local.to_array().repeat(graph.vertex_count());
    for run in 1..=5 {
        let (current, frames) = (slot.current, shown.frames.clone());
        case.advance(&mut slot, &shown, &acceleration);
        assert_eq!((slot.run, slot.current), (run, current + 1));
        shown = case.show(&mut slot, 100 + u64::from(run));
        assert_eq!(shown.frames[..3], frames[1..], "frames shift along");
        let truth = case.truth(&slot, slot.current);
        for v in 0..graph.vertex_count() {
            let expected = if graph.handle_mask()[v] {
                truth[v]
            } else {
                yaw_of(graph, &frames[3]).to_world(local) + (2.0 * frames[3][v] - frames[2][v])
            };
            assert_eq!(shown.frames[3][v], expected);
        }
    }
}

fn yaw_of(graph: &ClothGraph, positions: &[Vec3]) -> Yaw {
    let handles = graph.handles().select(positions);
    graph.frame().yaw(&handles, graph.frame().rest_yaw())
}

#[test]
fn the_target_of_a_run_takes_back_the_given_part_of_the_distance() {
    for correction in [1.0, 0.3, 0.0] {
        let case = case(|cfg| {
            cfg.scheduled_sampling.truth = truth(0.0);
            cfg.scheduled_sampling.correction = correction;
            // Predictions get no noise.
            cfg.noise.deviation = 0.01;
        });
        let (mut slot, shown) = case.early();
        let graph = case.graph(&slot);
        case.advance(&mut slot, &shown, &vec![1e-3; 3 * graph.vertex_count()]);
        let shown = case.show(&mut slot, 200);
        let now = doubles(case.truth(&slot, slot.current));
        let next = doubles(case.truth(&slot, slot.current + 1));
        let newest = doubles(&slot.history[3]);
        assert!(largest(&newest, &now) > 1e-3, "away from the truth");
        let shift = 1.0 - correction;
        let expected = next.iter().zip(&newest).zip(&now);
        let expected: Vec<DVec3> = expected.map(|((n, p), t)| *n + shift * (*p - *t)).collect();
        assert!(largest(&target(&slot, &shown, graph), &expected) < EXACT);
    }
}

#[test]
fn a_run_ends_after_the_longest_at_the_sections_end_or_far_from_the_truth() {
    let longest = case(|cfg| {
        cfg.scheduled_sampling.truth = truth(0.0);
        cfg.scheduled_sampling.longest = 4;
    });
    let (mut slot, mut shown) = longest.early();
    for run in [1, 2, 3, 4, 0] {
        longest.go_on(&mut slot, &shown);
        assert_eq!((slot.run, slot.history.is_empty()), (run, run == 0));
        shown = longest.show(&mut slot, 300);
    }

    let section = case(|cfg| cfg.scheduled_sampling.truth = truth(0.0));
    let (mut slot, mut shown) = section.early();
    let last = slot.section.end - 2;
    for current in slot.current + 1..=last {
        section.go_on(&mut slot, &shown);
        assert_eq!(slot.current, current);
        assert!(slot.run > 0);
        shown = section.show(&mut slot, 400);
    }
    section.go_on(&mut slot, &shown);
    assert_eq!(slot.run, 0, "there is no frame to predict after the last");

    let far = case(|cfg| {
        cfg.scheduled_sampling.truth = truth(0.0);
        cfg.scheduled_sampling.farthest = 0.5;
    });
    for astray in [1.0, f32::NAN] {
        let (mut slot, shown) = far.early();
        let mut acceleration = vec![0.0; 3 * 9];
        // The last vertex of nine is no handle.
        acceleration[3 * 8 + 1] = astray;
        far.advance(&mut slot, &shown, &acceleration);
        assert_eq!(slot.run, 0, "{astray}");
    }
}

#[test]
fn the_probability_decides_how_often_a_run_goes_on() {
    let case = case(|cfg| {
        cfg.scheduled_sampling.truth = truth(0.25);
    });
    let (slot, shown) = case.early();
    let acceleration = vec![0.0; 3 * case.graph(&slot).vertex_count()];
    let went_on = (0..2000).filter(|&step| {
        let mut slot = slot.clone();
        case.advance_in(&mut slot, &shown, &acceleration, step);
        slot.run > 0
    });
    // 2000 draws with probability 3/4: 1500 give or take 19; five times that.
    assert!(went_on.count().abs_diff(1500) < 97);
}

#[test]
fn numbers_follow_from_seed_step_and_slot() {
    let first = |seed, step, slot| rng_of(seed, step, slot, 3).next_u64();
    assert_eq!(first(1, 2, 0), first(1, 2, 0));
    let all: std::collections::BTreeSet<u64> = (0..5)
        .flat_map(|step| (0..3).map(move |slot| first(1, step, slot)))
        .chain([first(2, 0, 0)])
        .collect();
    assert_eq!(all.len(), 16, "all different");
}

#[test]
fn slots_come_back_from_their_bytes_and_what_is_cut_does_not() {
    let mut moving = Slot::new();
    moving.section.trajectory = 3;
    moving.section.end = 40;
    (moving.current, moving.run) = (17, 5);
    let point = |frame: i32, row: i32| Vec3::new(frame as f32, row as f32 / 3.0, -0.0);
    moving.history = (0..4)
        .map(|f| Arc::new((0..9).map(|r| point(f, r)).collect()))
        .collect();
    let slots = [Slot::new(), moving, Slot::new()];
    let bytes = pack_slots(&slots);
    let back = unpack_slots(&bytes).unwrap();
    assert_eq!(back, slots);
    assert!(back[1].history[0][0].z.is_sign_negative());
    for cut in 0..bytes.len() {
        assert!(unpack_slots(&bytes[..cut]).is_none(), "{cut}");
    }
}

//! What is left of an offset, and labels in their order.

use std::sync::Arc;

use glam::Vec3;
use selvedge_data::SectionRule;
use selvedge_model::Encoder;

use super::*;
use crate::test_data::{config, swinging};

/// A slot in the middle of a run that is 1 cm off: the first target keeps 0.9 of it, the second
/// 0.81.
#[test]
fn recorded_targets_take_back_their_part_of_the_offset() {
    let data = swinging(&[("a", 12, 20)], SectionRule::Whole);
    let mut cfg = config(Encoder::MLP);
    cfg.scheduled_sampling.correction = 0.1;
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let (_, section) = set.sample(0);
    let motion = set.motion(section.trajectory);
    let off = Vec3::new(0.01, 0.0, 0.02);
    let shifted = |frame: i64| {
        let frame = motion.frame(frame).iter();
        Arc::new(frame.map(|p| *p + off).collect::<Vec<Vec3>>())
    };
    let mut slot = Slot::new();
    slot.section = *section;
    slot.current = 6;
    slot.run = 3;
    slot.history = vec![shifted(5), shifted(6)];
    let yaw = Yaw::from_angle(0.7);
    let mut sample = ShownSample {
        yaw,
        ..ShownSample::default()
    };
    let mut target = RolloutTarget::recorded(&cfg, &set, &slot, yaw);
    assert!(target.label().is_none());
    let handles = motion.graph.handles().select(&slot.history[1]);
    for kept in [0.9, 0.81] {
        target.show_next(&set, &slot, &mut sample);
        for (found, truth) in sample.local[2].iter().zip(motion.frame(7)) {
            let expected = truth.as_dvec3() - handles[0].as_dvec3() + kept * off.as_dvec3();
            // Sums of f32 positions of about a metre.
            assert!(found.distance(yaw.to_local_f64(expected)) < 3e-7, "{kept}");
        }
    }
}

#[test]
fn labels_are_shown_one_after_the_other() {
    let data = swinging(&[("a", 12, 20)], SectionRule::Whole);
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let (sample, section) = set.sample(4);
    let motion = set.motion(section.trajectory);
    let mut slot = Slot::new();
    slot.section = *section;
    slot.current = sample.current;
    let frame = Arc::new(motion.frame(4).to_vec());
    slot.history = vec![Arc::clone(&frame), frame];
    let frames: Vec<Vec<DVec3>> = (0..3)
        .map(|k| vec![DVec3::splat(f64::from(k)); motion.graph.vertex_count()])
        .collect();
    let mut target = RolloutTarget::labels(frames.clone());
    assert!(target.label().is_none());
    let mut shown = ShownSample::default();
    let origin = motion.graph.handles().select(&slot.history[1])[0].as_dvec3();
    for frame in &frames {
        target.show_next(&set, &slot, &mut shown);
        assert_eq!(target.label(), Some(&frame[..]));
        assert_eq!(shown.local[2][0], frame[0] - origin);
    }
}

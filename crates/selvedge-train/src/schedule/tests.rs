//! Closed forms of the schedules; those that are refused are in the tests of configurations.

use super::*;

const COSINE: LearningRate = LearningRate::Cosine {
    warmup: 4,
    from: 1e-3,
    to: 1e-5,
    end: 104,
};

fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() < 1e-15,
        "{found} instead of {expected}"
    );
}

#[test]
fn constant_and_drop_are_what_they_say() {
    let drop = LearningRate::Drop {
        from: 1e-4,
        to: 1e-5,
        at: 100,
    };
    assert_eq!(
        [0, 99, 100, u64::MAX].map(|k| drop.at(k)),
        [1e-4, 1e-4, 1e-5, 1e-5]
    );
    assert_eq!(LearningRate::Constant { rate: 3e-4 }.at(7), 3e-4);
}

#[test]
fn cosine_rises_linearly_and_falls_along_half_a_cosine() {
    for (step, expected) in [(0, 2e-4), (1, 4e-4), (3, 8e-4), (4, 1e-3)] {
        close(COSINE.at(step), expected);
    }
    // A third, half and two thirds of half a turn: cos = 1/2, 0, -1/2.
    let wide = LearningRate::Cosine {
        warmup: 0,
        from: 1.0,
        to: 0.0,
        end: 300,
    };
    for (step, expected) in [(0, 1.0), (100, 0.75), (150, 0.5), (200, 0.25), (300, 0.0)] {
        close(wide.at(step), expected);
    }
    assert_eq!([104, 1000].map(|k| COSINE.at(k)), [1e-5, 1e-5]);
    for step in 4..104 {
        assert!(COSINE.at(step + 1) < COSINE.at(step));
        // Half a turn away it is as far from the other end.
        close(COSINE.at(step) + COSINE.at(108 - step), 1e-3 + 1e-5);
    }
}

#[test]
fn the_frames_of_a_rollout_grow_from_one_to_the_last_number() {
    let growing = UnrollFrames::Growing {
        start: 10,
        end: 50,
        frames: 5,
    };
    let steps = [0, 10, 19, 20, 29, 30, 40, 49, 50, u64::MAX];
    let expected = [1, 1, 1, 2, 2, 3, 4, 4, 5, 5];
    assert_eq!(steps.map(|step| growing.at(step)), expected);
    assert_eq!(UnrollFrames::default().at(7), 1);
}

#[test]
fn the_probability_of_ground_truth_falls_linearly() {
    let linear = TruthProbability::Linear {
        start: 75,
        end: 300,
        probability: 0.1,
    };
    for (step, expected) in [
        (0, 1.0),
        (75, 1.0),
        (120, 0.82),
        (210, 0.46),
        (300, 0.1),
        (900, 0.1),
    ] {
        close(linear.at(step), expected);
    }
    assert_eq!(TruthProbability::Always {}.at(10), 1.0);
}

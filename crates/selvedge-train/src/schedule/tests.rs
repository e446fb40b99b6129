//! Closed forms of the schedules, and those that are refused.

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
    let refused = |frames: UnrollFrames| frames.validate().expect_err("a defect").to_string();
    let none = UnrollFrames::Constant { frames: 0 };
    assert!(refused(none).contains("unroll.frames must be between 1 and 1000, found 0"));
    let back = UnrollFrames::Growing {
        start: 5,
        end: 5,
        frames: 2,
    };
    assert!(refused(back).contains("unroll.end must be after start = 5, found 5"));
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

#[test]
fn schedules_that_make_no_sense_are_refused() {
    let cosine = |from, to, end| {
        let warmup = 10;
        let schedule = LearningRate::Cosine {
            warmup,
            from,
            to,
            end,
        };
        schedule.validate().expect_err("a defect").to_string()
    };
    assert_eq!(
        cosine(0.0, 0.0, 20),
        "learning_rate.from must be finite and positive, found 0"
    );
    assert_eq!(
        cosine(1.0, 2.0, 20),
        "learning_rate.to must be between 0 and 1, found 2"
    );
    assert!(cosine(1.0, 0.5, 10).contains("end must be after the warm-up of 10 steps"));
    assert!(
        LearningRate::Constant { rate: f64::NAN }
            .validate()
            .is_err()
    );
    let linear = |end, probability| {
        let start = 5;
        let schedule = TruthProbability::Linear {
            start,
            end,
            probability,
        };
        schedule.validate().expect_err("a defect").to_string()
    };
    assert!(linear(6, 1.5).starts_with("scheduled_sampling.truth.probability must be between"));
    assert!(linear(5, 0.5).contains("end must be after its start 5"));
    COSINE.validate().expect("a good one");
    TruthProbability::Always {}.validate().expect("a good one");
}

#[test]
fn configuration_round_trips_and_unknown_keys_are_errors() {
    let text = toml::to_string(&COSINE).expect("plain");
    assert_eq!(
        toml::from_str::<LearningRate>(&text).expect("its own text"),
        COSINE
    );
    let unknown = [
        "kind = 'constant'\nrate = 1.0\nat = 3",
        "kind = 'cosin'\nrate = 1.0",
    ];
    assert!(
        unknown
            .iter()
            .all(|text| toml::from_str::<LearningRate>(text).is_err())
    );
    let always = toml::from_str::<TruthProbability>("kind = 'always'");
    assert_eq!(always.expect("no fields"), TruthProbability::Always {});
    assert!(toml::from_str::<TruthProbability>("kind = 'always'\nend = 3").is_err());
}

//! The loop: what it leaves in its folder, when it ends, and what it keeps where it fails.

use std::collections::BTreeSet;

use selvedge_model::{Encoder, Model};

use super::*;
use crate::config::TrainConfig;
use crate::schedule::LearningRate;
use crate::test_data::{ENGINE, Swinging, config, two_cloths};

const NO_LIMITS: RunLimits = RunLimits {
    time: None,
    checkpoint_every: Duration::from_secs(1000),
};

struct Case {
    data: Swinging,
    folder: tempfile::TempDir,
    cfg: TrainConfig,
}

fn case(steps: u64) -> Case {
    let mut cfg = config(Encoder::MLP);
    cfg.steps = steps;
    Case {
        data: two_cloths(),
        folder: tempfile::tempdir().expect("a folder"),
        cfg,
    }
}

impl Case {
    fn trainer(&self) -> Trainer {
        Trainer::new(self.cfg.clone(), &self.data.dataset, &ENGINE).expect("a training")
    }

    fn resumed(&self) -> Trainer {
        let path = self.path(files::CHECKPOINT);
        Trainer::resume(self.cfg.clone(), &self.data.dataset, &path, &ENGINE).expect("resumed")
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    fn bytes(&self, file: &str) -> Vec<u8> {
        std::fs::read(self.path(file)).expect("a file")
    }

    /// Runs until `last` at most.
    fn run(&self, trainer: &mut Trainer, limits: RunLimits, last: u64) -> Result<RunEnd, RunError> {
        let mut observe = |report: &StepReport| {
            if report.step >= last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        run(trainer, self.folder.path(), limits, &mut observe)
    }

    fn log(&self) -> Vec<serde_json::Value> {
        let text = String::from_utf8(self.bytes(files::LOG)).expect("text");
        let lines = text.lines();
        lines
            .map(|line| serde_json::from_str(line).expect("JSON"))
            .collect()
    }

    fn logged_steps(&self) -> Vec<u64> {
        let step = |line: &serde_json::Value| line["step"].as_u64().expect("a step");
        self.log().iter().map(step).collect()
    }
}

#[test]
fn a_finished_run_leaves_four_files_and_nothing_else() {
    let case = case(6);
    let mut trainer = case.trainer();
    let end = case.run(&mut trainer, NO_LIMITS, u64::MAX).expect("a run");
    assert_eq!(end, RunEnd::Finished);
    let names: BTreeSet<String> = std::fs::read_dir(case.folder.path())
        .expect("a folder")
        .map(|entry| {
            entry
                .expect("an entry")
                .file_name()
                .to_string_lossy()
                .into()
        })
        .collect();
    let expected = [files::CHECKPOINT, files::MODEL, files::LOG, files::CONFIG];
    assert_eq!(names, expected.map(str::to_owned).into());
    let text = String::from_utf8(case.bytes(files::CONFIG)).expect("text");
    let read = TrainConfig::parse(&text, Path::new("")).expect("its own");
    assert_eq!(read, case.cfg);
    let model = Model::from_bytes(&case.bytes(files::MODEL)).expect("a model");
    assert_eq!(model.weights(), trainer.learned.weights);
    let account: serde_json::Value = serde_json::from_str(&model.training).expect("JSON");
    assert_eq!(account["steps_done"], 6);
    assert_eq!(account["dataset"], "swinging");
    assert_eq!(case.resumed().steps_done(), 6);
    // Run again, it has nothing to do.
    let end = case.run(&mut case.resumed(), NO_LIMITS, u64::MAX);
    assert_eq!(end.expect("a run"), RunEnd::Finished);
    assert_eq!(case.logged_steps(), [2, 4, 6]);
}

#[test]
fn a_line_of_the_log_is_the_mean_of_its_steps() {
    let case = case(6);
    let mut reports = Vec::new();
    let mut observe = |report: &StepReport| {
        reports.push(report.clone());
        ControlFlow::Continue(())
    };
    let (mut trainer, folder) = (case.trainer(), case.folder.path());
    run(&mut trainer, folder, NO_LIMITS, &mut observe).expect("a run");
    for (line, pair) in case.log().iter().zip(reports.chunks(2)) {
        let close = |key: &str, of: fn(&StepReport) -> f64| {
            let mean = 0.5 * (of(&pair[0]) + of(&pair[1]));
            let found = line[key].as_f64().expect("a number");
            // A few roundings of f64.
            assert!((found - mean).abs() < 1e-14 * mean, "{key}");
        };
        assert_eq!(line["step"], pair[1].step);
        assert_eq!(line["learning_rate"], pair[1].learning_rate);
        close("loss", |r| r.terms.total);
        close("acceleration", |r| r.terms.acceleration);
        close("bending_angle", |r| {
            r.terms.bending_angle.expect("weighted")
        });
        close("gradient_norm", |r| r.gradient_norm);
    }
}

#[test]
fn a_log_is_the_same_bit_for_bit_after_a_resume_in_the_middle_of_a_line() {
    let whole = {
        let mut case = case(9);
        case.cfg.log_every = 4;
        case.run(&mut case.trainer(), NO_LIMITS, u64::MAX)
            .expect("a run");
        case.bytes(files::LOG)
    };
    for stop in [1, 3, 5, 6] {
        let mut case = case(9);
        case.cfg.log_every = 4;
        let end = case.run(&mut case.trainer(), NO_LIMITS, stop);
        assert_eq!(end.expect("a run"), RunEnd::Stopped);
        assert_eq!(case.resumed().steps_done(), stop);
        let end = case.run(&mut case.resumed(), NO_LIMITS, u64::MAX);
        assert_eq!(end.expect("a run"), RunEnd::Finished);
        assert_eq!(case.bytes(files::LOG), whole, "stopped after {stop}");
    }
}

#[test]
fn the_time_limit_ends_a_run_and_it_is_saved() {
    let case = case(100);
    let limits = RunLimits {
        time: Some(Duration::ZERO),
        ..NO_LIMITS
    };
    let end = case
        .run(&mut case.trainer(), limits, u64::MAX)
        .expect("a run");
    assert_eq!(end, RunEnd::TimeUp);
    assert_eq!(case.resumed().steps_done(), 0);
}

#[test]
fn a_resumed_run_drops_the_lines_of_steps_that_it_does_again() {
    let case = case(10);
    case.run(&mut case.trainer(), NO_LIMITS, 4).expect("a run");
    let checkpoint = case.bytes(files::CHECKPOINT);
    case.run(&mut case.resumed(), NO_LIMITS, 9).expect("a run");
    assert_eq!(case.logged_steps(), [2, 4, 6, 8]);
    // As if the machine had stopped before the second run saved, in the middle of a line.
    std::fs::write(case.path(files::CHECKPOINT), checkpoint).expect("room");
    let log = [case.bytes(files::LOG), b"{\"step\": 10, \"lo".to_vec()].concat();
    std::fs::write(case.path(files::LOG), log).expect("room");
    let first = case.bytes(files::LOG);
    case.run(&mut case.resumed(), NO_LIMITS, 4 + 1)
        .expect("a run");
    assert_eq!(case.logged_steps(), [2, 4]);
    case.run(&mut case.resumed(), NO_LIMITS, u64::MAX)
        .expect("a run");
    assert_eq!(case.logged_steps(), [2, 4, 6, 8, 10]);
    let kept = case.bytes(files::LOG);
    let half = kept.iter().position(|&b| b == b'\n').expect("a line");
    assert_eq!(kept[..half], first[..half]);
}

#[test]
fn checkpoints_are_saved_along_the_way() {
    let case = case(100);
    let often = RunLimits {
        time: None,
        checkpoint_every: Duration::ZERO,
    };
    let mut seen = Vec::new();
    let path = case.path(files::CHECKPOINT);
    let mut observe = |report: &StepReport| {
        seen.push(path.exists());
        match report.step {
            3 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    };
    let (mut trainer, folder) = (case.trainer(), case.folder.path());
    run(&mut trainer, folder, often, &mut observe).expect("a run");
    assert_eq!(seen, [false, true, true]);
}

#[test]
fn a_training_that_blows_up_keeps_the_last_good_files() {
    let mut case = case(100);
    case.run(&mut case.trainer(), NO_LIMITS, 3).expect("a run");
    let good = [files::CHECKPOINT, files::MODEL].map(|file| case.bytes(file));
    let unchanged = |case: &Case| {
        assert_eq!(
            [files::CHECKPOINT, files::MODEL].map(|file| case.bytes(file)),
            good
        );
    };
    // Weights of 1e30: the next loss is not finite.
    case.cfg.learning_rate = LearningRate::Constant { rate: 1e30 };
    let error = case.run(&mut case.trainer(), NO_LIMITS, u64::MAX);
    let error = error.expect_err("weights of 1e30");
    let text = error.to_string();
    assert!(matches!(
        error,
        RunError::Train {
            source: TrainError::NotFinite { step: 2 },
            kept: Some(_)
        }
    ));
    assert!(text.starts_with("step 2: the loss is not finite: lower learning_rate"));
    assert!(text.ends_with("checkpoint.safetensors is of an earlier step and whole"));
    unchanged(&case);
    // Weights that are infinite after the first step, which is the last: there is no second loss.
    case.cfg.learning_rate = LearningRate::Constant { rate: 1e300 };
    case.cfg.steps = 1;
    let error = case.run(&mut case.trainer(), NO_LIMITS, u64::MAX);
    let is_model = |error: &RunError| {
        matches!(
            error,
            RunError::Train {
                source: TrainError::Spec(_),
                ..
            }
        )
    };
    assert!(error.is_err_and(|error| is_model(&error)));
    unchanged(&case);
    // Before the first checkpoint there is nothing to praise.
    let mut fresh = self::case(100);
    fresh.cfg.learning_rate = LearningRate::Constant { rate: 1e30 };
    let error = fresh.run(&mut fresh.trainer(), NO_LIMITS, u64::MAX);
    let text = error.expect_err("weights of 1e30").to_string();
    assert!(text.ends_with("there is no checkpoint yet"), "{text}");
    assert!(!fresh.path(files::CHECKPOINT).exists());
}

#[test]
fn what_cannot_be_written_is_an_error_and_leaves_the_rest() {
    let case = case(100);
    case.run(&mut case.trainer(), NO_LIMITS, 3).expect("a run");
    let (checkpoint, model) = (case.bytes(files::CHECKPOINT), case.bytes(files::MODEL));
    // A folder in the place of the model: the checkpoint is written whole before it.
    std::fs::remove_file(case.path(files::MODEL)).expect("a file");
    std::fs::create_dir(case.path(files::MODEL)).expect("a folder");
    let error = case
        .run(&mut case.resumed(), NO_LIMITS, 4)
        .expect_err("no place");
    assert!(error.to_string().contains(files::MODEL), "{error}");
    assert_eq!(case.resumed().steps_done(), 4);
    // A folder in the place of the checkpoint: the model stays as it was.
    std::fs::remove_dir(case.path(files::MODEL)).expect("empty");
    std::fs::write(case.path(files::MODEL), &model).expect("room");
    std::fs::write(case.path(files::CHECKPOINT), checkpoint).expect("room");
    let mut trainer = case.resumed();
    std::fs::remove_file(case.path(files::CHECKPOINT)).expect("a file");
    std::fs::create_dir(case.path(files::CHECKPOINT)).expect("a folder");
    let error = case.run(&mut trainer, NO_LIMITS, 4).expect_err("no place");
    assert!(error.to_string().contains(files::CHECKPOINT), "{error}");
    assert_eq!(case.bytes(files::MODEL), model);
    // A log that is not text, and a folder that is not there.
    std::fs::write(case.path(files::LOG), [0xff, 0xfe]).expect("room");
    let error = case
        .run(&mut case.trainer(), NO_LIMITS, 4)
        .expect_err("no text");
    assert!(matches!(error, RunError::Log { .. }));
    assert_eq!(case.bytes(files::LOG), [0xff, 0xfe]);
    let missing = case.path("no/such");
    let mut trainer = case.trainer();
    let flow = &mut |_: &StepReport| ControlFlow::Continue(());
    let error = run(&mut trainer, &missing, NO_LIMITS, flow);
    assert!(matches!(error, Err(RunError::Write(_))));
    assert_eq!(trainer.steps_done(), 0, "before any work is done");
}

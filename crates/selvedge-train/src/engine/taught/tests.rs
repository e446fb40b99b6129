//! A training whose samples are made on the way: it learns what repeats, asks for samples when they
//! are due, repeats itself, and goes on from its checkpoint.

use rand::{RngExt, SeedableRng};
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{Cloth, Environment, Handles};
use selvedge_model::ClothGraph;

use super::*;
use crate::checkpoint::ResumeError;
use crate::config::InvalidConfig;
use crate::schedule::UnrollFrames;
use crate::trainer::{TrainError, Trainer};

/// The configuration of a small network that corrects one substep, with more of it.
fn config(text: &str) -> TrainConfig {
    let text = format!(
        "name = \"tiny\"\nseed = 1\nsteps = 100\nlog_every = 10\nbatch = {{ samples = 2 }}\n\
         learning_rate = {{ kind = \"constant\", rate = 1e-2 }}\n{text}\n\
         [teacher]\nscenes = [\"first\"]\nsubsteps = 2\n\
         [samples]\nstatistics = 4\nkept = 8\nuses = 3.0\n\
         [model]\nencoder = {{ kind = \"mlp\" }}\nlatent = 8\nblocks = 0\n\
         base = {{ substeps = 1 }}\n"
    );
    TrainConfig::parse(&text, "tiny.toml".as_ref()).unwrap()
}

/// A sample of random numbers on a small square.
fn sample(seed: u64) -> CorrectionSample {
    let sheet = SquareSpec {
        vertices: 16,
        size: 1.0,
        seed: 1,
    };
    let sheet = square(&sheet).unwrap();
    let handles = Handles::new(&sheet.labels["upper-corners"], 16).unwrap();
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).unwrap();
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |count: usize| (0..count).map(|_| rng.random::<f32>() - 0.5).collect();
    let spec = config("").model;
    let free = graph.handle_mask().iter().map(|held| !held);
    CorrectionSample {
        nodes: draw(16 * spec.node_width()),
        target: draw(16 * spec.outputs()),
        weights: free.map(|free| f32::from(u8::from(free))).collect(),
        graph: Arc::new(graph),
    }
}

/// A source that gives so many samples a frame, the same four over and over.
struct Repeating {
    at_once: usize,
    given: u64,
    stop: Stop,
}

impl SampleSource for Repeating {
    fn samples(
        &mut self,
        _: Option<&Arc<Model>>,
        _: usize,
    ) -> Result<Option<Vec<CorrectionSample>>, Box<dyn Error + Send + Sync>> {
        if self.stop.is_wanted() {
            return Ok(None);
        }
        let first = self.given;
        self.given += self.at_once as u64;
        Ok(Some(
            (first..self.given)
                .map(|number| sample(number % 4))
                .collect(),
        ))
    }

    fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    fn domain(&self) -> Option<&Domain> {
        None
    }
}

fn source(at_once: usize) -> Box<dyn SampleSource> {
    Box::new(Repeating {
        at_once,
        given: 0,
        stop: Stop::default(),
    })
}

fn trainer(text: &str) -> Trainer {
    let going = &mut |_| ControlFlow::Continue(());
    let trainer = Trainer::taught(config(text), source(1), going);
    trainer.unwrap().expect("nobody stops it")
}

#[test]
fn samples_are_made_for_statistics_and_after_so_many_uses() {
    let mut heard = Vec::new();
    let hear = &mut |progress: FitProgress| {
        heard.push(progress.done);
        ControlFlow::Continue(())
    };
    let made = Trainer::taught(config(""), source(3), hear).unwrap();
    let mut trainer = made.unwrap();
    assert_eq!(heard, [1, 2, 3, 4]);
    let counts = [(); 9].map(|()| {
        trainer.step().unwrap();
        trainer.sample_count()
    });
    // Three samples are learned from three times each, two in a step.
    assert_eq!(counts, [6, 6, 6, 6, 6, 9, 9, 9, 9]);
    let stop = &mut |_: FitProgress| ControlFlow::Break(());
    assert!(
        Trainer::taught(config(""), source(1), stop)
            .unwrap()
            .is_none()
    );
}

#[test]
fn the_oldest_sample_makes_room() {
    let mut samples = Samples::new(source(1));
    let cfg = SampleConfig {
        kept: 3,
        ..config("").samples
    };
    for number in 0..5 {
        let mut sample = sample(number);
        sample.target[0] = number as f32;
        samples.add(&cfg, [sample]);
    }
    let mut kept: Vec<f32> = samples.kept.iter().map(|s| s.target[0]).collect();
    kept.sort_by(f32::total_cmp);
    assert_eq!((kept, samples.added), (vec![2.0, 3.0, 4.0], 5));
}

#[test]
fn it_learns_what_repeats() {
    let mut trainer = trainer("weight_average = 0.9");
    let first = trainer.step().unwrap().terms.total;
    let mut last = first;
    for _ in 0..800 {
        last = trainer.step().unwrap().terms.total;
    }
    assert!(last < 0.5 * first, "{first} {last}");
    let model = trainer.model("account".to_owned()).unwrap();
    assert_eq!(model.training, "account");
    assert_ne!(model.weights(), trainer.learned.weights);
}

#[test]
fn a_step_that_is_given_up_changes_nothing_and_the_same_samples_give_the_same_weights() {
    let run = |gives_up: bool| {
        let mut trainer = trainer("");
        for _ in 0..5 {
            if gives_up {
                let stop = Stop::default();
                stop.ask();
                trainer.stop_by(stop);
                let error = trainer.step().unwrap_err();
                assert!(matches!(error, TrainError::Stopped { .. }));
                trainer.stop_by(Stop::default());
            }
            trainer.step().unwrap();
        }
        trainer.learned
    };
    assert_eq!(run(false), run(false));
    assert_eq!(run(true), run(false));
}

#[test]
fn the_gradient_is_that_of_the_loss() {
    let mut trainer = trainer("");
    let gathered = trainer.learned.weights.clone();
    trainer.step().unwrap();
    let gradient = trainer.gradient().unwrap();
    let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
    // Along the gradient, where the slope is its length.
    let step = 1e-2;
    let loss = |sign: f32| {
        let mut moved = self::trainer("");
        let pairs = gathered.iter().zip(&gradient);
        moved.learned.weights = pairs.map(|(w, g)| w + sign * step * g / length).collect();
        moved.step().unwrap().terms.total
    };
    let slope = (loss(1.0) - loss(-1.0)) / (2.0 * f64::from(step));
    let expected = f64::from(length);
    assert!(expected > 0.01, "{expected}");
    // Rounding of f32 in a loss of about 1, divided by the step, and the curvature.
    assert!((slope / expected - 1.0).abs() < 5e-3, "{slope} {expected}");
}

#[test]
fn a_training_goes_on_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let mut trainer = trainer("weight_average = 0.9");
    trainer.step().unwrap();
    trainer.save(&path).unwrap();
    let mut longer = config("weight_average = 0.9");
    longer.steps = 1000;
    longer.samples.cloths = 7;
    let begun = |steps| {
        assert_eq!(steps, 1);
        source(1)
    };
    let mut back = Trainer::resume_taught(longer, &path, begun).unwrap();
    assert_eq!(back.learned, trainer.learned);
    assert_eq!(
        (&back.inputs, &back.targets),
        (&trainer.inputs, &trainer.targets)
    );
    assert_eq!(back.steps_done(), 1);
    back.step().unwrap();
    // Samples anew, one of them beyond those of the statistics.
    assert_eq!(back.sample_count(), 5);
}

#[test]
fn a_checkpoint_of_another_configuration_names_the_field() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    trainer("").save(&path).unwrap();
    let refused = |cfg| {
        Trainer::resume_taught(cfg, &path, |_| source(1))
            .err()
            .unwrap()
    };
    let mut other = config("");
    other.teacher.as_mut().unwrap().substeps = 7;
    let error = refused(other).to_string();
    assert!(error.contains("teacher.substeps (2, now 7)"), "{error}");
    std::fs::write(&path, b"no").unwrap();
    assert!(matches!(refused(config("")), ResumeError::Container { .. }));
}

#[test]
fn wrong_values_name_their_key() {
    type Edit = fn(&mut TrainConfig);
    let edits: [(&str, Edit); 11] = [
        ("teacher.substeps", |cfg| {
            cfg.teacher.as_mut().unwrap().substeps = 0;
        }),
        ("teacher.scenes", |cfg| {
            cfg.teacher.as_mut().unwrap().scenes.clear();
        }),
        ("samples.cloths", |cfg| cfg.samples.cloths = 0),
        ("samples.kept", |cfg| cfg.samples.kept = 3),
        ("samples.uses", |cfg| cfg.samples.uses = 0.0),
        ("samples.farthest", |cfg| cfg.samples.farthest = Some(0.0)),
        ("model.base", |cfg| {
            cfg.model.base.as_mut().unwrap().substeps = 0;
        }),
        ("own_frames.frames", |cfg| {
            cfg.own_frames = UnrollFrames::Constant { frames: 0 };
        }),
        ("statistics_samples must be left out", |cfg| {
            cfg.statistics_samples = 3;
        }),
        ("losses must be left out", |cfg| {
            cfg.losses.edge_length = 2.0;
        }),
        ("unroll must be left out", |cfg| {
            cfg.unroll = UnrollFrames::Constant { frames: 2 };
        }),
    ];
    for (key, edit) in edits {
        let mut cfg = config("");
        edit(&mut cfg);
        let error = cfg.validate().unwrap_err().to_string();
        assert!(error.contains(key), "{key}: {error}");
    }
    let mut cfg = config("");
    cfg.teacher = None;
    assert!(matches!(cfg.validate(), Err(InvalidConfig::Base)));
    let text = toml::to_string(&config("own_frames = { kind = \"constant\", frames = 3 }"));
    let back = TrainConfig::parse(&text.unwrap(), "tiny.toml".as_ref()).unwrap();
    assert_eq!(back.own_frames, UnrollFrames::Constant { frames: 3 });
}

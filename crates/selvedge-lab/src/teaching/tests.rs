//! Samples of a small preset: their sizes, and that threads change none of them.

use std::ops::ControlFlow;
use std::thread;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_model::{Network, Normalizer, Normalizers};

use super::*;

const CONFIG: &str = r#"
name = "tiny"
seed = 3
steps = 4
log_every = 1
learning_rate = { kind = "constant", rate = 1e-3 }
batch = { samples = 2 }
own_frames = { kind = "constant", frames = 3 }

[teacher]
scenes = ["tiny"]
substeps = 4

[samples]
cloths = 3
statistics = 4
kept = 8
lead = 60
frames = 4

[model]
encoder = { kind = "mlp" }
latent = 8
blocks = 0
base = { substeps = 1 }
"#;

/// Vertices of the preset's cloth.
const VERTICES: usize = 36;

fn config() -> TrainConfig {
    TrainConfig::parse(CONFIG, "tiny.toml".as_ref()).unwrap()
}

/// An untrained model that corrects one substep by a little.
pub(crate) fn model() -> Arc<Model> {
    let spec = config().model;
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let network = Network::new(&spec).unwrap();
    let weights = network.initialise(&mut || rng.random::<f64>());
    let even = |width: usize, deviation: f64| {
        Normalizer::new(vec![0.0; width], vec![deviation; width]).unwrap()
    };
    let normalizers = Normalizers {
        nodes: even(spec.node_width(), 10.0),
        edges: even(spec.edge_width(), 10.0),
        acceleration: even(spec.outputs(), 1e-5),
    };
    Arc::new(Model::new(&spec, weights, normalizers, String::new()).unwrap())
}

fn scenes() -> TeachingScenes {
    let names = ["tiny".to_owned()];
    let opened = TeachingScenes::open(&names, &mut |_| ControlFlow::Continue(()));
    opened.unwrap().unwrap()
}

/// Vertices that a sample has nothing to say of.
fn held(sample: &CorrectionSample) -> usize {
    sample.weights.iter().filter(|w| **w == 0.0).count()
}

/// The samples of six frames, with or without a model.
fn samples(threads: usize, model: Option<&Arc<Model>>) -> Vec<CorrectionSample> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(|| {
        let mut teaching = Teaching::new(scenes(), config(), 0);
        let frames = (0..6).map(|_| teaching.samples(model, 3).unwrap().unwrap());
        let samples = frames.flatten().collect();
        assert_eq!(teaching.diverged(), 0);
        samples
    })
}

#[test]
fn samples_have_their_sizes_and_threads_change_none() {
    let model = model();
    let alone = samples(2, None);
    let spec = config().model;
    // Three cloths, six frames.
    assert_eq!(alone.len(), 18);
    for sample in &alone {
        assert_eq!(sample.graph.vertex_count(), VERTICES);
        assert_eq!(sample.nodes.len(), VERTICES * spec.node_width());
        assert_eq!(sample.target.len(), VERTICES * spec.outputs());
        assert_eq!((sample.weights.len(), held(sample)), (VERTICES, 2));
        let all = [&sample.nodes, &sample.target];
        assert!(all.iter().all(|rows| rows.iter().all(|x| x.is_finite())));
    }
    // A cloth at rest lacks nothing; one that moves does.
    let lacks = |sample: &CorrectionSample| sample.target.iter().any(|x| x.abs() > 1e-5);
    assert!(alone.iter().any(lacks));
    for model in [None, Some(&model)] {
        let [one, two] = [1, 2].map(|threads| samples(threads, model));
        assert_eq!(one.len(), two.len());
        for (a, b) in one.iter().zip(&two) {
            assert_eq!((&a.nodes, &a.target), (&b.nodes, &b.target));
        }
        // A model leads the cloths elsewhere.
        let same = one.iter().zip(&alone).all(|(a, b)| a.nodes == b.nodes);
        assert_eq!(same, model.is_none());
    }
}

#[test]
fn samples_are_given_up_where_a_stop_is_wanted_and_made_anew_afterwards() {
    let mut teaching = Teaching::new(scenes(), config(), 0);
    for _ in 0..3 {
        assert_eq!(teaching.samples(None, 1).unwrap().unwrap().len(), 3);
        let stop = Stop::default();
        stop.ask();
        teaching.stop_by(stop);
        assert!(teaching.samples(None, 1).unwrap().is_none());
        teaching.stop_by(Stop::default());
    }
    assert_eq!(teaching.diverged(), 0);
}

/// A frame that a stop cuts short is neither a sample nor a run that went astray.
#[test]
fn a_stop_may_come_at_any_moment() {
    let mut cfg = config();
    // A frame of the teacher takes long, and hears of a stop in the middle.
    cfg.teacher.as_mut().unwrap().substeps = 1000;
    cfg.samples.frames = 50;
    let model = model();
    let mut teaching = Teaching::new(scenes(), cfg, 0);
    for wait in [5, 20, 100].map(Duration::from_millis) {
        let stop = Stop::default();
        teaching.stop_by(stop.clone());
        thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(wait);
                stop.ask();
            });
            while teaching.samples(Some(&model), 3).unwrap().is_some() {}
        });
        assert!(stop.is_wanted());
    }
    assert_eq!(teaching.diverged(), 0);
}

#[test]
fn a_preset_that_is_not_there_is_named() {
    let names = ["nowhere".to_owned()];
    let opened = TeachingScenes::open(&names, &mut |_| ControlFlow::Continue(()));
    let error = opened.err().unwrap().to_string();
    assert!(error.starts_with("teacher.scenes: "), "{error}");
    assert!(error.contains("nowhere"), "{error}");
}

const DRAWN: &str = r#"
name = "drawn"
sections = "whole"
train = []
test = []
[setting]
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
[random_cloths]
train = 12
seed = 1
materials = ["gray-interlock"]
[random_cloths.ranges]
shapes = ["square", "random"]
vertices = [36, 48]
size = [0.8, 1.0]
stiffness = [0.5, 2.0]
density = [0.5, 2.0]
isotropic = 0.2
handles = [2, 6]
released = 1.0
speed = 1.0
wind = 4.0
gusts = 1.0
duration = 2.0
"#;

/// Cloths that are drawn start as their meshes hang, and the samples say which handles are let go.
#[test]
fn drawn_cloths_teach_with_handles_that_let_go() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drawn.toml");
    std::fs::write(&path, DRAWN).unwrap();
    let names = [path.to_str().unwrap().to_owned()];
    let opened = TeachingScenes::open(&names, &mut |_| ControlFlow::Continue(()));
    let scenes = opened.unwrap().unwrap();
    assert_eq!(scenes.scenes.len(), 12);
    for taught in &scenes.scenes {
        assert_eq!(taught.rest.as_slice(), taught.scene.mesh.positions());
    }
    let mut cfg = config();
    cfg.samples.lead = 120;
    let mut teaching = Teaching::new(scenes, cfg, 0);
    let model = model();
    let (mut led, mut free) = (0, 0);
    for _ in 0..60 {
        for sample in teaching.samples(Some(&model), 3).unwrap().unwrap() {
            assert!(sample.target.iter().all(|x| x.is_finite()));
            if held(&sample) < 2 {
                free += 1
            } else {
                led += 1
            }
        }
    }
    assert!(led > 60 && free > 10, "{led} held, {free} free");
}

/// The tiny scenes with handles that let go and take hold again, and once more.
fn letting_go() -> TeachingScenes {
    let mut scenes = scenes();
    for taught in &mut scenes.scenes {
        let release = |handles: Vec<usize>, from: f64, to: f64| selvedge_cloth::Release {
            handles,
            from,
            to: Some(to),
        };
        taught.scene.schedule.releases = vec![
            release(vec![0], 0.15, 0.3),
            release(vec![0, 1], 0.45, 0.5),
            release(vec![1], 0.75, 1.0),
        ];
    }
    scenes
}

/// Differences over substeps: scales are those of the motion, weights in the loss have a mean of 1
/// over the vertices that move, and the last column but one is the logarithm of the scale.
#[test]
fn samples_of_differences_over_substeps_are_weighted_by_their_scales() {
    let mut cfg = config();
    cfg.model.base.as_mut().unwrap().substeps = 2;
    let width = cfg.model.node_width();
    let mut teaching = Teaching::new(scenes(), cfg, 0);
    let (mut known, mut count) = (0, 0);
    for _ in 0..6 {
        for sample in teaching.samples(None, 1).unwrap().unwrap() {
            count += 1;
            let free = sample.weights.iter().filter(|w| **w > 0.0).count();
            assert_eq!(free, VERTICES - 2);
            let mean = sample.weights.iter().sum::<f32>() / free as f32;
            assert!((mean - 1.0).abs() < 1e-5, "{mean}");
            let rows: Vec<&[f32]> = sample.nodes.chunks_exact(width).collect();
            known += usize::from(rows[0][31] == 1.0);
            let of = |v: usize| (sample.weights[v].ln(), 2.0 * rows[v][32]);
            let moving: Vec<usize> = (0..VERTICES).filter(|&v| sample.weights[v] > 0.0).collect();
            let (weight, scale) = of(moving[0]);
            for &v in &moving {
                let (other, at) = of(v);
                assert!((other - weight - (at - scale)).abs() < 1e-4, "{v}");
            }
        }
    }
    // The first frame of a run has no substep before it.
    assert!(known > 0 && known < count, "{known} of {count}");
}

/// A teacher of the same physics as the base has nothing to add, wherever a run begins and whoever
/// holds: both hold the same vertices, and lead them from where they were taken. Whether a solve is
/// repeated may hang on the last digits, which differ: so it does in one sample or two.
#[test]
fn a_teacher_that_is_the_base_adds_nothing_where_handles_let_go_and_take_hold() {
    let mut cfg = config();
    cfg.teacher.as_mut().unwrap().substeps = 2;
    cfg.samples.cloths = 8;
    cfg.samples.frames = 40;
    cfg.model.base.as_mut().unwrap().substeps = 2;
    let mut teaching = Teaching::new(letting_go(), cfg, 0);
    // The teacher begins every frame anew, and so does the base then.
    teaching.forgetful = 1.0;
    let (mut held_so_often, mut repeated) = ([0; 3], 0);
    for _ in 0..50 {
        for sample in teaching.samples(None, 1).unwrap().unwrap() {
            held_so_often[held(&sample)] += 1;
            // Targets are over the scales of the vertices, the last column but one.
            let width = sample.nodes.len() / VERTICES;
            let rows = sample.target.as_chunks::<6>().0.iter();
            let each = rows
                .zip(sample.nodes.chunks_exact(width))
                .map(|(row, columns)| {
                    let most = row.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
                    most * columns[32].exp()
                });
            let most = each.fold(0.0, f32::max);
            assert!(most < 1e-3, "{most}");
            repeated += u32::from(most >= 1e-7);
        }
    }
    let often = held_so_often.iter().all(|samples| *samples > 5);
    assert!(often, "{held_so_often:?}");
    assert!(repeated <= 2, "{repeated}");
    assert_eq!(teaching.diverged(), 0);
}

/// A run of the model's own frames ends where it is too far from the teacher's, and only there.
#[test]
fn a_run_of_own_frames_ends_where_it_is_farther_than_wanted() {
    let mut cfg = config();
    cfg.samples.frames = 40;
    let spec = cfg.model.clone();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let network = Network::new(&spec).unwrap();
    let weights = network.initialise(&mut || rng.random::<f64>());
    let normalizers = model().normalizers().clone();
    let model = Model::new(&spec, weights, normalizers, String::new()).unwrap();
    let model = Arc::new(model);
    let astray = |farthest: Option<f64>, model: Option<&Arc<Model>>| {
        let mut cfg = cfg.clone();
        cfg.samples.farthest = farthest;
        let mut teaching = Teaching::new(scenes(), cfg, 0);
        (0..30).for_each(|_| {
            teaching.samples(model, 8).unwrap();
        });
        teaching.diverged()
    };
    // One long solve leads elsewhere than the many of the teacher.
    let short = astray(Some(1e-9), Some(&model));
    let kept = astray(Some(0.02), Some(&model));
    assert!(short > 5, "{short}");
    assert_eq!(kept, astray(None, Some(&model)));
    assert!(kept < short, "{kept} {short}");
    // Frames of the teacher are as far as they may be.
    assert_eq!(astray(Some(1e-9), None), 0);
}

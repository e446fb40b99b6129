//! The readers under trial, one target for each format: what it reads, from which examples, what
//! it refuses, and what holds of what it accepts.

use std::fmt::Display;
use std::path::Path;

use selvedge::machine::DeviceName;
use selvedge_data::export::FrameSpan;
use selvedge_data::{
    Dataset, DatasetPreset, MeshOptions, RestPoseFolder, Rig, SceneSpec, StateChoice, StateRun,
    Trajectory, open_scene, parse_obj_with, parse_recorded_csv, read_mesh,
};
use selvedge_lab::evaluation::PhysicsMethod;
use selvedge_lab::report::training_log;
use selvedge_lab::span;
use selvedge_live::protocol::{self, ClientMessage};
use selvedge_model::Model;
use selvedge_train::{OnProcessor, Setting, TrainConfig, Trainer};

use super::Bench;

/// Outcome of one input: accepted, or refused with this text.
type Verdict = Result<(), String>;

/// A reader, told what to read by the path of a file and its bytes.
type Reader = fn(&Bench, &Path, &[u8]) -> Verdict;

/// A reader: the name of the target, and of its folder in the corpus; the name of the file in the
/// bench's folder, where the reader opens it itself; examples that the bench has or, where a name
/// begins with `/`, the repository, of a folder all files of TOML; and the reader.
#[derive(Debug)]
pub(crate) struct Target(
    pub(crate) &'static str,
    pub(super) Option<&'static str>,
    pub(super) &'static [&'static str],
    pub(super) Reader,
);

const BLENDER: &str = "/crates/selvedge-data/tests/fixtures/caches/blender.usdc";

/// The content of which a damaged file says to be the rest pose, and its place: a hash of that.
const POSE: &str = "sixteen";
const REST_POSE: &str =
    "poses/71416f2faa304e3d70a76b855b0b82e9d6a2f549c54daac536860c0ad17fa2f6.safetensors";

/// All readers.
pub(crate) static TARGETS: [Target; 24] = [
    Target("trajectory", None, &["run.safetensors"], |_, _, bytes| {
        let read = Trajectory::from_bytes(bytes).map_err(said)?;
        let fine = read.positions().iter().all(|p| p.is_finite());
        must(fine, "a position is not finite");
        Ok(())
    }),
    Target("states", None, &["states.safetensors"], |_, _, bytes| {
        done(StateRun::from_bytes(bytes))
    }),
    Target("model", None, &["run/model.safetensors"], |_, _, bytes| {
        let model = Model::from_bytes(bytes).map_err(said)?;
        let fine = model.weights().iter().all(|w| w.is_finite());
        must(fine, "a weight is not finite");
        Ok(())
    }),
    Target(
        "checkpoint",
        Some("checkpoint.safetensors"),
        &["run/checkpoint.safetensors"],
        |bench, path, _| {
            let (cfg, engine) = (bench.training.clone(), OnProcessor::default());
            done(Trainer::resume(cfg, &bench.dataset, path, &engine))
        },
    ),
    Target("rest-pose", Some(REST_POSE), &[], |bench, _, _| {
        let folder = RestPoseFolder::new(bench.folder.join("poses"));
        done(folder.find(POSE, 16))
    }),
    Target("state-npz", Some("state.npz"), &[], |bench, _, _| {
        let choice = StateChoice {
            file: "state.npz".to_owned(),
            frame: Some(1),
            ..StateChoice::default()
        };
        done(choice.read(&bench.folder, 16))
    }),
    Target(
        "obj",
        None,
        &["run.obj", "/crates/selvedge/tests/arcsim/square.obj"],
        |_, _, bytes| done(parse_obj_with(text(bytes)?, MeshOptions::default())),
    ),
    Target("glb", Some("mesh.glb"), &["run.glb"], shape),
    Target("usda", Some("mesh.usda"), &["run.usda"], shape),
    Target(
        "usdc",
        Some("cache.usdc"),
        &["run.usdc", BLENDER],
        |b, path, _| {
            let read = shape(b, path, &[]);
            beside(b, "by-usdc.toml")?;
            read
        },
    ),
    Target("usdz", Some("rig.usdz"), &["run.usdz"], |_, path, _| {
        rig(path)
    }),
    Target("pc2", Some("cache.pc2"), &["run.pc2"], |bench, _, _| {
        beside(bench, "by-pc2.toml")
    }),
    Target(
        "scene",
        Some("scene.toml"),
        &[
            "push.toml",
            "/docs/src/scenes",
            "/assets/scenes/default.toml",
        ],
        scene,
    ),
    Target(
        "arcsim",
        Some("arcsim.json"),
        &["/crates/selvedge/tests/arcsim/scene.json"],
        scene,
    ),
    Target("scene-json", None, &[], |_, _, bytes| {
        let json = serde_json::from_slice(bytes).map_err(said)?;
        done(SceneSpec::from_json(&json))
    }),
    Target(
        "material",
        Some("own-material.toml"),
        &["/assets/materials"],
        |bench, _, _| beside(bench, "by-material.toml"),
    ),
    Target(
        "motion",
        Some("motion.toml"),
        &["/assets/motions"],
        |bench, _, bytes| {
            small(bytes)?;
            beside(bench, "by-toml.toml")
        },
    ),
    Target("motion-csv", None, &[], |_, _, bytes| {
        done(parse_recorded_csv(text(bytes)?))
    }),
    Target(
        "preset",
        Some("preset.toml"),
        &["/assets/datasets/tiny.toml"],
        |_, path, bytes| {
            small(bytes)?;
            let preset = DatasetPreset::open(&path.to_string_lossy()).map_err(said)?;
            done(preset.plan())
        },
    ),
    Target(
        "index",
        Some("indexed/index.json"),
        &["tiny/index.json"],
        |bench, _, _| {
            let dataset = Dataset::open(&bench.folder.join("indexed")).map_err(said)?;
            let splits = &dataset.index().splits;
            let mut entries = splits.train.iter().chain(&splits.test);
            entries.try_for_each(|entry| done(dataset.read(entry)))
        },
    ),
    Target(
        "training",
        None,
        &["moment.toml", "/assets/training"],
        |_, path, bytes| done(TrainConfig::parse(text(bytes)?, path)),
    ),
    Target(
        "log",
        Some("log.jsonl"),
        &["run/log.jsonl"],
        |_, path, _| done(training_log(path)),
    ),
    Target("socket", None, &[], |_, _, bytes| {
        let fine = match protocol::decode(bytes).map_err(said)? {
            ClientMessage::Drag(drag) => drag.goals.iter().all(|(_, goal)| goal.is_finite()),
            ClientMessage::Keys(push) => push.direction.is_finite() && push.turn.is_finite(),
            ClientMessage::Ready(_) | ClientMessage::Command(_) => true,
        };
        must(fine, "a goal or a push is not finite");
        Ok(())
    }),
    Target("options", None, &[], |_, _, bytes| {
        let text = text(bytes)?;
        done(text.parse::<Setting>())
            .or_else(|_| done(text.parse::<FrameSpan>()))
            .or_else(|_| done(span::parse(text)))
            .or_else(|_| done(text.parse::<DeviceName>()))
            .or_else(|_| done(text.parse::<PhysicsMethod>()))
    }),
];

fn said(error: impl Display) -> String {
    error.to_string()
}

fn done<T>(outcome: Result<T, impl Display>) -> Verdict {
    outcome.map(drop).map_err(said)
}

/// The text of `bytes`; readers of text are given nothing else.
fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(said)
}

/// Panics, which the fuzzer reports, where something that was accepted does not hold.
fn must(holds: bool, what: &str) {
    assert!(holds, "accepted, but {what}");
}

/// A mesh, and the nodes around it.
fn shape(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let mesh = done(read_mesh(path, MeshOptions::default()));
    rig(path)?;
    mesh
}

fn rig(path: &Path) -> Verdict {
    let rig = Rig::read(path).map_err(said)?;
    for node in 0..rig.nodes().len() {
        let _ = rig.span(node);
    }
    Ok(())
}

/// Cloths of more vertices than these take their time, which is no finding.
const MOST_VERTICES: f64 = 2000.0;

/// Refuses texts with a number that asks for a large mesh or a long motion.
fn small(bytes: &[u8]) -> Verdict {
    let words = text(bytes)?.split(|c: char| !(c.is_ascii_alphanumeric() || "._-".contains(c)));
    // Vertices per square metre of a large cloth; the density of the air in a scene of ARCSim is
    // another one, and written with a colon.
    let by_density = bytes.windows(9).any(|part| part == b"density =");
    let most = if by_density { 100.0 } else { MOST_VERTICES };
    let large = |word: &str| {
        let number: f64 = word.replace('_', "").parse().unwrap_or(0.0);
        number.abs() > most && number.abs() < 1e9
    };
    match words.into_iter().find(|word| large(word)) {
        Some(word) => Err(format!("{word}: a large number, left out")),
        None => Ok(()),
    }
}

fn scene(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    small(bytes)?;
    let scene = open_scene(&path.to_string_lossy()).map_err(said)?.scene;
    let fine = scene.mesh.positions().iter().all(|p| p.is_finite());
    must(fine, "a position is not finite");
    must(scene.validate().is_ok(), "the scene does not validate");
    Ok(())
}

/// The scene of this name, which names the damaged file.
fn beside(bench: &Bench, name: &str) -> Verdict {
    done(open_scene(&bench.folder.join(name).to_string_lossy()))
}

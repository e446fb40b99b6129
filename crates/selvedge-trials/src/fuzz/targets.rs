//! The readers under trial, one target for each format: what it reads, from which examples, and
//! what must hold of what it accepts.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use selvedge_data::export::FrameSpan;
use selvedge_data::foreign::{ForeignFormat, ForeignSource, ImportOptions};
use selvedge_data::{
    Dataset, DatasetPreset, MeshOptions, RestPoseFolder, Rig, SavedState, SceneSpec, StateChoice,
    StateRun, Trajectory, open_scene, parse_obj_with, parse_recorded_csv, read_mesh,
};
use selvedge_lab::report::TrainingLog;
use selvedge_lab::{span, study};
use selvedge_live::protocol;
use selvedge_model::Model;
use selvedge_train::{CorrectionConfig, OnProcessor, Setting, TrainConfig, Trainer};

use super::mutate::{Make, zip};
use super::seeds::{SCENE, Seeds, TRAINING};

/// Outcome of one input: accepted, or refused with this text.
pub(super) type Verdict = Result<(), String>;

/// A reader, told what to read by the path of a file and its bytes.
type Reader = fn(&Bench, &Path, &[u8]) -> Verdict;

/// A reader with its examples.
pub(super) struct Target {
    pub(super) name: &'static str,
    pub(super) make: Make,
    /// Name of the file in the bench's folder, where the reader opens it itself.
    pub(super) file: Option<&'static str>,
    /// Examples, as [`Seeds::read`] takes them, and how files of folders end.
    seeds: &'static [&'static str],
    ending: &'static str,
    pub(super) read: Reader,
}

/// Where readers work: a folder with the files beside the one that is damaged.
pub(super) struct Bench {
    /// The folder.
    pub(super) folder: PathBuf,
    dataset: Dataset,
    training: TrainConfig,
}

impl Bench {
    /// A bench in `folder`, with what the readers need beside their file.
    ///
    /// # Errors
    /// A seed that is missing.
    pub(super) fn new(folder: &Path, seeds: &Seeds) -> Result<Self> {
        let bench = |name: &str| folder.join(name);
        copy(&seeds.made.join("tiny"), &bench("tiny"))?;
        copy(&seeds.made.join("tiny"), &bench("indexed"))?;
        let foreign = seeds
            .root
            .join("crates/selvedge-data/tests/fixtures/foreign");
        copy(&foreign.join("flag_simple"), &bench("flag"))?;
        copy(&foreign.join("flag_simple"), &bench("flag-meta"))?;
        copy(&foreign.join("released"), &bench("released"))?;
        copy(&foreign.join("released"), &bench("released-faces"))?;
        fs::create_dir(bench("poses"))?;
        let arcsim = seeds.root.join("crates/selvedge/tests/arcsim");
        fs::copy(arcsim.join("square.obj"), bench("square.obj"))?;
        fs::write(bench("push.toml"), SCENE)?;
        for (name, source) in [
            ("csv", "recorded = \"motion.csv\""),
            ("toml", "file = \"motion.toml\""),
        ] {
            let head = SCENE.split("[motion").next().unwrap_or_default();
            fs::write(
                bench(&format!("by-{name}.toml")),
                format!("{head}\n[motion]\n{source}\n"),
            )?;
        }
        let own = SCENE.replace("gray-interlock", "own-material.toml");
        fs::write(bench("by-material.toml"), own)?;
        Ok(Self {
            dataset: Dataset::open(&bench("tiny"))?,
            training: TrainConfig::parse(TRAINING, Path::new("moment.toml"))?,
            folder: folder.to_owned(),
        })
    }
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir(to).with_context(|| to.display().to_string())?;
    for entry in fs::read_dir(from).with_context(|| from.display().to_string())? {
        let path = entry?.path();
        let place = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &place)?;
        } else {
            fs::copy(&path, &place)?;
        }
    }
    Ok(())
}

impl Target {
    /// The whole files that are damaged.
    ///
    /// # Errors
    /// A file that is missing.
    pub(super) fn examples(&self, seeds: &Seeds) -> Result<Vec<Vec<u8>>> {
        let mut all = seeds.read(self.seeds, self.ending)?;
        all.extend(seeds.corpus(self.name)?);
        Ok(all)
    }
}

/// A target whose reader takes bytes or text.
const fn of_bytes(
    name: &'static str,
    make: Make,
    seeds: &'static [&'static str],
    read: Reader,
) -> Target {
    Target {
        name,
        make,
        file: None,
        seeds,
        ending: ".toml",
        read,
    }
}

/// A target whose reader opens `file`.
const fn of_file(
    name: &'static str,
    make: Make,
    file: &'static str,
    seeds: &'static [&'static str],
    read: Reader,
) -> Target {
    Target {
        name,
        make,
        file: Some(file),
        seeds,
        ending: ".toml",
        read,
    }
}

/// All readers.
pub(super) const TARGETS: [Target; 28] = [
    of_bytes(
        "trajectory",
        Make::Safetensors,
        &["run.safetensors"],
        trajectory,
    ),
    of_bytes("states", Make::Safetensors, &["states.safetensors"], states),
    of_bytes(
        "model",
        Make::Safetensors,
        &["run/model.safetensors"],
        model,
    ),
    of_file(
        "checkpoint",
        Make::Safetensors,
        "checkpoint.safetensors",
        &["run/checkpoint.safetensors"],
        checkpoint,
    ),
    of_file("rest-pose", Make::Safetensors, "poses/x", &[], rest_pose),
    of_file("state-npz", Make::Npz, "state.npz", &[], state_npz),
    of_file(
        "npy",
        Make::Npy,
        "released/side/cloth_pos.npy",
        &["/crates/selvedge-data/tests/fixtures/foreign/released/side/cloth_pos.npy"],
        released,
    ),
    of_file(
        "npy-faces",
        Make::Npy,
        "released-faces/forward/face.npy",
        &["/crates/selvedge-data/tests/fixtures/foreign/released/forward/face.npy"],
        released,
    ),
    of_file(
        "tfrecord",
        Make::Records,
        "flag/train.tfrecord",
        &["/crates/selvedge-data/tests/fixtures/foreign/flag_simple/train.tfrecord"],
        flag,
    ),
    of_file(
        "flag-meta",
        Make::Json,
        "flag-meta/meta.json",
        &["/crates/selvedge-data/tests/fixtures/foreign/flag_simple/meta.json"],
        flag_meta,
    ),
    of_bytes(
        "obj",
        Make::Text,
        &["run.obj", "/crates/selvedge/tests/arcsim/square.obj"],
        obj,
    ),
    of_file("glb-mesh", Make::Glb, "mesh.glb", &["run.glb"], mesh_file),
    of_file(
        "usda-mesh",
        Make::Text,
        "mesh.usda",
        &["run.usda"],
        mesh_file,
    ),
    of_file("glb-rig", Make::Glb, "rig.glb", &["run.glb"], rig),
    of_file("usda-rig", Make::Text, "rig.usda", &["run.usda"], rig),
    of_file(
        "scene",
        Make::Toml,
        "scene.toml",
        &[
            "push.toml",
            "/docs/src/scenes",
            "/assets/scenes/default.toml",
        ],
        scene,
    ),
    of_file(
        "arcsim",
        Make::Json,
        "arcsim.json",
        &["/crates/selvedge/tests/arcsim/scene.json"],
        scene,
    ),
    of_bytes("scene-json", Make::Json, &[], scene_json),
    of_file(
        "material",
        Make::Toml,
        "own-material.toml",
        &["/assets/materials"],
        by_material,
    ),
    of_file(
        "motion",
        Make::Toml,
        "motion.toml",
        &["/assets/motions"],
        by_motion,
    ),
    of_bytes("motion-csv", Make::Text, &[], motion_csv),
    of_file(
        "preset",
        Make::Toml,
        "preset.toml",
        &["/assets/datasets/tiny.toml"],
        preset,
    ),
    of_file(
        "index",
        Make::Json,
        "indexed/index.json",
        &["tiny/index.json"],
        index,
    ),
    of_bytes(
        "training",
        Make::Toml,
        &["moment.toml", "/assets/training"],
        training,
    ),
    of_file(
        "study",
        Make::Toml,
        "study.toml",
        &["/assets/studies"],
        study_file,
    ),
    of_file("log", Make::JsonLines, "log.jsonl", &["run/log.jsonl"], log),
    of_bytes("socket", Make::Message, &[], socket),
    of_bytes("options", Make::Text, &[], options),
];

fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// The text of `bytes`; readers of text are given nothing else.
fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(said)
}

/// Panics, which the loop reports, where something that was accepted does not hold.
fn must(holds: bool, what: &str) {
    assert!(holds, "accepted, but {what}");
}

fn finite(trajectory: &Trajectory) {
    let frames = trajectory.frames();
    let fine = (0..trajectory.frame_count()).all(|t| frames.frame(t).iter().all(|p| p.is_finite()));
    must(fine, "a position is not finite");
}

fn trajectory(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let read = Trajectory::from_bytes(bytes).map_err(said)?;
    finite(&read);
    Ok(())
}

fn states(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    StateRun::from_bytes(bytes).map(drop).map_err(said)
}

fn model(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let model = Model::from_bytes(bytes).map_err(said)?;
    must(
        model.weights().iter().all(|w| w.is_finite()),
        "a weight is not finite",
    );
    Ok(())
}

fn checkpoint(bench: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let (cfg, engine) = (bench.training.clone(), OnProcessor::default());
    Trainer::resume(cfg, &bench.dataset, path, &engine)
        .map(drop)
        .map_err(said)
}

/// The content of which the damaged file says to be the rest pose.
const POSE: &str = "sixteen";

fn rest_pose(bench: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let folder = RestPoseFolder::new(bench.folder.join("poses"));
    // The file is called by a hash of its content; there is one such file.
    let named = fs::read_dir(folder.path()).map_err(said)?;
    let other = named
        .flatten()
        .map(|entry| entry.path())
        .find(|found| found != path);
    if let Some(other) = other {
        fs::rename(path, other).map_err(said)?;
    }
    folder.find(POSE, 16).map(drop).map_err(said)
}

/// An example of [`rest_pose`], which leaves its file in the folder.
pub(super) fn rest_pose_example(bench: &Bench) -> Result<Vec<u8>> {
    let folder = RestPoseFolder::new(bench.folder.join("poses"));
    let pose = selvedge_data::KeptRestPose {
        positions: (0..16).map(|k| glam::DVec3::splat(f64::from(k))).collect(),
        solves: 3,
        residual: 1e-4,
        seconds: 0.5,
    };
    folder.keep(POSE, &pose)?;
    let mut files = fs::read_dir(folder.path())?;
    let file = files.next().context("no pose was kept")??;
    Ok(fs::read(file.path())?)
}

fn state_npz(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    let choice = StateChoice {
        frame: Some(1),
        ..StateChoice::default()
    };
    SavedState::read(&bench.folder, "state.npz", &choice, 16)
        .map(drop)
        .map_err(said)
}

fn read_all(source: &ForeignSource) -> Verdict {
    for run in source.runs() {
        finite(&source.read(run).map_err(said)?);
    }
    Ok(())
}

fn released(bench: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let first = path.strip_prefix(&bench.folder).map_err(said)?;
    let folder = bench.folder.join(first.iter().next().unwrap_or_default());
    let options = ImportOptions {
        handles: Some(vec![6, 8]),
        ..ImportOptions::default()
    };
    let source = ForeignSource::open(ForeignFormat::Released, &folder, &options);
    read_all(&source.map_err(said)?)
}

fn flag_in(folder: &Path) -> Verdict {
    let options = ImportOptions {
        density: Some(0.5),
        ..ImportOptions::default()
    };
    let source = ForeignSource::open(ForeignFormat::FlagSimple, folder, &options);
    read_all(&source.map_err(said)?)
}

fn flag(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    flag_in(&bench.folder.join("flag"))
}

fn flag_meta(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    flag_in(&bench.folder.join("flag-meta"))
}

fn obj(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    parse_obj_with(text(bytes)?, MeshOptions::default())
        .map(drop)
        .map_err(said)
}

fn mesh_file(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    read_mesh(path, MeshOptions::default())
        .map(drop)
        .map_err(said)
}

fn rig(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
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
    // Vertices per square metre of a large cloth.
    let by_density = bytes.windows(7).any(|part| part == b"density");
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
    let loaded = open_scene(&path.to_string_lossy()).map_err(said)?;
    let positions = loaded.scene.mesh.positions();
    must(
        positions.iter().all(|p| p.is_finite()),
        "a position is not finite",
    );
    must(
        loaded.scene.validate().is_ok(),
        "the scene does not validate",
    );
    Ok(())
}

fn scene_json(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let json = serde_json::from_slice(bytes).map_err(said)?;
    SceneSpec::from_json(&json).map(drop).map_err(said)
}

fn beside(bench: &Bench, name: &str) -> Verdict {
    let path = bench.folder.join(name);
    open_scene(&path.to_string_lossy()).map(drop).map_err(said)
}

fn by_material(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    beside(bench, "by-material.toml")
}

fn by_motion(bench: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    small(bytes)?;
    beside(bench, "by-toml.toml")
}

fn motion_csv(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    parse_recorded_csv(text(bytes)?).map(drop).map_err(said)
}

fn preset(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    small(bytes)?;
    let preset = DatasetPreset::open(&path.to_string_lossy()).map_err(said)?;
    preset.plan().map(drop).map_err(said)
}

fn index(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    let dataset = Dataset::open(&bench.folder.join("indexed")).map_err(said)?;
    let splits = &dataset.index().splits;
    for entry in splits.train.iter().chain(&splits.test) {
        dataset.read(entry).map_err(said)?;
    }
    Ok(())
}

fn training(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    let text = text(bytes)?;
    if CorrectionConfig::is_meant(text) {
        return CorrectionConfig::parse_with(text, path, &[])
            .map(drop)
            .map_err(said);
    }
    TrainConfig::parse(text, path).map(drop).map_err(said)
}

fn study_file(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    study::open(&path.to_string_lossy()).map(drop).map_err(said)
}

fn log(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    TrainingLog::read(path).map(drop).map_err(said)
}

fn socket(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    use protocol::ClientMessage;
    match protocol::decode(bytes).map_err(said)? {
        ClientMessage::Drag(drag) => {
            let finite = drag.goals.iter().all(|(_, goal)| goal.is_finite());
            must(finite, "a goal is not finite");
        }
        ClientMessage::Keys(push) => {
            must(
                push.direction.is_finite() && push.turn.is_finite(),
                "a push is not finite",
            );
        }
        ClientMessage::Ready(_) | ClientMessage::Command(_) => {}
    }
    Ok(())
}

fn options(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let text = text(bytes)?;
    let readers = [
        text.parse::<Setting>().map(drop).map_err(said),
        text.parse::<FrameSpan>().map(drop).map_err(said),
        span::parse(text).map(drop).map_err(said),
        text.parse::<selvedge_lab::machine::DeviceName>()
            .map(drop)
            .map_err(said),
        text.parse::<selvedge_lab::convergence::NamedIntegrator>()
            .map(drop)
            .map_err(said),
    ];
    let mut refused = None;
    for outcome in readers {
        match outcome {
            Ok(()) => return Ok(()),
            Err(text) => refused = Some(text),
        }
    }
    refused.map_or(Ok(()), Err)
}

/// Examples of targets that have no file: messages of the socket, options, a scene in JSON.
///
/// # Errors
/// A scene that cannot be written as JSON.
pub(super) fn written_examples(name: &str, bench: &Bench) -> Result<Vec<Vec<u8>>> {
    let message = |kind: u8, body: &[u8]| [&[protocol::VERSION, kind, 0, 0], body].concat();
    Ok(match name {
        "socket" => {
            let drag = [&1_u32.to_le_bytes()[..], &1_u32.to_le_bytes(), &[0; 16]].concat();
            let commands = [
                r#"{"do":"pause"}"#,
                r#"{"do":"wind","wind":[1.0,0.0,0.5]}"#,
                r#"{"do":"hold","vertices":[1,2,3]}"#,
                r#"{"do":"limits","speed":1.0,"acceleration":2.0}"#,
                r#"{"do":"seek","frame":3}"#,
            ];
            let mut all = vec![
                message(16, &[7, 0, 0, 0]),
                message(17, &drag),
                message(18, &[0; 16]),
            ];
            all.extend(commands.map(|command| message(19, command.as_bytes())));
            all
        }
        "options" => [
            "steps=3",
            "model.latent = 32",
            "a.b=[1, 2]",
            "20..80",
            "..5",
            "1h30m",
            "90s",
            "cuda",
            "newton",
        ]
        .map(|text| text.as_bytes().to_vec())
        .to_vec(),
        "scene-json" => {
            let path = bench.folder.join("push.toml");
            let loaded = open_scene(&path.to_string_lossy())?;
            vec![loaded.spec.to_json()?.to_string().into_bytes()]
        }
        "motion-csv" => {
            let mut text = "frame,handle,x,y,z\n".to_owned();
            for frame in 0..4 {
                for handle in 0..2 {
                    text.push_str(&format!("{frame},{handle},0.{frame},{handle}.5,-1\n"));
                }
            }
            vec![text.into_bytes()]
        }
        "rest-pose" => vec![rest_pose_example(bench)?],
        "state-npz" => {
            let zeros = [0; 8 * 2 * 16 * 3];
            let numbers = [0_i64, 1].map(i64::to_le_bytes).concat();
            let entries = [
                ("positions.npy", npy("<f8", "(2, 16, 3)", &zeros)),
                ("velocities.npy", npy("<f8", "(2, 16, 3)", &zeros)),
                ("frames.npy", npy("<i8", "(2,)", &numbers)),
            ];
            vec![zip(
                &entries.map(|(name, bytes)| (name.as_bytes().to_vec(), bytes))
            )]
        }
        _ => Vec::new(),
    })
}

/// A NumPy array.
fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), data].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_fixtures_are_there() {
        let mut names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        names.sort_unstable();
        let all = names.len();
        names.dedup();
        assert_eq!(names.len(), all);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for seed in TARGETS.iter().flat_map(|target| target.seeds) {
            if let Some(kept) = seed.strip_prefix('/') {
                assert!(root.join(kept).exists(), "{seed}");
            }
        }
    }
}

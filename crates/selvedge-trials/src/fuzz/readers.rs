//! The readers, each given a damaged file: what they refuse, and what holds of what they accept.

use std::path::Path;

use selvedge_data::export::FrameSpan;
use selvedge_data::{
    Dataset, DatasetPreset, MeshOptions, RestPoseFolder, Rig, SavedState, SceneSpec, StateChoice,
    StateRun, Trajectory, open_scene, parse_obj_with, parse_recorded_csv, read_mesh,
};
use selvedge_lab::report::TrainingLog;
use selvedge_lab::{span, study};
use selvedge_live::protocol;
use selvedge_model::Model;
use selvedge_train::{OnProcessor, Setting, TrainConfig, Trainer};

use super::bench::Bench;

/// Outcome of one input: accepted, or refused with this text.
pub(super) type Verdict = Result<(), String>;

fn said(error: impl std::fmt::Display) -> String {
    // Errors of the laboratory tell their causes so.
    format!("{error:#}")
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

pub(super) fn trajectory(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let read = Trajectory::from_bytes(bytes).map_err(said)?;
    finite(&read);
    Ok(())
}

pub(super) fn states(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    StateRun::from_bytes(bytes).map(drop).map_err(said)
}

pub(super) fn model(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let model = Model::from_bytes(bytes).map_err(said)?;
    must(
        model.weights().iter().all(|w| w.is_finite()),
        "a weight is not finite",
    );
    Ok(())
}

pub(super) fn checkpoint(bench: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let (cfg, engine) = (bench.training.clone(), OnProcessor::default());
    Trainer::resume(cfg, &bench.dataset, path, &engine)
        .map(drop)
        .map_err(said)
}

/// The content of which the damaged file says to be the rest pose.
const POSE: &str = "sixteen";

pub(super) fn rest_pose(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    let folder = RestPoseFolder::new(bench.folder.join("poses"));
    folder.find(POSE, 16).map(drop).map_err(said)
}

pub(super) fn state_npz(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    let choice = StateChoice {
        frame: Some(1),
        ..StateChoice::default()
    };
    SavedState::read(&bench.folder, "state.npz", &choice, 16)
        .map(drop)
        .map_err(said)
}

pub(super) fn obj(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    parse_obj_with(text(bytes)?, MeshOptions::default())
        .map(drop)
        .map_err(said)
}

/// A mesh, and the nodes around it.
pub(super) fn shape(bench: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    let mesh = read_mesh(path, MeshOptions::default()).map_err(said);
    rig(bench, path, bytes)?;
    mesh.map(drop)
}

/// A mesh, the nodes around it, and the scene whose obstacle it moves.
pub(super) fn cache(bench: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    let read = shape(bench, path, bytes);
    by_cache(bench, path, bytes)?;
    read
}

pub(super) fn rig(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
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

pub(super) fn scene(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
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

pub(super) fn scene_json(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let json = serde_json::from_slice(bytes).map_err(said)?;
    SceneSpec::from_json(&json).map(drop).map_err(said)
}

fn beside(bench: &Bench, name: &str) -> Verdict {
    let path = bench.folder.join(name);
    open_scene(&path.to_string_lossy()).map(drop).map_err(said)
}

pub(super) fn by_material(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    beside(bench, "by-material.toml")
}

pub(super) fn by_motion(bench: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    small(bytes)?;
    beside(bench, "by-toml.toml")
}

/// The scene whose obstacle is in the damaged cache.
pub(super) fn by_cache(bench: &Bench, path: &Path, _: &[u8]) -> Verdict {
    let kind = path.extension().unwrap_or_default().to_string_lossy();
    beside(bench, &format!("by-{kind}.toml"))
}

pub(super) fn motion_csv(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    parse_recorded_csv(text(bytes)?).map(drop).map_err(said)
}

pub(super) fn preset(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    small(bytes)?;
    let preset = DatasetPreset::open(&path.to_string_lossy()).map_err(said)?;
    preset.plan().map(drop).map_err(said)
}

pub(super) fn index(bench: &Bench, _: &Path, _: &[u8]) -> Verdict {
    let dataset = Dataset::open(&bench.folder.join("indexed")).map_err(said)?;
    let splits = &dataset.index().splits;
    for entry in splits.train.iter().chain(&splits.test) {
        dataset.read(entry).map_err(said)?;
    }
    Ok(())
}

pub(super) fn training(_: &Bench, path: &Path, bytes: &[u8]) -> Verdict {
    let text = text(bytes)?;
    TrainConfig::parse(text, path).map(drop).map_err(said)
}

pub(super) fn study_file(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    study::open(&path.to_string_lossy()).map(drop).map_err(said)
}

pub(super) fn log(_: &Bench, path: &Path, _: &[u8]) -> Verdict {
    TrainingLog::read(path).map(drop).map_err(said)
}

pub(super) fn socket(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
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

pub(super) fn options(_: &Bench, _: &Path, bytes: &[u8]) -> Verdict {
    let text = text(bytes)?;
    let readers = [
        text.parse::<Setting>().map(drop).map_err(said),
        text.parse::<FrameSpan>().map(drop).map_err(said),
        span::parse(text).map(drop).map_err(said),
        text.parse::<selvedge_lab::machine::DeviceName>()
            .map(drop)
            .map_err(said),
        text.parse::<selvedge_lab::evaluation::PhysicsMethod>()
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

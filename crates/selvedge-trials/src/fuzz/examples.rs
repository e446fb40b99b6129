//! Whole inputs of targets that have no file: messages of the socket, options, arrays, texts.

use std::fs;

use anyhow::{Context, Result};
use glam::DVec3;
use selvedge_data::{KeptRestPose, RestPoseFolder, open_scene};
use selvedge_live::protocol;

use super::bench::Bench;
use super::readers::POSE;
use super::zip::zip;

/// Texts that options of the command line take.
const OPTIONS: [&str; 9] = [
    "steps=3",
    "model.latent = 32",
    "a.b=[1, 2]",
    "20..80",
    "..5",
    "1h30m",
    "90s",
    "gpu",
    "linearised:4",
];

/// The examples of the target called `name`; none where it has files.
pub(super) fn written_examples(name: &str, bench: &Bench) -> Result<Vec<Vec<u8>>> {
    Ok(match name {
        "socket" => messages(),
        "options" => OPTIONS.map(|text| text.as_bytes().to_vec()).to_vec(),
        "scene-json" => {
            let path = bench.folder.join("push.toml");
            let loaded = open_scene(&path.to_string_lossy())?;
            vec![loaded.spec.to_json()?.to_string().into_bytes()]
        }
        "motion-csv" => vec![recorded_motion()],
        "rest-pose" => vec![rest_pose(bench)?],
        "state-npz" => vec![states()],
        _ => Vec::new(),
    })
}

fn messages() -> Vec<Vec<u8>> {
    let message = |kind: u8, body: &[u8]| [&[protocol::VERSION, kind, 0, 0], body].concat();
    let one = 1_u32.to_le_bytes();
    let drag = [&one[..], &one, &[0; 16]].concat();
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

fn recorded_motion() -> Vec<u8> {
    let mut text = "frame,handle,x,y,z\n".to_owned();
    for frame in 0..4 {
        for handle in 0..2 {
            text.push_str(&format!("{frame},{handle},0.{frame},{handle}.5,-1\n"));
        }
    }
    text.into_bytes()
}

/// The states of 16 vertices at two frames.
fn states() -> Vec<u8> {
    let zeros = [0; 8 * 2 * 16 * 3];
    let numbers = [0_i64, 1].map(i64::to_le_bytes).concat();
    let entries = [
        ("positions.npy", npy("<f8", "(2, 16, 3)", &zeros)),
        ("velocities.npy", npy("<f8", "(2, 16, 3)", &zeros)),
        ("frames.npy", npy("<i8", "(2,)", &numbers)),
    ];
    zip(&entries.map(|(name, bytes)| (name.as_bytes().to_vec(), bytes)))
}

/// A rest pose, which leaves its file in the folder.
fn rest_pose(bench: &Bench) -> Result<Vec<u8>> {
    let folder = RestPoseFolder::new(bench.folder.join("poses"));
    let pose = KeptRestPose {
        positions: (0..16).map(|k| DVec3::splat(f64::from(k))).collect(),
        solves: 3,
        residual: 1e-4,
        seconds: 0.5,
    };
    folder.keep(POSE, &pose)?;
    let mut files = fs::read_dir(folder.path())?;
    let file = files.next().context("no pose was kept")??;
    Ok(fs::read(file.path())?)
}

/// A NumPy array.
fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), data].concat()
}

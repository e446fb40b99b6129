//! The readers under trial, one target for each format: what it reads, from which examples, and
//! what must hold of what it accepts.

use std::path::Path;

use anyhow::Result;

use super::bench::Bench;
use super::mend::Make;
use super::readers::{
    Verdict, by_cache, by_material, by_motion, checkpoint, index, log, mesh_file, model,
    motion_csv, obj, options, preset, rest_pose, rig, scene, scene_json, socket, state_npz, states,
    study_file, training, trajectory,
};
use super::seeds::Seeds;

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

impl Target {
    /// The whole files that are damaged.
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

const BLENDER_USDC: &str = "/crates/selvedge-data/tests/fixtures/caches/blender.usdc";

/// All readers.
pub(super) const TARGETS: [Target; 29] = [
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
    of_bytes(
        "obj",
        Make::Plain,
        &["run.obj", "/crates/selvedge/tests/arcsim/square.obj"],
        obj,
    ),
    of_file("glb-mesh", Make::Glb, "mesh.glb", &["run.glb"], mesh_file),
    of_file(
        "usda-mesh",
        Make::Plain,
        "mesh.usda",
        &["run.usda"],
        mesh_file,
    ),
    of_file("glb-rig", Make::Glb, "rig.glb", &["run.glb"], rig),
    of_file("usda-rig", Make::Plain, "rig.usda", &["run.usda"], rig),
    of_file(
        "usdc-mesh",
        Make::Plain,
        "mesh.usdc",
        &["run.usdc", BLENDER_USDC],
        mesh_file,
    ),
    of_file(
        "usdc-rig",
        Make::Plain,
        "rig.usdc",
        &["run.usdc", BLENDER_USDC],
        rig,
    ),
    of_file(
        "usdc-cache",
        Make::Plain,
        "cache.usdc",
        &["run.usdc", BLENDER_USDC],
        by_cache,
    ),
    of_file("usdz", Make::Plain, "rig.usdz", &["run.usdz"], rig),
    of_file("pc2", Make::Plain, "cache.pc2", &["run.pc2"], by_cache),
    of_file(
        "scene",
        Make::Plain,
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
        Make::Plain,
        "arcsim.json",
        &["/crates/selvedge/tests/arcsim/scene.json"],
        scene,
    ),
    of_bytes("scene-json", Make::Plain, &[], scene_json),
    of_file(
        "material",
        Make::Plain,
        "own-material.toml",
        &["/assets/materials"],
        by_material,
    ),
    of_file(
        "motion",
        Make::Plain,
        "motion.toml",
        &["/assets/motions"],
        by_motion,
    ),
    of_bytes("motion-csv", Make::Plain, &[], motion_csv),
    of_file(
        "preset",
        Make::Plain,
        "preset.toml",
        &["/assets/datasets/tiny.toml"],
        preset,
    ),
    of_file(
        "index",
        Make::Plain,
        "indexed/index.json",
        &["tiny/index.json"],
        index,
    ),
    of_bytes(
        "training",
        Make::Plain,
        &["moment.toml", "/assets/training"],
        training,
    ),
    of_file(
        "study",
        Make::Plain,
        "study.toml",
        &["/assets/studies"],
        study_file,
    ),
    of_file("log", Make::Plain, "log.jsonl", &["run/log.jsonl"], log),
    of_bytes("socket", Make::Plain, &[], socket),
    of_bytes("options", Make::Plain, &[], options),
];

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

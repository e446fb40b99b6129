//! The readers under trial, one target for each format: what it reads, from which examples, and
//! what must hold of what it accepts.

use std::path::Path;

use anyhow::Result;

use super::bench::Bench;
use super::readers::{
    Verdict, by_cache, by_material, by_motion, cache, checkpoint, index, log, model, motion_csv,
    obj, options, preset, rest_pose, rig, scene, scene_json, shape, socket, state_npz, states,
    study_file, training, trajectory,
};
use super::seeds::Seeds;

/// A reader, told what to read by the path of a file and its bytes.
type Reader = fn(&Bench, &Path, &[u8]) -> Verdict;

/// A reader with its examples.
pub(super) struct Target {
    pub(super) name: &'static str,
    /// Name of the file in the bench's folder, where the reader opens it itself.
    pub(super) file: Option<&'static str>,
    /// Examples, as [`Seeds::read`] takes them, and how files of folders end.
    seeds: &'static [&'static str],
    ending: &'static str,
    pub(super) read: Reader,
}

impl Target {
    /// The whole inputs that are damaged: seeds and the corpus.
    pub(super) fn examples(&self, seeds: &Seeds) -> Result<Vec<Vec<u8>>> {
        let mut all = seeds.read(self.seeds, self.ending)?;
        all.extend(seeds.corpus(self.name)?);
        Ok(all)
    }
}

/// A target whose reader takes bytes or text.
const fn of_bytes(name: &'static str, seeds: &'static [&'static str], read: Reader) -> Target {
    Target {
        name,
        file: None,
        seeds,
        ending: ".toml",
        read,
    }
}

/// A target whose reader opens `file`.
const fn of_file(
    name: &'static str,
    file: &'static str,
    seeds: &'static [&'static str],
    read: Reader,
) -> Target {
    Target {
        name,
        file: Some(file),
        seeds,
        ending: ".toml",
        read,
    }
}

const BLENDER_USDC: &str = "/crates/selvedge-data/tests/fixtures/caches/blender.usdc";

/// The place of a pose that is kept as `POSE` of the readers: a hash of that.
const REST_POSE: &str =
    "poses/71416f2faa304e3d70a76b855b0b82e9d6a2f549c54daac536860c0ad17fa2f6.safetensors";

/// All readers.
pub(super) const TARGETS: [Target; 25] = [
    of_bytes("trajectory", &["run.safetensors"], trajectory),
    of_bytes("states", &["states.safetensors"], states),
    of_bytes("model", &["run/model.safetensors"], model),
    of_file(
        "checkpoint",
        "checkpoint.safetensors",
        &["run/checkpoint.safetensors"],
        checkpoint,
    ),
    of_file("rest-pose", REST_POSE, &[], rest_pose),
    of_file("state-npz", "state.npz", &[], state_npz),
    of_bytes(
        "obj",
        &["run.obj", "/crates/selvedge/tests/arcsim/square.obj"],
        obj,
    ),
    of_file("glb", "mesh.glb", &["run.glb"], shape),
    of_file("usda", "mesh.usda", &["run.usda"], shape),
    of_file("usdc", "cache.usdc", &["run.usdc", BLENDER_USDC], cache),
    of_file("usdz", "rig.usdz", &["run.usdz"], rig),
    of_file("pc2", "cache.pc2", &["run.pc2"], by_cache),
    of_file(
        "scene",
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
        "arcsim.json",
        &["/crates/selvedge/tests/arcsim/scene.json"],
        scene,
    ),
    of_bytes("scene-json", &[], scene_json),
    of_file(
        "material",
        "own-material.toml",
        &["/assets/materials"],
        by_material,
    ),
    of_file("motion", "motion.toml", &["/assets/motions"], by_motion),
    of_bytes("motion-csv", &[], motion_csv),
    of_file(
        "preset",
        "preset.toml",
        &["/assets/datasets/tiny.toml"],
        preset,
    ),
    of_file("index", "indexed/index.json", &["tiny/index.json"], index),
    of_bytes("training", &["moment.toml", "/assets/training"], training),
    of_file("study", "study.toml", &["/assets/studies"], study_file),
    of_file("log", "log.jsonl", &["run/log.jsonl"], log),
    of_bytes("socket", &[], socket),
    of_bytes("options", &[], options),
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

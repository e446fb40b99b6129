//! The folder in which readers work, with what stands beside the file that is damaged.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;
use selvedge_data::Dataset;
use selvedge_train::TrainConfig;

use super::seeds::{SCENE, Seeds, TRAINING};
use crate::program::copy_folder;

/// The folder in which readers work, with the files beside the one that is damaged.
pub(super) struct Bench {
    pub(super) folder: PathBuf,
    /// A small data set, and a training on it.
    pub(super) dataset: Dataset,
    pub(super) training: TrainConfig,
}

impl Bench {
    /// A bench in `folder`, with what the readers need beside their file.
    pub(super) fn new(folder: &Path, seeds: &Seeds) -> Result<Self> {
        let bench = |name: &str| folder.join(name);
        copy_folder(&seeds.made.join("tiny"), &bench("tiny"))?;
        copy_folder(&seeds.made.join("tiny"), &bench("indexed"))?;
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
        for (kind, mesh) in [("usdc", "cache.usdc"), ("pc2", "run.obj")] {
            // Far from the cloth.
            let obstacle = format!(
                "[[obstacles]]\nname = \"o\"\nmesh = \"{mesh}\"\nmotion = \"cache.{kind}\"\ntransform = {{ translation = [0, 0, 50] }}\n"
            );
            let scene = SCENE.replace("frame_rate = 60", "frame_rate = 60\ncontact = {}");
            let scene = format!("{scene}\n{obstacle}");
            fs::write(bench(&format!("by-{kind}.toml")), scene)?;
        }
        fs::copy(seeds.made.join("run.obj"), bench("run.obj"))?;
        let own = SCENE.replace("gray-interlock", "own-material.toml");
        fs::write(bench("by-material.toml"), own)?;
        Ok(Self {
            dataset: Dataset::open(&bench("tiny"))?,
            training: TrainConfig::parse(TRAINING, Path::new("moment.toml"))?,
            folder: folder.to_owned(),
        })
    }
}

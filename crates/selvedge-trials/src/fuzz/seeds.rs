//! Whole files to damage: those that the program writes on small examples, shipped ones, and the
//! corpus that is kept in the repository.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::program::Program;

/// A square of 16 vertices, pushed for a tenth of a second.
pub(crate) const SCENE: &str = r#"
name = "push"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 16, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
frame_rate = 60

[motion.inline]
kind = "blocks"
blocks = [
    { duration = 0.05 },
    { duration = 0.05, translations = [{ direction = [1.0, 0.0, 0.5], pace = { distance = 0.02 } }] },
]
"#;

/// A network of a few hundred weights, trained for two steps.
pub(crate) const TRAINING: &str = r#"
name = "moment"
seed = 1
steps = 2
statistics_samples = 4
log_every = 1
learning_rate = { kind = "constant", rate = 1e-3 }
batch = { samples = 2 }

[model]
node_features = ["velocity", "external-force", "kinetic-energy", "node-type"]
edge_features = ["vector", "rest-vector", "elongation", "bending-angle"]
encoder = { kind = "mlp" }
latent = 4
blocks = 1
"#;

/// A folder of files that were made for the trials, and the corpus.
pub(super) struct Seeds {
    /// Files that the program wrote.
    pub(super) made: PathBuf,
    /// Files of the repository.
    pub(super) root: PathBuf,
}

impl Seeds {
    /// Lets `program` write examples in `folder`.
    pub(super) fn make(program: &Program, folder: &Path) -> Result<Self> {
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).context("a seed");
        write("push.toml", SCENE)?;
        write("moment.toml", TRAINING)?;
        for command in [
            "run push.toml --start mesh -o run.safetensors --states states.safetensors",
            "export run.safetensors -o run.glb",
            "export run.safetensors -o run.usda",
            "export run.safetensors -o run.npz",
            "export run.safetensors -o run.usdc",
            "export run.safetensors -o run.usdz",
            "export run.safetensors -o run.pc2",
            "export run.safetensors -o run.obj --frames 0",
            "data generate tiny -o tiny",
            "train moment.toml --data tiny -o run",
        ] {
            program.run(folder, command)?;
        }
        Ok(Self {
            made: folder.to_owned(),
            root: Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."),
        })
    }

    /// The files that `names` mean: of the examples, or from the repository where a name begins
    /// with `/`; a folder means all files in it that end as `ending`.
    pub(super) fn read(&self, names: &[&str], ending: &str) -> Result<Vec<Vec<u8>>> {
        let mut all = Vec::new();
        for name in names {
            let path = match name.strip_prefix('/') {
                Some(kept) => self.root.join(kept),
                None => self.made.join(name),
            };
            if path.is_dir() {
                all.extend(files_in(&path, ending)?);
            } else {
                all.push(path);
            }
        }
        all.iter()
            .map(|path| fs::read(path).with_context(|| path.display().to_string()))
            .collect()
    }

    /// The corpus of the target called `name`.
    pub(super) fn corpus(&self, name: &str) -> Result<Vec<Vec<u8>>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("corpus")
            .join(name);
        if !folder.is_dir() {
            return Ok(Vec::new());
        }
        let files = files_in(&folder, "")?;
        let read = files.iter().map(|path| Ok(fs::read(path)?));
        read.collect()
    }
}

fn files_in(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.is_file() && path.to_string_lossy().ends_with(ending) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

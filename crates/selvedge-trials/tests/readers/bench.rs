//! The folder in which readers work: examples that the program writes, and what stands beside the
//! file that is damaged.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use selvedge_data::Dataset;
use selvedge_train::TrainConfig;

use super::Target;

/// A square of 16 vertices, pushed for a tenth of a second.
const SCENE: &str = r#"
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
const TRAINING: &str = r#"
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

/// A stage of USD's text: a mesh that moves, below a node that does.
const STAGE: &str = r#"#usda 1.0
(
    defaultPrim = "world"
    endTimeCode = 1
    metersPerUnit = 0.01
    timeCodesPerSecond = 24
    upAxis = "Z"
)

def Xform "world" (
    kind = "component"
)
{
    double3 xformOp:translate.timeSamples = {
        0: (0, 0, 1),
        1: (0.5, 0, 1),
    }
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Mesh "sheet" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        rel material:binding = </world/cloth>
        point3f[] points.timeSamples = {
            0: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
            1: [(0, 0, 0), (1, 0, 0), (1, 1, 0.25), (0, 1, 0)],
        }
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "vertex"
        )
    }
}
"#;

/// Commands of the program that write examples.
const COMMANDS: [&str; 10] = [
    "run push.toml --start mesh -o run.safetensors --states states.safetensors",
    "export run.safetensors -o run.glb",
    "export run.safetensors -o run.npz",
    "export run.safetensors -o run.usdc",
    "export run.safetensors -o run.usdz",
    "export run.safetensors -o run.pc2",
    "export run.safetensors -o run.obj --frames 0",
    "data generate tiny -o indexed",
    "data generate tiny -o tiny",
    "train moment.toml --data tiny -o run",
];

/// Length that the text of an error may have over three times that of the input with its control
/// characters escaped `[bytes]`: the program shortens what quotes a whole input, but nothing may
/// grow.
const LONGEST_TEXT: usize = 4096;

/// The folder in which readers work.
pub(crate) struct Bench {
    pub(super) folder: PathBuf,
    /// A small data set, and a training on it.
    pub(super) dataset: Dataset,
    pub(super) training: TrainConfig,
}

impl Bench {
    /// A bench in `folder`, which is made anew; `program` writes examples there.
    ///
    /// # Errors
    /// A folder that cannot be made, or a command that fails.
    pub(crate) fn new(program: &Path, folder: &Path) -> Result<Self> {
        if folder.exists() {
            fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        fs::create_dir_all(folder.join("poses")).with_context(|| folder.display().to_string())?;
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).context("a seed");
        write("push.toml", SCENE)?;
        write("moment.toml", TRAINING)?;
        write("run.usda", STAGE)?;
        let head = SCENE.split("[motion").next().unwrap_or_default();
        let by_motion = format!("{head}\n[motion]\nfile = \"motion.toml\"\n");
        write("by-toml.toml", &by_motion)?;
        let by_material = SCENE.replace("gray-interlock", "own-material.toml");
        write("by-material.toml", &by_material)?;
        for (kind, mesh) in [("usdc", "cache.usdc"), ("pc2", "run.obj")] {
            let scene = SCENE.replace("frame_rate = 60", "frame_rate = 60\ncontact = {}");
            // Far from the cloth.
            let obstacle = format!(
                "[[obstacles]]\nname = \"o\"\nmesh = \"{mesh}\"\nmotion = \"cache.{kind}\"\ntransform = {{ translation = [0, 0, 50] }}\n"
            );
            write(&format!("by-{kind}.toml"), &format!("{scene}\n{obstacle}"))?;
        }
        let square = repository().join("crates/selvedge/tests/arcsim/square.obj");
        fs::copy(square, folder.join("square.obj"))?;
        for command in COMMANDS {
            let output = Command::new(program)
                .args(command.split_whitespace())
                .current_dir(folder)
                .env("SELVEDGE_CACHE", "off")
                .output()
                .with_context(|| program.display().to_string())?;
            let said = String::from_utf8_lossy(&output.stderr);
            ensure!(output.status.success(), "selvedge {command}: {said}");
        }
        Ok(Self {
            dataset: Dataset::open(&folder.join("tiny"))?,
            training: TrainConfig::parse(TRAINING, Path::new("moment.toml"))?,
            folder: folder.to_owned(),
        })
    }

    /// The whole inputs of a target: its examples and the corpus.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn examples(&self, target: &Target) -> Result<Vec<Vec<u8>>> {
        let corpus = repository().join("crates/selvedge-trials/corpus");
        let mut paths = Vec::new();
        for seed in target.2 {
            let path = match seed.strip_prefix('/') {
                Some(kept) => repository().join(kept),
                None => self.folder.join(seed),
            };
            if path.is_dir() { paths.extend(files_in(&path, ".toml")?) } else { paths.push(path) }
        }
        if corpus.join(target.0).is_dir() {
            paths.extend(files_in(&corpus.join(target.0), "")?);
        }
        let read = |path: &PathBuf| fs::read(path).with_context(|| path.display().to_string());
        paths.iter().map(read).collect()
    }

    /// Gives `input` to the reader of a target.
    ///
    /// # Errors
    /// The reader's words, where it refuses the input.
    ///
    /// # Panics
    /// Where the reader does, accepts what does not hold, or says pages.
    pub(crate) fn read(&self, target: &Target, input: &[u8]) -> Result<(), String> {
        let path = self.folder.join(target.1.unwrap_or("input"));
        if target.1.is_some() {
            fs::write(&path, input).map_err(|error| error.to_string())?;
        }
        (target.3)(self, &path, input).inspect_err(|text| {
            let most = LONGEST_TEXT + 3 * input.escape_ascii().count();
            assert!(text.len() <= most, "an error of {} bytes", text.len());
        })
    }
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn files_in(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let paths: Result<Vec<PathBuf>, _> = entries.map(|entry| Ok(entry?.path())).collect();
    let mut files: Vec<PathBuf> = paths.map_err(|error: std::io::Error| error)?;
    files.retain(|path| path.is_file() && path.to_string_lossy().ends_with(ending));
    files.sort();
    Ok(files)
}

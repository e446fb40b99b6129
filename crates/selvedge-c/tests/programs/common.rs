//! What the tests share: the library and the program, built; a folder with a scene; compilers.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use selvedge_data::Trajectory;
use tempfile::TempDir;

/// A square of 25 vertices that is held by two corners and pushed about.
pub(crate) const SMALL: &str = r#"
name = "small"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 25, size = 0.5, seed = 1 } }
handles = { label = "upper-corners" }
motion = { named = "test-x-minus-z" }
"#;

const CRATE: &str = env!("CARGO_MANIFEST_DIR");
pub(crate) const HEADER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/include/selvedge.h");

/// Functions of the header, in the order of their names.
pub(crate) fn declared(header: &str) -> Vec<&str> {
    let words = header
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_'));
    let mut names: Vec<&str> = words.filter(|word| word.starts_with("selvedge_")).collect();
    names.sort_unstable();
    names
}

/// A folder that is gone after the test.
pub(crate) struct Desk {
    folder: TempDir,
}

/// The folder with the library and the program, both built with the profile of this test.
pub(crate) fn built() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let test = std::env::current_exe().unwrap();
        let folder = test.parent().and_then(Path::parent).unwrap().to_owned();
        let profile = match folder.file_name().and_then(|name| name.to_str()) {
            Some("debug") | None => "dev",
            Some(name) => name,
        };
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "-p", "selvedge", "-p", "selvedge-c"]);
        cargo.args(["--profile", profile, "--target-dir"]);
        let status = cargo
            .arg(folder.parent().unwrap())
            .current_dir(CRATE)
            .status();
        assert!(status.unwrap().success(), "cargo build");
        folder
    })
}

/// Rust files below `folder`, without tests.
pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(sources(&path)),
            false if path.ends_with("tests.rs") => {}
            false => found.push(path),
        }
    }
    found
}

/// Positions of a trajectory, in a row.
pub(crate) fn read_positions(path: &Path) -> Vec<f32> {
    let trajectory = Trajectory::read(path).unwrap();
    let frames = (0..trajectory.frame_count()).flat_map(|frame| trajectory.frame(frame));
    frames.flat_map(|p| p.to_array()).collect()
}

impl Desk {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Runs `command` in the folder, which must succeed, and returns what it prints.
    pub(crate) fn run(&self, command: &mut Command) -> String {
        command.current_dir(self.folder.path());
        command.env("LD_LIBRARY_PATH", built());
        let output = command.output().unwrap();
        let [said, told] = [&output.stdout, &output.stderr].map(|b| String::from_utf8_lossy(b));
        assert!(output.status.success(), "{command:?}: {said}{told}");
        said.into_owned()
    }

    /// Runs a model, or the physics, on `small.toml` by the command line; returns the trajectory.
    pub(crate) fn command_line(&self, model: &str, frames: u32) -> PathBuf {
        if model == "physics" {
            let words = format!("run small.toml --frames {frames} -o physics.safetensors");
            self.selvedge(&words.split(' ').collect::<Vec<_>>());
            return self.path("physics.safetensors");
        }
        // A folder with the name of a model would be taken for its file.
        let out = format!("run-{model}");
        let words = format!("run small.toml --model {model} --frames {frames} -o {out}");
        let words = words.split(' ').chain(["--no-clip"]);
        self.selvedge(&words.collect::<Vec<_>>());
        self.path(&out).join("rollout.safetensors")
    }

    /// Runs the command line.
    fn selvedge(&self, arguments: &[&str]) {
        let mut command = Command::new(built().join("selvedge"));
        self.run(command.args(["--no-cache"]).args(arguments));
    }

    /// Compiles an example with the library beside it.
    pub(crate) fn compile(&self, example: &str, flags: &[&str]) -> PathBuf {
        self.try_compile(example, flags).unwrap()
    }

    /// As [`Self::compile`], or what the compiler said.
    pub(crate) fn try_compile(&self, example: &str, flags: &[&str]) -> Result<PathBuf, String> {
        let program = self.path(&format!("{example}-{}", flags.len()));
        let mut cc = compiler(example);
        cc.args(flags).arg("-o").arg(&program);
        cc.arg("-L").arg(built()).args(["-lselvedge_c", "-lm"]);
        let output = cc.output().unwrap();
        match output.status.success() {
            true => Ok(program),
            false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        }
    }

    /// Compiles an example with the library in it.
    pub(crate) fn compile_static(&self, example: &str) -> PathBuf {
        let program = self.path("static");
        let mut cc = compiler(example);
        cc.arg("-o")
            .arg(&program)
            .arg(built().join("libselvedge_c.a"));
        self.run(cc.args(["-lpthread", "-ldl", "-lm"]));
        program
    }
}

/// The compiler of C, with all its warnings as errors, and an example.
fn compiler(example: &str) -> Command {
    let mut cc = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    cc.args([
        "-std=c11",
        "-D_POSIX_C_SOURCE=200809L",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-g",
    ]);
    let folder = Path::new(CRATE);
    cc.arg("-I").arg(folder.join("include"));
    cc.arg(folder.join("examples").join(example));
    cc
}

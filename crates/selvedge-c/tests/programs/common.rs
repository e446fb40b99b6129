//! What the tests share: the library; a folder with a scene; compilers.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use selvedge::machine::Machine;
use selvedge::{Correction, Model, Recording, Scene, Stepper, start};
use selvedge_data::{Drive, record};
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

/// Whether a tool is not here, which a test then says and stops; with `SELVEDGE_ALL_TOOLS` it fails.
pub(crate) fn is_absent(tool: &str) -> bool {
    let is_absent = Command::new(tool).arg("--version").output().is_err();
    if is_absent {
        left_out(&format!("{tool} is not here"));
    }
    is_absent
}

/// Says why a check is left out, or fails where nothing may be.
pub(crate) fn left_out(why: &str) {
    let all = std::env::var_os("SELVEDGE_ALL_TOOLS");
    assert!(all.is_none(), "{why}: run .ci/setup first");
    eprintln!("left out: {why}");
}

/// A folder that is gone after the test.
pub(crate) struct TestFolder {
    folder: TempDir,
}

/// The folder with the library: Cargo builds all kinds of it for these tests.
pub(crate) fn built() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().unwrap().to_owned()
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

impl TestFolder {
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
        let [said, errors] = [&output.stdout, &output.stderr].map(|b| String::from_utf8_lossy(b));
        assert!(output.status.success(), "{command:?}: {said}{errors}");
        said.into_owned()
    }

    /// Positions of a model, or of the physics, on `small.toml`, in a row, as the command line has
    /// them: the bits of their numbers.
    pub(crate) fn wanted(&self, model: &str, frames: usize) -> Vec<u32> {
        let scene = Scene::named(self.path("small.toml").to_str().unwrap()).unwrap();
        let rest = scene.rest_pose(&mut |_| ControlFlow::Continue(())).unwrap();
        let run = match model {
            "physics" => {
                let state = Scene::at_rest(&scene).start(&mut |_| ControlFlow::Continue(()));
                let mut solver =
                    start::simulator_of_run(scene.built(), &state.unwrap().state).unwrap();
                recorded(
                    &mut solver,
                    &scene,
                    scene.built().physics.substeps as usize,
                    frames,
                )
            }
            name => {
                let model = Model::open(Some(name.as_ref())).unwrap();
                let guard = Correction::Limit;
                let guarded =
                    start::guarded(scene.built(), &rest.positions, &model, &Machine::Cpu, guard);
                recorded(&mut guarded.unwrap(), &scene, 1, frames)
            }
        };
        assert_eq!(run.positions.len(), (frames + 1) * 25);
        let numbers = run.positions.iter().flat_map(|p| p.to_array());
        numbers.map(f32::to_bits).collect()
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
        if output.status.success() {
            Ok(program)
        } else {
            Err(String::from_utf8_lossy(&output.stderr).into_owned())
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

fn recorded<S: Stepper>(
    stepper: &mut S,
    scene: &Scene,
    samples_per_frame: usize,
    frames: usize,
) -> Recording {
    let path = &scene.built().handle_path().unwrap();
    let drive = Drive {
        path,
        samples_per_frame,
    };
    record(stepper, drive, frames, &mut |_| ControlFlow::Continue(()))
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

//! What the tests of the command line share: a folder of its own for each, small scenes in it, and
//! the program itself with its answer and exit code.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};

use selvedge_data::{Trajectory, shipped_presets};
use serde_json::Value;
use tempfile::TempDir;

/// A square of 36 vertices that is held by two corners and pushed forward for half a second.
pub(crate) const PUSH: &str = r#"
name = "push"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }

[motion.inline]
kind = "blocks"
blocks = [
    { duration = 0.25 },
    { duration = 0.25, translations = [{ direction = [1.0, 0.0, 0.5], pace = { distance = 0.2 } }] },
]
"#;

/// Frames after the start of [`PUSH`].
pub(crate) const PUSH_FRAMES: usize = 30;

/// A network of a few thousand weights, trained for a moment.
pub(crate) const TRAINING: &str = r#"
name = "moment"
seed = 1
steps = 6
statistics_samples = 20
log_every = 2
learning_rate = { kind = "constant", rate = 1e-3 }
batch = { samples = 2 }

[model]
node_features = ["velocity", "external-force", "kinetic-energy", "node-type"]
edge_features = ["vector", "rest-vector", "elongation", "bending-angle"]
encoder = { kind = "mlp" }
latent = 8
blocks = 1
"#;

/// A folder that is gone after the test, and the program running in it.
pub(crate) struct TestFolder {
    folder: TempDir,
}

/// The output of the program.
pub(crate) struct Said {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl TestFolder {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// A folder with [`PUSH`] in `push.toml`.
    pub(crate) fn with_push() -> Self {
        let dir = Self::new();
        dir.write("push.toml", PUSH);
        dir
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    pub(crate) fn trajectory(&self, name: &str) -> Trajectory {
        Trajectory::read(&self.path(name)).unwrap()
    }

    /// Names of everything in the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        names_in(self.folder.path())
    }

    /// Names below a folder and their bytes, sorted.
    pub(crate) fn files(&self, name: &str) -> Vec<(String, Vec<u8>)> {
        let folder = self.path(name);
        let files = contents(&folder).into_iter();
        files
            .map(|(path, bytes)| {
                let path = path.strip_prefix(&folder).unwrap();
                (path.display().to_string(), bytes)
            })
            .collect()
    }

    /// The program with these arguments, split at spaces.
    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_selvedge"));
        command
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path())
            // The user's own cache is no part of a test.
            .env("SELVEDGE_CACHE", "off")
            .stdin(Stdio::null());
        command
    }

    pub(crate) fn run(&self, arguments: &str) -> Said {
        let output = self.command(arguments).output().unwrap();
        Said {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Starts the program with `-vv`.
    #[cfg(unix)]
    pub(crate) fn start(&self, arguments: &str) -> Running {
        let mut command = self.command(&format!("{arguments} -vv"));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let err = BufReader::new(child.stderr.take().unwrap());
        Running { child, err }
    }

    /// Runs the program, which must succeed, and gives the one JSON object that it prints.
    pub(crate) fn json(&self, arguments: &str) -> Value {
        let said = self.run(&format!("{arguments} --json"));
        assert_eq!(said.code, Some(0), "{arguments}: {}", said.err);
        let value: Value = serde_json::from_str(&said.out).unwrap();
        assert!(value.is_object());
        value
    }

    /// Runs the program, which must fail with this exit code, print nothing to standard output and
    /// one line that contains all of `words` to standard error.
    pub(crate) fn fails(&self, arguments: &str, code: i32, words: &[&str]) {
        let said = self.run(arguments);
        let (out, err) = (said.out, said.err);
        assert_eq!(said.code, Some(code), "{arguments}: {out} {err}");
        assert_eq!(out, "", "{arguments}");
        assert!(err.starts_with("error: "), "{arguments}: {err}");
        for word in words {
            assert!(err.contains(word), "{arguments}: {err} lacks {word}");
        }
        assert!(!err.contains("panicked"), "{err}");
    }

    /// Calls that must fail as [`Self::fails`] says and leave nothing behind, one a line: the exit
    /// code, the call, and words of its error, with ` | ` between them.
    pub(crate) fn refuses(&self, calls: &str) {
        let all = || (self.names(), contents(&self.path("")));
        let before = all();
        for line in calls.trim().lines() {
            let columns: Vec<&str> = line.split('|').map(str::trim).collect();
            self.fails(columns[1], columns[0].parse().unwrap(), &columns[2..]);
            assert!(all() == before, "{line}: it changed something");
        }
    }

    /// A data set of three short motions, in `tiny`.
    pub(crate) fn tiny(&self) {
        self.json("data generate tiny -o tiny");
    }

    /// The data set `tiny`, and [`TRAINING`] in `moment.toml`.
    pub(crate) fn to_train(&self) {
        self.tiny();
        self.write("moment.toml", TRAINING);
    }

    /// A model that has barely learned, in `run/model.safetensors`.
    pub(crate) fn model(&self) {
        self.to_train();
        self.json("train moment.toml --data tiny -o run");
    }
}

/// The program under way. Ctrl-C is pressed where it has said that it is there: after a while it
/// could still be starting on a busy machine, or be done on a quick one.
#[cfg(unix)]
pub(crate) struct Running {
    child: Child,
    err: BufReader<ChildStderr>,
}

#[cfg(unix)]
impl Running {
    /// Words that it says, with `-vv`, as soon as there is something to write.
    pub(crate) const HAS_RESULTS: &str = "there are results";

    /// Waits until it says `words`.
    pub(crate) fn wait_for(&mut self, words: &str) {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(self.err.read_line(&mut line).unwrap() > 0, "it ended early");
        }
    }

    /// Presses Ctrl-C, which the standard library cannot: `kill` does.
    pub(crate) fn press(&self) {
        let pid = self.child.id().to_string();
        let status = Command::new("kill").args(["-INT", &pid]).status().unwrap();
        assert!(status.success());
    }

    /// Returns true while it goes on.
    pub(crate) fn goes_on(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// The end of it, with what it has said on standard error since it was last waited for.
    pub(crate) fn ended(mut self) -> Said {
        let mut err = String::new();
        self.err.read_to_string(&mut err).unwrap();
        let output = self.child.wait_with_output().unwrap();
        Said {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err,
        }
    }
}

/// Names of everything in a folder, sorted.
pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Every file under a folder with its bytes, sorted by path.
pub(crate) fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for name in names_in(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            let bytes = std::fs::read(&path).unwrap();
            found.push((path, bytes));
        }
    }
    found
}

/// The text of the shipped preset `tiny`.
pub(crate) fn tiny_preset() -> &'static str {
    let mut shipped = shipped_presets().iter();
    shipped.find(|preset| preset.0 == "tiny").unwrap().1
}

/// The number at `pointer` of a JSON object.
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("{value} has no number {pointer}"))
}

/// The words at `key` of every row of a JSON list.
pub(crate) fn column<'a>(rows: impl IntoIterator<Item = &'a Value>, key: &str) -> Vec<&'a str> {
    let words = rows.into_iter().map(|row| row[key].as_str());
    words.map(Option::unwrap).collect()
}

/// The rows of the list at `key` of a JSON object.
pub(crate) fn rows<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap()
}

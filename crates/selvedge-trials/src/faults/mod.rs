//! Faults of a disk under every writer: a call fails, is short, or the power is cut there. Each
//! file is then the old one or the new one, and never another.
//!
//! The faults come from a small library in C between the program and the system's, so that what is
//! tried is the program as it is shipped. Linux only, with a C compiler.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::arguments::Arguments;
use crate::fuzz::{SCENE, TRAINING};
use crate::program::{Program, copy_folder};

/// Kinds of faults, as the library calls them.
const KINDS: [&str; 7] = ["enospc", "eio", "eintr", "eacces", "short", "cut", "drop"];

/// A command that writes into the folder `out`.
struct Case {
    name: &'static str,
    /// The command whose files are there before; none where it starts with an empty folder.
    old: Option<&'static str>,
    /// The command under trial.
    new: &'static str,
}

const CASES: [Case; 13] = [
    of(
        "trajectory",
        "simulate push.toml --from-start --frames 3 --out out/a.safetensors",
        "simulate push.toml --from-start --out out/a.safetensors",
    ),
    of(
        "states",
        "simulate push.toml --from-start --frames 3 --out b.safetensors --states out/a.safetensors",
        "simulate push.toml --from-start --out b.safetensors --states out/a.safetensors",
    ),
    of(
        "glb",
        "export short.safetensors --to out/a.glb",
        "export run.safetensors --to out/a.glb",
    ),
    of(
        "usda",
        "export short.safetensors --to out/a.usda",
        "export run.safetensors --to out/a.usda",
    ),
    of(
        "npz",
        "export short.safetensors --to out/a.npz",
        "export run.safetensors --to out/a.npz",
    ),
    of(
        "pc2",
        "export short.safetensors --to out/a.pc2",
        "export run.safetensors --to out/a.pc2",
    ),
    of(
        "obj",
        "export run.safetensors --to out/a.obj --frames 0",
        "export run.safetensors --to out/a.obj --frames 5",
    ),
    of(
        "gif",
        "export short.safetensors --to out/a.gif",
        "export run.safetensors --to out/a.gif",
    ),
    of(
        "png",
        "inspect short.safetensors --picture out/a.png",
        "inspect run.safetensors --picture out/a.png",
    ),
    of(
        "model",
        "convert model.safetensors --weights bf16 --out out/a.safetensors",
        "convert model.safetensors --weights f16 --out out/a.safetensors",
    ),
    Case {
        name: "data set",
        old: None,
        new: "dataset generate tiny --out out",
    },
    Case {
        name: "import",
        old: None,
        new: "dataset import flag-simple flag --density 0.5 --out out",
    },
    Case {
        name: "training",
        old: None,
        new: "train moment.toml --data tiny --out out",
    },
];

const fn of(name: &'static str, old: &'static str, new: &'static str) -> Case {
    Case {
        name,
        old: Some(old),
        new,
    }
}

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Injects faults into the writers that `options` ask for; returns false where something did not
/// hold.
///
/// # Errors
/// Options that make no sense, a missing program or compiler.
pub(crate) fn run(options: &[String]) -> Result<bool> {
    let options = Arguments::parse(options, &["--faults", "--writer", "--seed"], &[])?;
    let faults = options.number("--faults")?.unwrap_or(50);
    let seed = options.number("--seed")?.unwrap_or(1);
    let wanted = options.all("--writer");
    let program = Program::find()?;
    let folder = tempfile::tempdir().context("a folder to work in")?;
    let folder = folder.path();
    let library = compile(folder)?;
    prepare(&program, folder)?;
    println!("| writer | calls on files | faults | commands that failed | seconds | held |");
    println!("|---|---|---|---|---|---|");
    let mut holds = true;
    for case in &CASES {
        if !wanted.is_empty() && !wanted.contains(&case.name) {
            continue;
        }
        let desk = Desk {
            program: &program,
            library: &library,
            folder,
            case,
        };
        let started = Instant::now();
        let outcome = desk.trial(faults, seed);
        let seconds = started.elapsed().as_secs_f64();
        match outcome {
            Ok([calls, failed]) => println!(
                "| {} | {calls} | {faults} | {failed} | {seconds:.0} | all |",
                case.name
            ),
            Err(error) => {
                holds = false;
                println!("| {} | | | | {seconds:.0} | {error:#} |", case.name);
            }
        }
    }
    Ok(holds)
}

/// Compiles the library of faults.
fn compile(folder: &Path) -> Result<PathBuf> {
    ensure!(
        cfg!(target_os = "linux"),
        "faults are put under a program on Linux only"
    );
    let (source, library) = (folder.join("shim.c"), folder.join("shim.so"));
    fs::write(&source, include_str!("shim.c"))?;
    let output = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .args([&library, &source])
        .args(["-ldl", "-lpthread"])
        .output()
        .context("cc, the C compiler that makes the library of faults")?;
    ensure!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(library)
}

/// Makes what the commands read.
fn prepare(program: &Program, folder: &Path) -> Result<()> {
    fs::write(folder.join("push.toml"), SCENE)?;
    fs::write(folder.join("moment.toml"), TRAINING)?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let flag = root.join("crates/selvedge-data/tests/fixtures/foreign/flag_simple");
    copy_folder(&flag, &folder.join("flag"))?;
    for command in [
        "simulate push.toml --from-start --out run.safetensors",
        "simulate push.toml --from-start --frames 3 --out short.safetensors",
        "dataset generate tiny --out tiny",
        "train moment.toml --data tiny --out trained",
    ] {
        program.run(folder, command)?;
    }
    fs::copy(
        folder.join("trained/model.safetensors"),
        folder.join("model.safetensors"),
    )?;
    Ok(())
}

/// One case with what it needs.
struct Desk<'a> {
    program: &'a Program,
    library: &'a Path,
    folder: &'a Path,
    case: &'a Case,
}

impl Desk<'_> {
    fn out(&self) -> PathBuf {
        self.folder.join("out")
    }

    /// Injects `faults` faults. Returns the calls of a run without any, and how many runs failed.
    fn trial(&self, faults: u64, seed: u64) -> Result<[u64; 2]> {
        let old = match self.case.old {
            None => Files::new(),
            Some(command) => {
                self.set(&Files::new())?;
                self.program.run(self.folder, command)?;
                files_in(&self.out())?
            }
        };
        self.set(&old)?;
        let counted = self.folder.join("count");
        let status = self.command("0 none", &counted)?;
        ensure!(status.success(), "without a fault: {status}");
        let new = files_in(&self.out())?;
        let calls: u64 = fs::read_to_string(&counted)?
            .trim()
            .parse()
            .context("the calls")?;
        ensure!(calls > 2, "only {calls} calls were seen");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut failed = 0;
        for number in 0..faults {
            // Every call once by every kind first, where there are as many faults.
            let kinds = KINDS.len() as u64;
            let (call, kind) = match number < calls * kinds {
                true => (1 + number / kinds, KINDS[(number % kinds) as usize]),
                false => (
                    rng.random_range(1..=calls),
                    KINDS[rng.random_range(0..KINDS.len())],
                ),
            };
            self.set(&old)?;
            let status = self.command(&format!("{call} {kind}"), &counted)?;
            failed += u64::from(!status.success());
            self.check(&old, &new, status, kind)
                .with_context(|| format!("call {call}, {kind}"))?;
        }
        Ok([calls, failed])
    }

    /// Puts these files into the folder, and nothing else.
    fn set(&self, files: &Files) -> Result<()> {
        let out = self.out();
        if out.exists() {
            fs::remove_dir_all(&out)?;
        }
        if self.case.old.is_some() {
            fs::create_dir(&out)?;
        }
        for (name, bytes) in files {
            fs::write(out.join(name), bytes)?;
        }
        Ok(())
    }

    fn command(&self, fault: &str, counted: &Path) -> Result<ExitStatus> {
        let mut command = self.program.command(self.folder, self.case.new);
        command
            .env("LD_PRELOAD", self.library)
            .env("SELVEDGE_FAULT", fault)
            .env("SELVEDGE_FAULT_COUNT", counted)
            // One thread, so that the calls have an order.
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::null());
        Ok(command.status()?)
    }

    /// Checks that every file is the old or the new one, and all new where the command succeeded.
    fn check(&self, old: &Files, new: &Files, status: ExitStatus, kind: &str) -> Result<()> {
        let found = match self.out().exists() {
            true => files_in(&self.out())?,
            false => Files::new(),
        };
        let was_cut = kind == "cut" || kind == "drop";
        for (name, bytes) in &found {
            let text = name.to_string_lossy();
            let is_hidden = text.split('/').any(|part| part.starts_with('.'));
            if is_hidden || text.contains(".before-") {
                ensure!(was_cut, "{text} was left behind");
                continue;
            }
            // A log is appended to; what is under way says so.
            if text.ends_with("log.jsonl") || text.contains("partial") {
                continue;
            }
            if old.get(name) != Some(bytes) && new.get(name) != Some(bytes) {
                bail!("{text} is neither the old file nor the new one");
            }
        }
        for name in old.keys() {
            ensure!(found.contains_key(name), "{} is gone", name.display());
        }
        ensure!(
            !status.success() || found == *new,
            "it succeeded with other files than the new"
        );
        Ok(())
    }
}

/// All files in `path` and its folders, by their names in it.
fn files_in(path: &Path) -> Result<Files> {
    let mut found = Files::new();
    let mut open = vec![path.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder)? {
            let inner = entry?.path();
            match inner.is_dir() {
                true => open.push(inner),
                false => {
                    let name = inner.strip_prefix(path)?.to_owned();
                    found.insert(name, fs::read(&inner)?);
                }
            }
        }
    }
    Ok(found)
}

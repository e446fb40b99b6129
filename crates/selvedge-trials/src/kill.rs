//! Kills of long commands at random times: what they leave is the whole old state or the whole new
//! one, the same command goes on from it, and its end is that of a run that was never killed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_data::{Dataset, Trajectory};
use selvedge_model::Model;

use crate::is_wanted;
use crate::program::Program;

/// A command that takes its time.
struct Case {
    name: &'static str,
    /// Commands before it.
    prepare: &'static [&'static str],
    /// The command; `--resume` is added where `resumes` and there is something to go on from.
    command: &'static str,
    resumes: bool,
    /// True where its results are there as a whole or not at all.
    is_whole: bool,
    /// Folder or file of its results.
    out: &'static str,
}

const CASES: [Case; 5] = [
    Case {
        name: "train",
        prepare: &["data generate tiny -o tiny"],
        command: "train long.toml --data tiny -o run --checkpoint-every 1s",
        resumes: true,
        is_whole: false,
        out: "run",
    },
    Case {
        name: "generate",
        prepare: &[],
        command: "data generate many.toml -o many",
        resumes: false,
        is_whole: false,
        out: "many",
    },
    Case {
        name: "study",
        prepare: &["data generate tiny -o tiny"],
        command: "study study.toml -o study",
        resumes: false,
        is_whole: false,
        out: "study",
    },
    Case {
        name: "import",
        prepare: &[
            "run push.toml --start mesh -o run.safetensors",
            "export run.safetensors -o caches/a.usdc",
            "export run.safetensors -o caches/b.usdc --frames 10..",
        ],
        command: "data import caches --density 0.2 --frame-rate 60 --handles handle_0,handle_1 -o imported",
        resumes: false,
        is_whole: false,
        out: "imported",
    },
    Case {
        name: "export",
        prepare: &["run push.toml --start mesh -o run.safetensors"],
        command: "export run.safetensors -o frames --format obj",
        resumes: false,
        is_whole: true,
        out: "frames",
    },
];

/// Results that say the time or who made them differ from run to run.
const DIFFERS: [&str; 2] = ["record.json", "evaluations/"];

/// Kills of one command so far.
#[derive(Default)]
struct Tally {
    kills: u32,
    /// Runs that came to their end.
    ended: u32,
    /// Times at which it was killed `[s]`.
    times: Vec<f64>,
    seconds: f64,
}

/// Kills that are asked for.
#[derive(Clone, Copy)]
pub(crate) struct Order {
    pub(crate) kills: u32,
    pub(crate) seed: u64,
}

/// Kills the commands of these names, or all; returns false where something did not hold.
///
/// # Errors
/// A program that is missing, or what did not hold.
pub(crate) fn run(order: Order, commands: &[String]) -> Result<bool> {
    let program = Program::find()?;
    let mut holds = true;
    println!("| command | kills | runs to the end | killed after | seconds | held |");
    println!("|---|---|---|---|---|---|");
    for case in CASES.iter().filter(|case| is_wanted(case.name, commands)) {
        let mut tally = Tally::default();
        let outcome = trial(case, &program, order, &mut tally);
        let held = match &outcome {
            Ok(()) => "all".to_owned(),
            Err(error) => format!("{error:#}"),
        };
        let bounds = tally
            .times
            .iter()
            .copied()
            .fold([f64::INFINITY, 0.0], |[a, b], t| [a.min(t), b.max(t)]);
        let Tally {
            kills,
            ended,
            seconds,
            ..
        } = tally;
        println!(
            "| `{}` | {kills} | {ended} | {:.2} to {:.2} s | {seconds:.0} | {held} |",
            case.name, bounds[0], bounds[1]
        );
        holds &= outcome.is_ok();
    }
    Ok(holds)
}

/// Kills one command until it was killed as often as `order` says.
fn trial(case: &Case, program: &Program, order: Order, tally: &mut Tally) -> Result<()> {
    let started = Instant::now();
    let folder = tempfile::tempdir().context("a folder to work in")?;
    let folder = folder.path();
    prepare(folder)?;
    for command in case.prepare {
        program.run(folder, command)?;
    }
    let begun = Instant::now();
    program.run(folder, case.command)?;
    let whole = begun.elapsed();
    let expected = contents(&folder.join(case.out))?;
    remove(&folder.join(case.out))?;
    let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
    while tally.kills < order.kills {
        // Up to a little more than it takes, so that some runs come to their end.
        let after = whole.mul_f64(rng.random_range(0.0..1.1));
        let command = command(case, folder);
        let mut child = program.command(folder, &command).spawn()?;
        let was_killed = kill_after(&mut child, after)?;
        check(case, folder)?;
        if was_killed {
            tally.kills += 1;
            tally.times.push(after.as_secs_f64());
            // A folder of frames is put in its place as a whole, and is never written over.
            if case.is_whole && folder.join(case.out).exists() {
                finished(case, folder, &expected)?;
            }
            continue;
        }
        tally.ended += 1;
        finished(case, folder, &expected)?;
    }
    // What the last kill left can be brought to its end.
    program.run(folder, &command(case, folder))?;
    finished(case, folder, &expected)?;
    tally.ended += 1;
    tally.seconds = started.elapsed().as_secs_f64();
    Ok(())
}

/// Compares what a run that came to its end left with that of one without a kill, and removes it.
fn finished(case: &Case, folder: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) -> Result<()> {
    let out = folder.join(case.out);
    let found = contents(&out)?;
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    let (was, is) = (names(expected), names(&found));
    ensure!(
        was == is,
        "other files than without a kill: {is:?} instead of {was:?}"
    );
    for (name, bytes) in &found {
        ensure!(
            expected.get(name) == Some(bytes),
            "{} differs from that of a run without a kill",
            name.display()
        );
    }
    remove(&out)
}

/// The command, with `--resume` where there is something to go on from.
fn command(case: &Case, folder: &Path) -> String {
    let kept = folder.join(case.out).join("checkpoint.safetensors");
    match case.resumes && kept.exists() {
        true => format!("{} --resume", case.command),
        false => case.command.to_owned(),
    }
}

/// Kills `child` after some time. Returns false where it ended by itself.
///
/// # Errors
/// Where it ended with a failure.
fn kill_after(child: &mut Child, after: Duration) -> Result<bool> {
    let until = Instant::now() + after;
    while Instant::now() < until {
        if let Some(status) = child.try_wait()? {
            ensure!(status.success(), "the program failed: {status}");
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    // What Rust calls so is SIGKILL on Unix: the program does not hear of it.
    child.kill()?;
    let status = child.wait()?;
    Ok(!status.success())
}

/// Checks that every file that a kill left under its own name is whole.
fn check(case: &Case, folder: &Path) -> Result<()> {
    let out = folder.join(case.out);
    if case.is_whole {
        return Ok(());
    }
    for (name, bytes) in all_files(&out)? {
        let text = name.to_string_lossy();
        let is_hidden = text.split('/').any(|part| part.starts_with('.'));
        let whole: Result<()> = if is_hidden {
            Ok(())
        } else if text.ends_with("model.safetensors") {
            Model::from_bytes(&bytes).map(drop).map_err(Into::into)
        } else if text.ends_with(".safetensors") && !text.contains("checkpoint") {
            Trajectory::from_bytes(&bytes).map(drop).map_err(Into::into)
        } else if text.ends_with(".json") {
            serde_json::from_slice::<serde_json::Value>(&bytes)
                .map(drop)
                .map_err(Into::into)
        } else {
            Ok(())
        };
        whole.with_context(|| format!("after a kill {text} is not whole"))?;
    }
    if out.join("index.json").exists() {
        Dataset::open(&out)?.verify_hashes()?;
    }
    Ok(())
}

/// All files in `path`, by their names in it; the lines of a log that the system may cut are whole
/// only at the end of a run.
fn all_files(path: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut open = vec![path.to_owned()];
    while let Some(folder) = open.pop() {
        if !folder.is_dir() {
            continue;
        }
        for entry in fs::read_dir(&folder)? {
            let inner = entry?.path();
            if inner.is_dir() {
                open.push(inner);
            } else {
                let name = inner.strip_prefix(path)?.to_owned();
                found.insert(name, fs::read(&inner)?);
            }
        }
    }
    Ok(found)
}

/// As [`all_files`], without those that say how long something took. Parts of files are among them:
/// none may outlive the next run.
fn contents(path: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
    ensure!(path.exists(), "{} was not made", path.display());
    let mut all = all_files(path)?;
    all.retain(|name, _| {
        let text = name.to_string_lossy();
        let is_report = text.ends_with(".md")
            || text.ends_with(".csv")
            || text.ends_with(".svg")
            || text.ends_with(".html");
        let differs = is_report || DIFFERS.iter().any(|part| text.contains(part));
        text.ends_with(".part") || !differs
    });
    Ok(all)
}

fn remove(path: &Path) -> Result<()> {
    if path.exists() {
        fs::remove_dir_all(path).with_context(|| format!("removing {}", path.display()))?;
    }
    Ok(())
}

/// Writes the inputs of all commands.
fn prepare(folder: &Path) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let training = crate::fuzz::TRAINING.replace("steps = 2", "steps = 4000");
    fs::write(folder.join("long.toml"), &training)?;
    let short = training.replace("steps = 4000", "steps = 60");
    fs::write(folder.join("short.toml"), short)?;
    fs::write(folder.join("push.toml"), crate::fuzz::SCENE)?;
    fs::write(folder.join("study.toml"), STUDY)?;
    fs::write(folder.join("many.toml"), many(&root)?)?;
    fs::create_dir(folder.join("caches"))?;
    Ok(())
}

/// The preset `tiny` with its motions many times over, each under a name of its own.
fn many(root: &Path) -> Result<String> {
    let path = root.join("assets/datasets/tiny.toml");
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let mut preset: toml::Table = toml::from_str(&text)?;
    let Some(toml::Value::Table(motions)) = preset.get_mut("motions") else {
        bail!("{}: no motions", path.display());
    };
    let push = motions.remove("push").context("the motion push")?;
    motions.remove("turn");
    let mut train = Vec::new();
    for number in 0..12 {
        let name = format!("push-{number}");
        let mut motion = push.clone();
        if let Some(distance) = motion.get_mut("inline").and_then(|inline| {
            inline
                .get_mut("blocks")?
                .get_mut(1)?
                .get_mut("translations")?
                .get_mut(0)?
                .get_mut("pace")?
                .get_mut("distance")
        }) {
            *distance = toml::Value::Float(0.1 + 0.01 * f64::from(number));
        }
        motions.insert(name.clone(), motion);
        train.push(toml::Value::String(name));
    }
    preset.insert("train".to_owned(), toml::Value::Array(train));
    Ok(toml::to_string(&preset)?)
}

/// Two trainings and their evaluation.
const STUDY: &str = r#"
title = "Two of a kind"
budget = { steps = 60 }

[data]
tiny = { folder = "tiny" }

[evaluation]
horizons = [1, 5]
baselines = ["rigid"]

[[train]]
name = "one"
config = "short.toml"

[[train]]
name = "other"
config = "short.toml"
set = ["seed=2"]
"#;

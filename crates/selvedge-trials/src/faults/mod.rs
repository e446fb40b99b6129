//! Faults under every command: a call that writes, reads or takes memory fails, is short, or the
//! power is cut there. Each file is then the old one or the new one, and never another; a command that
//! was ended goes on.
//!
//! The faults come from a small library in C between the program and the system's, so that what is
//! tried is the program as it is shipped. Linux only, with a C compiler.

mod cases;
mod desk;
mod side;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;

use self::cases::cases;
use self::desk::Desk;
pub(crate) use self::side::Side;
use crate::fuzz::{SCENE, TRAINING};
use crate::is_wanted;
use crate::program::Program;

/// Injects faults of these sides, or all, into the commands of these names, or all; returns false
/// where something did not hold.
pub(crate) fn run(faults: u64, sides: &[Side], commands: &[String], seed: u64) -> Result<bool> {
    let cases = cases();
    let names: Vec<&str> = cases.iter().map(|case| case.name).collect();
    for name in commands {
        let is_known = names.contains(&name.as_str());
        ensure!(
            is_known,
            "there is no command {name:?}: {}",
            names.join(", ")
        );
    }
    let program = Program::find()?;
    let folder = tempfile::tempdir().context("a folder to work in")?;
    // As the system calls it, since paths are compared.
    let folder = folder.path().canonicalize()?;
    let library = compile(&folder)?;
    prepare(&program, &folder)?;
    println!("| fails | command | calls | faults | failed | ended by the fault | seconds | held |");
    println!("|---|---|---|---|---|---|---|---|");
    let mut holds = true;
    let is_asked = |side: &&Side| sides.is_empty() || sides.contains(side);
    for &side in Side::value_variants().iter().filter(is_asked) {
        for case in cases.iter().filter(|case| is_wanted(case.name, commands)) {
            let desk = Desk {
                program: &program,
                library: &library,
                folder: &folder,
                case,
                side,
            };
            holds &= row(&desk, faults, seed);
        }
    }
    Ok(holds)
}

/// Tries one command and prints its row.
fn row(desk: &Desk<'_>, faults: u64, seed: u64) -> bool {
    let started = Instant::now();
    let outcome = desk.trial(faults, seed);
    let seconds = started.elapsed().as_secs_f64();
    let (side, name) = (desk.side.name(), desk.case.name);
    match outcome {
        Ok(None) => true,
        Ok(Some(tally)) => {
            let (calls, failed, aborted) = (tally.calls, tally.failed, tally.aborted);
            println!(
                "| {side} | {name} | {calls} | {faults} | {failed} | {aborted} | {seconds:.0} | all |"
            );
            true
        }
        Err(error) => {
            println!("| {side} | {name} | | | | | {seconds:.0} | {error:#} |");
            false
        }
    }
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

/// A scene of files: a mesh, a material and a motion.
const FILES: &str = r#"
name = "files"
material = "gray-interlock.toml"
mesh = { obj = "square.obj" }
handles = { vertices = [0, 1] }
frame_rate = 60
motion = { file = "motion.toml" }
"#;
const MOTION: &str = "kind = \"blocks\"\nblocks = [{ duration = 0.1 }]\n";

/// Makes what the commands read.
fn prepare(program: &Program, folder: &Path) -> Result<()> {
    fs::write(folder.join("push.toml"), SCENE)?;
    fs::write(folder.join("moment.toml"), TRAINING)?;
    fs::write(folder.join("files.toml"), FILES)?;
    fs::write(folder.join("motion.toml"), MOTION)?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let material = "gray-interlock.toml";
    fs::copy(
        root.join("assets/materials").join(material),
        folder.join(material),
    )?;
    fs::create_dir(folder.join("caches"))?;
    for command in [
        "run push.toml --start mesh -o run.safetensors",
        "run push.toml --start mesh --frames 3 -o short.safetensors",
        "export run.safetensors -o square.obj --frames 0",
        "export run.safetensors -o caches/run.usdc",
        "export short.safetensors -o caches/short.usdc",
        "data generate tiny -o tiny",
        "train moment.toml --data tiny -o trained",
    ] {
        program.run(folder, command)?;
    }
    fs::copy(
        folder.join("trained/model.safetensors"),
        folder.join("model.safetensors"),
    )?;
    Ok(())
}

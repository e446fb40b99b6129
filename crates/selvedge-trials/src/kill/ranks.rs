//! Kills of one rank of several: the others end by themselves, and the one is named.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

use crate::program::Program;

/// Time that the other ranks have to end.
const PATIENCE: Duration = Duration::from_secs(15);

/// The program on so many ranks of one thread, started by `mpirun`. What it says is kept.
pub(super) fn command(program: &Program, ranks: usize, folder: &Path, arguments: &str) -> Command {
    let one = program.command(folder, arguments);
    let mut mpirun = Command::new("mpirun");
    mpirun
        .args(["-n", &ranks.to_string()])
        .arg(one.get_program());
    mpirun.args(one.get_args()).current_dir(folder);
    for (name, value) in one.get_envs() {
        if let Some(value) = value {
            mpirun.env(name, value);
        }
    }
    mpirun
        .env("RAYON_NUM_THREADS", "1")
        // Open MPI asks for leave to run as root, and with more ranks than processors; containers
        // may not let processes read one another.
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_btl_vader_single_copy_mechanism", "none")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    mpirun
}

/// Kills rank `rank` so long after all `ranks` have met. Returns the time that the others took to
/// end, or none where the command came to its end before.
///
/// Before they have met MPI itself starts: where a rank was killed then, `mpirun` of Open MPI 4.1.4
/// was seen to wait for ever.
///
/// # Errors
/// A rank that goes on, or that nobody names; a command that failed by itself.
pub(super) fn kill_one(
    child: &mut Child,
    ranks: usize,
    rank: usize,
    after: Duration,
) -> Result<Option<Duration>> {
    // What is said is read meanwhile, or a full pipe would stop them.
    let mut pipe = child.stderr.take().context("the pipe of errors")?;
    let reader = thread::spawn(move || {
        let mut said = Vec::new();
        let _ = pipe.read_to_end(&mut said);
        String::from_utf8_lossy(&said).into_owned()
    });
    let said = || reader.join().unwrap_or_default();
    let (mut all, mut met) = (Vec::new(), None);
    while met.is_none_or(|met: Instant| met.elapsed() < after) {
        if let Some(status) = child.try_wait()? {
            ensure!(status.success(), "mpirun failed: {status}: {}", said());
            return Ok(None);
        }
        thread::sleep(Duration::from_millis(2));
        if met.is_none() {
            all = ranks_of(child.id())?;
            let have_met = all.len() == ranks && all.iter().all(|rank| has_met(*rank, ranks));
            met = have_met.then(Instant::now);
        }
    }
    let victim = all
        .get(rank)
        .context("a rank that is not there")?
        .to_string();
    let kill = Command::new("kill").args(["-9", &victim]).status()?;
    let killed = Instant::now();
    while child.try_wait()?.is_none() || all.iter().any(|rank| is_running(*rank)) {
        ensure!(
            killed.elapsed() < PATIENCE,
            "a rank goes on after another was killed"
        );
        thread::sleep(Duration::from_millis(2));
    }
    let took = killed.elapsed();
    if child.wait()?.success() || !kill.success() {
        // It had ended in the same moment.
        return Ok(None);
    }
    let said = said();
    ensure!(
        said.contains(&format!("rank {rank} ")),
        "nobody names rank {rank}: {said}"
    );
    Ok(Some(took))
}

/// The processes of the ranks that `mpirun` has started, in their order.
fn ranks_of(mpirun: u32) -> Result<Vec<u32>> {
    let mut found = Vec::new();
    for entry in fs::read_dir("/proc").context("/proc: this trial is for Linux")? {
        let name = entry?.file_name();
        let Some(process) = name.to_str().and_then(|name| name.parse().ok()) else {
            continue;
        };
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        let name = stat.split(['(', ')']).nth(1);
        let parent = stat.rsplit(')').next();
        let parent = parent.and_then(|rest| rest.split_whitespace().nth(1));
        if parent == Some(&mpirun.to_string()) && name == Some("selvedge") {
            found.push(process);
        }
    }
    found.sort_unstable();
    Ok(found)
}

/// Returns true where a rank has the memory of all of its machine before it, by which Open MPI
/// sends messages there.
fn has_met(process: u32, ranks: usize) -> bool {
    let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
    maps.matches("/vader_segment").count() >= ranks
}

fn is_running(process: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{process}/stat"));
    stat.is_ok_and(|stat| !stat.contains(") Z"))
}

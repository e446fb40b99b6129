//! One command under faults: its files before, a run for each fault, and what must hold after it.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cases::Case;
use super::side::Side;
use crate::program::Program;

/// Time that a run may take.
const PATIENCE: Duration = Duration::from_secs(120);
/// The signal of a process that ends itself, as Rust's library does without memory.
const ABORT: i32 = 6;
/// The exit code of a process that is ended at a call.
const CUT: i32 = 137;

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// One case with what it needs.
pub(super) struct Desk<'a> {
    pub(super) program: &'a Program,
    pub(super) library: &'a Path,
    pub(super) folder: &'a Path,
    pub(super) case: &'a Case,
    pub(super) side: Side,
}

/// Numbers of a trial.
pub(super) struct Tally {
    /// Calls of a run without a fault.
    pub(super) calls: u64,
    /// Runs that failed.
    pub(super) failed: u64,
    /// Runs that ended at once, without memory.
    pub(super) aborted: u64,
}

/// The end of a run.
struct End {
    status: ExitStatus,
    said: String,
    /// The file whose reading failed.
    path: Option<PathBuf>,
}

impl Desk<'_> {
    fn out(&self) -> PathBuf {
        self.folder.join("out")
    }

    /// Injects `faults` faults; none where the command makes no such call.
    pub(super) fn trial(&self, faults: u64, seed: u64) -> Result<Option<Tally>> {
        let old = match &self.case.old {
            None => Files::new(),
            Some(command) => {
                self.set(&Files::new())?;
                self.program.run(self.folder, command)?;
                files_in(&self.out())?
            }
        };
        self.set(&old)?;
        let counted = self.folder.join("count");
        let status = self.run("0 none")?.status;
        ensure!(status.success(), "without a fault: {status}");
        let new = files_in(&self.out())?;
        let calls: u64 = fs::read_to_string(&counted)?
            .trim()
            .parse()
            .context("the calls")?;
        if calls == 0 && new.is_empty() {
            return Ok(None);
        }
        ensure!(calls > 2, "only {calls} calls were seen");
        let kinds = self.side.kinds();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut tally = Tally {
            calls,
            failed: 0,
            aborted: 0,
        };
        for number in 0..faults {
            // Every call once by every kind first, where there are as many faults.
            let all = kinds.len() as u64;
            let (call, kind) = match faults >= calls * all && number < calls * all {
                true => (1 + number / all, kinds[(number % all) as usize]),
                false => (
                    rng.random_range(1..=calls),
                    kinds[rng.random_range(0..kinds.len())],
                ),
            };
            self.set(&old)?;
            let end = self.run(&format!("{call} {kind}"))?;
            tally.failed += u64::from(!end.status.success());
            tally.aborted += u64::from(end.status.signal() == Some(ABORT));
            self.check(&old, &new, &end, kind)
                .with_context(|| format!("call {call}, {kind}"))?;
            // What was ended there goes on, to the files of a run that was not.
            if end.status.code() == Some(CUT) && self.case.old.is_none() {
                let kept = self.out().join("checkpoint.safetensors").exists();
                let resume = if kept { " --resume" } else { "" };
                let again = format!("{}{resume}", self.case.new);
                self.program.run(self.folder, &again)?;
                let found = files_in(&self.out())?;
                ensure!(
                    found == new,
                    "call {call}, {kind}: it goes on to other files"
                );
            }
        }
        Ok(Some(tally))
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
            let path = out.join(name);
            fs::create_dir_all(path.parent().unwrap_or(&out))?;
            fs::write(path, bytes)?;
        }
        Ok(())
    }

    fn run(&self, fault: &str) -> Result<End> {
        let noted = self.folder.join("path");
        let _ = fs::remove_file(&noted);
        let mut command = self.program.command(self.folder, &self.case.new);
        command
            .env("LD_PRELOAD", self.library)
            .env("SELVEDGE_FAULT", format!("{} {fault}", self.side.name()))
            .env("SELVEDGE_FAULT_COUNT", self.folder.join("count"))
            .env("SELVEDGE_FAULT_FOLDER", self.folder)
            .env("SELVEDGE_FAULT_PATH", &noted)
            .env("RUST_BACKTRACE", "0")
            // One thread, so that the calls have an order.
            .env("RAYON_NUM_THREADS", "1")
            .stderr(Stdio::piped());
        let mut child = command.spawn()?;
        let mut pipe = child.stderr.take().context("what it says")?;
        let reader = thread::spawn(move || {
            let mut said = Vec::new();
            let _ = pipe.read_to_end(&mut said);
            String::from_utf8_lossy(&said).into_owned()
        });
        let started = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if started.elapsed() > PATIENCE {
                child.kill()?;
                bail!("{fault}: it hangs");
            }
            thread::sleep(Duration::from_millis(2));
        };
        let said = reader.join().unwrap_or_default();
        let path = fs::read_to_string(&noted).ok().map(PathBuf::from);
        Ok(End { status, said, path })
    }

    /// Checks what was said, that every file is the old or the new one, and that all are new where
    /// the command succeeded.
    fn check(&self, old: &Files, new: &Files, end: &End, kind: &str) -> Result<()> {
        let End { status, said, path } = end;
        ensure!(!said.contains("panicked"), "it panicked: {said}");
        let is_cut = kind == "cut" || kind == "drop";
        let is_aborted = kind == "enomem" && status.signal() == Some(ABORT);
        ensure!(
            status.code().is_some() || is_cut || is_aborted,
            "it ended with {status}: {said}"
        );
        ensure!(
            status.success() || is_cut || said.contains("error: ") || is_aborted,
            "it failed without a word: {said}"
        );
        if let (Some(path), false) = (path, status.success()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let name = final_name(&name);
            ensure!(said.contains(name), "{name} is not named: {said}");
        }
        if self.side == Side::Reads && kind != "eio" {
            ensure!(status.success(), "it did harm: {said}");
        }
        self.check_files(old, new, status.success(), is_cut || is_aborted)
    }

    fn check_files(&self, old: &Files, new: &Files, succeeded: bool, was_cut: bool) -> Result<()> {
        let found = match self.out().exists() {
            true => files_in(&self.out())?,
            false => Files::new(),
        };
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
        if self.case.holds_one_run {
            let has = |run: &Files| {
                found
                    .iter()
                    .any(|(name, bytes)| run.get(name) == Some(bytes))
            };
            ensure!(!has(old) || !has(new), "there are files of two runs");
        } else {
            for name in old.keys() {
                ensure!(found.contains_key(name), "{} is gone", name.display());
            }
        }
        ensure!(
            !succeeded || found == *new,
            "it succeeded with other files than the new"
        );
        Ok(())
    }
}

/// The name that a part will have: `a.gif` of `.a.gif.X1Y2Z3.part`.
fn final_name(name: &str) -> &str {
    let inner = name
        .strip_prefix('.')
        .and_then(|rest| rest.strip_suffix(".part"));
    inner
        .and_then(|rest| rest.rsplit_once('.'))
        .map_or(name, |(known, _)| known)
}

/// All files in `path` and its folders, by their names in it; none where there is no such folder.
fn files_in(path: &Path) -> Result<Files> {
    let mut found = Files::new();
    let mut open = vec![path.to_owned()];
    while let Some(folder) = open.pop().filter(|folder| folder.exists()) {
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

#[cfg(test)]
mod tests {
    use super::final_name;

    #[test]
    fn a_part_has_the_name_of_its_file() {
        assert_eq!(final_name(".a.gif.X1Y2Z3.part"), "a.gif");
        assert_eq!(final_name("a.gif"), "a.gif");
    }
}

//! Damaged files for every reader: none may panic, hang, take much memory, say pages, or accept
//! what does not hold.
//!
//! Input `n` of a target depends on the seed, the target and `n` alone, so that a finding is
//! repeated by its number. A stack that overflows or a process that is killed leaves its input in
//! the folder of findings, too.

mod bench;
mod examples;
mod guided;
mod mutate;
mod readers;
mod seeds;
mod targets;
mod zip;

use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use self::bench::Bench;
use self::examples::written_examples;
pub use self::guided::Guided;
use self::seeds::Seeds;
pub(crate) use self::seeds::{SCENE, TRAINING};
use self::targets::{TARGETS, Target};
use crate::arguments::Arguments;
use crate::program::Program;

/// Time of the processor that one input may take.
const PATIENCE: Duration = Duration::from_secs(5);
/// Length that the text of an error may have over three times that of the input with its control
/// characters escaped `[bytes]`: the program shortens what quotes a whole input, but nothing may
/// grow.
const LONGEST_TEXT: usize = 4096;
/// Growth of memory that one input may cause `[kB]`.
const MOST_MEMORY: u64 = 512 << 10;
/// Inputs between two looks at the clock and at memory.
const BATCH: u64 = 64;
/// Findings after which a target is given up.
const MOST_FINDINGS: usize = 5;

/// The message of the last panic.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Inputs of one target so far.
#[derive(Default)]
struct Tally {
    inputs: u64,
    accepted: u64,
    /// Beginnings of the refusals, which tell how far readers were reached.
    refusals: BTreeMap<String, u64>,
    findings: Vec<String>,
    seconds: f64,
}

/// The state of one run of a target.
struct Course<'a> {
    target: &'a Target,
    examples: Vec<Vec<u8>>,
    next: u64,
    tally: Tally,
}

/// Runs the targets that `options` ask for; returns false where something was found.
///
/// # Errors
/// Options that make no sense, or a program that is missing.
pub(crate) fn run(options: &[String]) -> Result<bool> {
    let pairs = ["--for", "--inputs", "--target", "--seed", "--from"];
    let options = Arguments::parse(options, &pairs, &["--list"])?;
    if options.has("--list") {
        TARGETS
            .iter()
            .for_each(|target| println!("{}", target.name));
        return Ok(true);
    }
    let seed = options.number("--seed")?.unwrap_or(1);
    let first = options.number("--from")?.unwrap_or(0);
    let inputs = options.number("--inputs")?;
    let span = options.span("--for")?.unwrap_or(Duration::from_secs(30));
    let folder = tempfile::tempdir().context("a folder to work in")?;
    let [made, bench] = ["made", "bench"].map(|name| folder.path().join(name));
    fs::create_dir(&made)?;
    fs::create_dir(&bench)?;
    let seeds = Seeds::make(&Program::find()?, &made)?;
    let bench = Bench::new(&bench, &seeds)?;
    let mut courses = courses(&options.all("--target"), &seeds, &bench, first)?;
    let findings = Path::new("target/fuzz");
    fs::create_dir_all(findings)?;
    quiet_panics();
    let end = Instant::now() + span;
    loop {
        let mut active = 0;
        for course in &mut courses {
            let is_done = match inputs {
                Some(count) => course.tally.inputs >= count,
                None => Instant::now() >= end,
            };
            if is_done || course.tally.findings.len() >= MOST_FINDINGS {
                continue;
            }
            active += 1;
            let left = inputs.map_or(BATCH, |count| (count - course.tally.inputs).min(BATCH));
            course.advance(&bench, seed, left, findings)?;
        }
        if active == 0 {
            break;
        }
    }
    let _ = std::panic::take_hook();
    Ok(report(&courses, seed))
}

fn courses<'a>(
    wanted: &[&str],
    seeds: &Seeds,
    bench: &Bench,
    first: u64,
) -> Result<Vec<Course<'a>>> {
    for name in wanted {
        if !TARGETS.iter().any(|target| target.name == *name) {
            bail!("there is no target {name:?}; --list names them");
        }
    }
    let chosen = TARGETS
        .iter()
        .filter(|target| wanted.is_empty() || wanted.contains(&target.name));
    chosen
        .map(|target| {
            let mut examples = target.examples(seeds)?;
            examples.extend(written_examples(target.name, bench)?);
            Ok(Course {
                target,
                examples,
                next: first,
                tally: Tally::default(),
            })
        })
        .collect()
}

/// Names of all targets.
pub(crate) fn names() -> [&'static str; TARGETS.len()] {
    TARGETS.map(|target| target.name)
}

/// Keeps the message of a panic instead of printing it.
fn quiet_panics() {
    std::panic::set_hook(Box::new(|info| {
        let mut last = PANIC.lock().unwrap_or_else(PoisonError::into_inner);
        *last = info.to_string();
    }));
}

impl Course<'_> {
    /// Tries `count` inputs.
    fn advance(&mut self, bench: &Bench, seed: u64, count: u64, findings: &Path) -> Result<()> {
        let started = Instant::now();
        for _ in 0..count {
            let number = self.next;
            let input = self.input(seed, number);
            self.next += 1;
            self.tally.inputs += 1;
            if let Some(finding) = self.trial(bench, &input)? {
                let name = format!("{}-{seed}-{number}", self.target.name);
                let path = findings.join(&name);
                fs::write(&path, &input)?;
                println!("{name}: {finding}\n  kept as {}", path.display());
                self.tally.findings.push(finding);
            }
        }
        self.tally.seconds += started.elapsed().as_secs_f64();
        Ok(())
    }

    /// Input `number`: the examples as they are first, then damaged ones.
    fn input(&self, seed: u64, number: u64) -> Vec<u8> {
        if let Some(whole) = self
            .examples
            .get(usize::try_from(number).unwrap_or(usize::MAX))
        {
            return whole.clone();
        }
        let name = u64::from(crc32fast::hash(self.target.name.as_bytes()));
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ name << 32);
        rng.set_stream(number);
        let [one, other] = [0; 2].map(|_| rng.random_range(0..self.examples.len()));
        mutate::mutate(
            self.target.make,
            &self.examples[one],
            &self.examples[other],
            &mut rng,
        )
    }

    /// Gives one input to the reader. Returns what must not be.
    fn trial(&mut self, bench: &Bench, input: &[u8]) -> Result<Option<String>> {
        let path: PathBuf = bench.folder.join(self.target.file.unwrap_or("input"));
        if self.target.file.is_some() {
            fs::write(&path, input).with_context(|| path.display().to_string())?;
        }
        let (before, started) = (peak_memory(), processor_time());
        let outcome = catch_unwind(AssertUnwindSafe(|| (self.target.read)(bench, &path, input)));
        let elapsed = processor_time().saturating_sub(started);
        let grown = peak_memory().saturating_sub(before);
        if elapsed > PATIENCE {
            return Ok(Some(format!("took {:.1} s", elapsed.as_secs_f64())));
        }
        if grown > MOST_MEMORY {
            return Ok(Some(format!("took {} MB more memory", grown >> 10)));
        }
        match outcome {
            Err(_) => {
                let last = PANIC.lock().unwrap_or_else(PoisonError::into_inner);
                Ok(Some(last.replace('\n', " ")))
            }
            Ok(Err(text)) if is_too_long(&text, input) => {
                let start: String = text.chars().take(120).collect();
                Ok(Some(format!("an error of {} bytes: {start}…", text.len())))
            }
            Ok(Err(text)) => {
                *self.tally.refusals.entry(kind_of(&text)).or_default() += 1;
                Ok(None)
            }
            Ok(Ok(())) => {
                self.tally.accepted += 1;
                Ok(None)
            }
        }
    }
}

fn is_too_long(text: &str, input: &[u8]) -> bool {
    text.len() > LONGEST_TEXT + 3 * input.escape_ascii().count()
}

/// The text of a refusal without numbers and names, to tell kinds of refusals apart.
fn kind_of(text: &str) -> String {
    let words = text
        .split_whitespace()
        .filter(|word| word.chars().all(|c| c.is_ascii_lowercase()));
    words.take(12).collect::<Vec<_>>().join(" ")
}

/// Time that this process had of all processors, in steps of 10 ms, so that a busy machine gives no
/// findings; 0 where the system does not tell.
fn processor_time() -> Duration {
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program stands in brackets and may have spaces.
    let rest = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = rest.split_whitespace().skip(11).take(2);
    let ticks: u64 = ticks.filter_map(|word| word.parse::<u64>().ok()).sum();
    Duration::from_millis(10 * ticks)
}

/// The most memory that this process has had `[kB]`; 0 where the system does not tell.
fn peak_memory() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let number = line.and_then(|rest| rest.split_whitespace().next()?.parse().ok());
    number.unwrap_or(0)
}

/// Prints the table of a run. Returns true where nothing was found.
fn report(courses: &[Course<'_>], seed: u64) -> bool {
    println!("seed {seed}\n");
    println!("| target | inputs | accepted | kinds of refusals | findings | seconds |");
    println!("|---|---|---|---|---|---|");
    for course in courses {
        let Tally {
            inputs,
            accepted,
            refusals,
            findings,
            seconds,
        } = &course.tally;
        let (name, kinds, found) = (course.target.name, refusals.len(), findings.len());
        println!("| {name} | {inputs} | {accepted} | {kinds} | {found} | {seconds:.0} |");
    }
    let all = |of: fn(&Tally) -> u64| courses.iter().map(|course| of(&course.tally)).sum::<u64>();
    let found = all(|tally| tally.findings.len() as u64);
    // A target whose examples are refused tries nothing.
    let idle = courses.iter().filter(|course| course.tally.accepted == 0);
    let idle: Vec<&str> = idle.map(|course| course.target.name).collect();
    if !idle.is_empty() {
        println!("\nnothing was accepted: {}", idle.join(", "));
    }
    println!("\n{} inputs, {found} findings", all(|tally| tally.inputs));
    found == 0 && idle.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_of_the_processor_goes_on_with_work_alone() {
        let started = (processor_time(), Instant::now());
        while processor_time() < started.0 + Duration::from_millis(50) {
            assert!(started.1.elapsed() < Duration::from_secs(60));
        }
        let before = processor_time();
        std::thread::sleep(Duration::from_millis(200));
        // Other tests of this program may run beside.
        assert!(processor_time() >= before);
    }
}

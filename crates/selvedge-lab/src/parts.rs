//! Parts of an evaluation or of a stress test: the runs of one shard in a file that says which call
//! they are of, and all of them put together again.

use std::cmp::Reverse;
use std::io::Write;
use std::path::{Path, PathBuf};

use selvedge_cluster::Shard;
use selvedge_data::{WriteError, write_atomically};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::evaluation::Timing;

const FORMAT: &str = "selvedge-part";
const VERSION: u32 = 1;

/// Parts that cannot be put together.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum PartsError {
    #[error("{}: could not be read: {source}", path.display())]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: is no part of an evaluation or a stress test: {problem}", path.display())]
    NoPart { path: PathBuf, problem: String },
    #[error("{}: is a part of another call: give the models, data and options of this one", path.display())]
    OtherCall { path: PathBuf },
    #[error("{}: is part {part}, and {} is part {other}: take parts of one number, each once", path.display(), first.display())]
    OtherCount {
        path: PathBuf,
        part: String,
        first: PathBuf,
        other: String,
    },
    #[error("parts {} are missing: name their files, too, or make them", missing.join(", "))]
    Missing { missing: Vec<String> },
    #[error("{}: has {found} runs, part {part} of these has {expected}: make it again", path.display())]
    Runs {
        path: PathBuf,
        part: String,
        found: usize,
        expected: usize,
    },
}

/// A part as it is kept.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartFile<T> {
    format: String,
    version: u32,
    part: String,
    /// Hash of all that the runs depend on.
    call: String,
    runs: Vec<T>,
    #[serde(default)]
    timings: Vec<Timing>,
}

/// A hash of a call, in words and in the contents of its files.
#[must_use]
pub fn call_of(words: &str, files: &[Vec<u8>]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in std::iter::once(words.as_bytes()).chain(files.iter().map(Vec::as_slice)) {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    hasher.finalize().to_hex().to_string()
}

/// Writes the runs of `shard`.
///
/// # Errors
/// [`WriteError`].
pub fn write<T: Serialize>(
    path: &Path,
    shard: Shard,
    call: String,
    runs: Vec<T>,
    timings: Vec<Timing>,
) -> Result<(), WriteError> {
    let part = PartFile {
        format: FORMAT.to_owned(),
        version: VERSION,
        part: shard.to_string(),
        call,
        runs,
        timings,
    };
    write_atomically(path, |out| {
        serde_json::to_writer(&mut *out, &part)?;
        out.write_all(b"\n")
    })
}

/// Reads the parts of `call` and puts their runs in the order of one run of all.
///
/// # Errors
/// [`PartsError`] names the file that does not fit, or the parts that are missing.
pub fn read<T: DeserializeOwned>(
    paths: &[PathBuf],
    call: &str,
) -> Result<(Vec<T>, Vec<Timing>), PartsError> {
    let mut parts: Vec<(Shard, &PathBuf, PartFile<T>)> = Vec::with_capacity(paths.len());
    for path in paths {
        let (shard, part) = read_part(path, call)?;
        if let Some((other, first, _)) = parts
            .iter()
            .find(|(other, ..)| other.count() != shard.count() || *other == shard)
        {
            return Err(PartsError::OtherCount {
                path: path.clone(),
                part: shard.to_string(),
                first: (*first).clone(),
                other: other.to_string(),
            });
        }
        parts.push((shard, path, part));
    }
    parts.sort_by_key(|(shard, ..)| shard.number());
    let count = parts.first().map_or(1, |(shard, ..)| shard.count());
    let is_there = |number: usize| parts.iter().any(|(shard, ..)| shard.number() == number);
    let missing = (1..=count).filter(|number| !is_there(*number));
    let missing: Vec<String> = missing.map(|number| format!("{number}/{count}")).collect();
    if !missing.is_empty() {
        return Err(PartsError::Missing { missing });
    }
    interleaved(parts)
}

fn read_part<T: DeserializeOwned>(
    path: &Path,
    call: &str,
) -> Result<(Shard, PartFile<T>), PartsError> {
    let owned = || path.to_owned();
    let text = selvedge_data::read_text(path).map_err(|source| PartsError::Read {
        path: owned(),
        source,
    })?;
    let no_part = |problem: String| PartsError::NoPart {
        path: owned(),
        problem,
    };
    let part: PartFile<T> =
        serde_json::from_str(&text).map_err(|error| no_part(error.to_string()))?;
    if part.format != FORMAT || part.version != VERSION {
        let (format, version) = (&part.format, part.version);
        return Err(no_part(format!(
            "format {format:?}, version {version}, not {FORMAT:?}, version {VERSION}"
        )));
    }
    let shard = part.part.parse();
    let shard: Shard = shard.map_err(|error| no_part(format!("{error}")))?;
    if part.call != call {
        return Err(PartsError::OtherCall { path: owned() });
    }
    Ok((shard, part))
}

/// The runs of all shards, one of each in turn.
fn interleaved<T>(
    parts: Vec<(Shard, &PathBuf, PartFile<T>)>,
) -> Result<(Vec<T>, Vec<Timing>), PartsError> {
    let jobs = likely_jobs(&parts);
    let (mut queues, mut timings) = (Vec::new(), Vec::new());
    for (shard, path, part) in parts {
        let expected = share(jobs, shard);
        if part.runs.len() != expected {
            return Err(PartsError::Runs {
                path: path.clone(),
                part: shard.to_string(),
                found: part.runs.len(),
                expected,
            });
        }
        timings.extend(part.timings);
        queues.push(part.runs.into_iter());
    }
    let count = queues.len().max(1);
    let runs = (0..jobs).filter_map(|job| queues[job % count].next());
    Ok((runs.collect(), timings))
}

/// Runs of all parts: the number that most of them fit, the smallest of several.
fn likely_jobs<T>(parts: &[(Shard, &PathBuf, PartFile<T>)]) -> usize {
    let fewest = |shard: Shard, runs: usize| match runs {
        0 => 0,
        _ => (runs - 1) * shard.count() + shard.number(),
    };
    let fitting = |jobs: usize| {
        let fits = |(shard, _, part): &&(Shard, &PathBuf, PartFile<T>)| {
            share(jobs, *shard) == part.runs.len()
        };
        parts.iter().filter(fits).count()
    };
    let candidates = parts
        .iter()
        .map(|(shard, _, part)| fewest(*shard, part.runs.len()));
    let best = candidates.max_by_key(|&jobs| (fitting(jobs), Reverse(jobs)));
    best.unwrap_or(0)
}

/// Runs of a shard where there are `jobs` in all.
fn share(jobs: usize, shard: Shard) -> usize {
    (jobs + shard.count() - shard.number()) / shard.count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_what_the_shard_has() {
        for jobs in 0..20 {
            for number in 1..=4 {
                let shard: Shard = format!("{number}/4").parse().unwrap();
                let counted = (0..jobs).filter(|job| shard.has(*job)).count();
                assert_eq!(share(jobs, shard), counted);
            }
        }
    }

    #[test]
    fn parts_come_back_in_order_and_only_all_of_one_call() {
        let folder = tempfile::tempdir().unwrap();
        let call = call_of("words", &[vec![1], vec![2]]);
        assert_ne!(call, call_of("words", &[vec![1, 2]]));
        let jobs: Vec<u32> = (0..8).map(|job| 10 * job).collect();
        let mut paths = Vec::new();
        for number in [2, 3, 1] {
            let shard: Shard = format!("{number}/3").parse().unwrap();
            let own = jobs.iter().enumerate().filter(|(job, _)| shard.has(*job));
            let path = folder.path().join(format!("{number}.json"));
            let runs = own.map(|(_, run)| *run).collect();
            write(&path, shard, call.clone(), runs, Vec::new()).unwrap();
            paths.push(path);
        }
        assert_eq!(read::<u32>(&paths, &call).unwrap().0, jobs);
        let error =
            |paths: &[PathBuf], call: &str| read::<u32>(paths, call).unwrap_err().to_string();
        assert!(error(&paths[..2], &call).contains("parts 1/3 are missing"));
        assert!(error(&paths, "other").contains("another call"));
        let twice = [paths[0].clone(), paths[0].clone()];
        assert!(error(&twice, &call).contains("each once"));
        let text = std::fs::read_to_string(&paths[1]).unwrap();
        std::fs::write(&paths[1], text.replace("[20,", "[20,20,20,")).unwrap();
        assert!(error(&paths, &call).contains("has 4 runs, part 3/3"));
        std::fs::write(&paths[1], "{}").unwrap();
        assert!(error(&paths, &call).contains("3.json: is no part"));
    }
}

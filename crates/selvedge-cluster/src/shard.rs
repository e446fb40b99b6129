//! Shards: runs that share the jobs beforehand and never meet, as the array jobs of a cluster do.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// One of several runs that share the jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    count: usize,
}

/// A text that names no shard.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0:?} is no shard: write I/N, as 2/8 for the second of eight, I from 1 to N")]
pub struct ShardError(String);

impl Shard {
    /// Number of the shard, from 1.
    pub fn number(self) -> usize {
        self.number
    }

    /// Number of shards.
    pub fn count(self) -> usize {
        self.count
    }

    /// Returns true where job `job`, from 0, belongs to this shard: every N-th does, since jobs in
    /// a row are alike.
    pub fn has(self, job: usize) -> bool {
        job % self.count == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parsed = text.split_once('/').and_then(|(number, count)| {
            let (number, count) = (number.parse().ok()?, count.parse().ok()?);
            (1 <= number && number <= count).then_some(Self { number, count })
        });
        parsed.ok_or_else(|| ShardError(text.to_owned()))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_belongs_to_one_shard() {
        for count in 1..9 {
            let shards: Vec<Shard> = (1..=count)
                .map(|number| format!("{number}/{count}").parse().expect("a shard"))
                .collect();
            for job in 0..40 {
                let owners = shards.iter().filter(|shard| shard.has(job)).count();
                assert_eq!(owners, 1, "job {job} of {count}");
            }
        }
    }

    #[test]
    fn what_is_no_shard_is_said() {
        for text in ["", "3", "0/4", "5/4", "1/0", "a/b", "1/2/3", "-1/2"] {
            let error = text.parse::<Shard>().expect_err(text);
            assert!(error.to_string().contains("write I/N"), "{error}");
        }
    }
}

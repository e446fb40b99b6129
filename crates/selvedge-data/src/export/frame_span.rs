//! A choice of frames of a trajectory: from one to another, every so many.

use std::str::FromStr;

use crate::formats::file_error::Problem;

/// A span of frames: from one to another, both included, and every so many of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSpan {
    /// The first one; the first there is, if there is none.
    pub first: Option<usize>,
    /// The last one; the last there is, if there is none.
    pub last: Option<usize>,
    /// Every so many of them, from the first.
    pub every: usize,
}

impl Default for FrameSpan {
    fn default() -> Self {
        Self {
            first: None,
            last: None,
            every: 1,
        }
    }
}

impl FromStr for FrameSpan {
    type Err = Problem;

    /// Reads `20..80`, `20..`, `..80` or `20`; every one of them.
    fn from_str(text: &str) -> Result<Self, Problem> {
        let wrong = || {
            Problem(format!(
                "{text:?} says no frames: write 20..80 (both included), 20.., ..80, or one number"
            ))
        };
        let number = |part: &str| match part.trim() {
            "" => Ok(None),
            digits => digits.parse().map(Some).map_err(|_| wrong()),
        };
        let (first, last) = match text.split_once("..") {
            Some((first, last)) => (number(first)?, number(last)?),
            None => {
                let only = number(text)?.ok_or_else(wrong)?;
                (Some(only), Some(only))
            }
        };
        Ok(Self {
            first,
            last,
            every: 1,
        })
    }
}

impl FrameSpan {
    /// The numbers of the frames, of a run of `count` (at least one).
    ///
    /// # Errors
    /// [`Problem`] where there are none, or one that the run does not have.
    pub fn of(&self, count: usize) -> Result<Vec<usize>, Problem> {
        let end = count.saturating_sub(1);
        let (first, last) = (self.first.unwrap_or(0), self.last.unwrap_or(end));
        if let Some(frame) = [first, last].into_iter().find(|&frame| frame > end) {
            return Err(Problem(format!(
                "frame {frame} was asked for, but the run has the frames 0 to {end}"
            )));
        }
        if first > last {
            return Err(Problem(format!(
                "frames {first}..{last}: there are none, for the last is before the first"
            )));
        }
        if self.every == 0 {
            let problem = "every 0th frame was asked for: 1 is every frame";
            return Err(Problem(problem.to_owned()));
        }
        Ok((first..=last).step_by(self.every).collect())
    }
}

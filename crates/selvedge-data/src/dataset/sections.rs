//! Sections: the frames of training trajectories to learn from, and the samples in them.
//!
//! A sample needs the frame before, the current frame and the one to predict; a section of n frames
//! gives n - 2. The sections of Libao et al. 2023 leave out most of the long rest at the end.

use serde::{Deserialize, Serialize};

use crate::formats::file_error::Problem;

/// Frames `start..end` of a training trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// Number of the trajectory in the training split.
    pub trajectory: usize,
    /// First frame.
    pub start: usize,
    /// One past the last frame.
    pub end: usize,
}

/// Three frames in a row; the third is the one to predict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sample {
    /// Number of the trajectory in the training split.
    pub trajectory: usize,
    /// The current frame; the one before it and the one after it are in the same section.
    pub current: usize,
}

/// Rule by which sections are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SectionRule {
    /// The paper's 42 sections of its 16 training trajectories, in frames of 1/60 s.
    Paper,
    /// Every frame of every trajectory.
    Whole,
}

/// Frames that make a sample.
pub(crate) const SAMPLE_FRAMES: usize = 3;

/// From rest into motion, and from motion to rest: of every trajectory.
const OF_ALL: [(usize, usize); 2] = [(50, 162), (650, 802)];
/// Steady motion: of the trajectories that are not another one's opposite.
const STEADY: (usize, usize) = (250, 532);
/// Rest: of the first trajectory.
const REST: [(usize, usize); 2] = [(0, 52), (1100, 1202)];

const FIRST: &str = "forward";
const NOT_OPPOSITE: [&str; 8] = [
    "forward",
    "side",
    "updown",
    "xy",
    "yz",
    "xz",
    "xyz",
    "rotation-ccw",
];

impl Section {
    /// The samples of the section, in order of time.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + use<> {
        let trajectory = self.trajectory;
        (self.start + 1..self.end.saturating_sub(1)).map(move |current| Sample {
            trajectory,
            current,
        })
    }
}

impl SectionRule {
    /// The sections of training trajectories with these motions and frame counts, in order of
    /// trajectory and start.
    ///
    /// # Errors
    /// [`Problem`] when a trajectory is shorter than a section of it.
    pub fn sections(self, trajectories: &[(&str, usize)]) -> Result<Vec<Section>, Problem> {
        let mut sections = Vec::new();
        for (trajectory, &(motion, frames)) in trajectories.iter().enumerate() {
            let ranges = self.ranges(motion, frames);
            let last = ranges.iter().map(|range| range.1).max().unwrap_or(0);
            let needed = last.max(SAMPLE_FRAMES);
            if needed > frames {
                return Err(Problem(format!(
                    "trajectory {motion} has {frames} frames, but the section rule needs at least {needed}: record a longer one, or leave it out"
                )));
            }
            sections.extend(ranges.into_iter().map(|(start, end)| Section {
                trajectory,
                start,
                end,
            }));
        }
        Ok(sections)
    }

    fn ranges(self, motion: &str, frames: usize) -> Vec<(usize, usize)> {
        match self {
            Self::Whole => vec![(0, frames)],
            Self::Paper => {
                let mut ranges = OF_ALL.to_vec();
                if NOT_OPPOSITE.contains(&motion) {
                    ranges.push(STEADY);
                }
                if motion == FIRST {
                    ranges.extend(REST);
                }
                ranges.sort_unstable();
                ranges
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_shorter_than_three_frames_has_no_sample() {
        for end in 0..3 {
            let section = Section {
                trajectory: 0,
                start: 0,
                end,
            };
            assert_eq!(section.samples().count(), 0, "{end}");
        }
    }
}

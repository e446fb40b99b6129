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
    /// Number of frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.end.saturating_sub(self.start)
    }

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
    use selvedge_cloth::motion::named;

    fn training() -> Vec<(&'static str, usize)> {
        named::training().into_iter().map(|n| (n, 1261)).collect()
    }

    #[test]
    fn the_paper_has_42_sections_and_6550_samples() {
        let sections = SectionRule::Paper.sections(&training()).unwrap();
        assert_eq!(sections.len(), 42);
        let samples: usize = sections.iter().map(|s| s.samples().count()).sum();
        assert_eq!(samples, 6550);
        let sorted = sections.is_sorted_by_key(|s| (s.trajectory, s.start));
        assert!(sorted);
    }

    #[test]
    fn whole_trajectories_give_all_samples_but_the_two_ends() {
        let sections = SectionRule::Whole.sections(&[("a", 5), ("b", 3)]).unwrap();
        let samples: Vec<Sample> = sections.iter().flat_map(Section::samples).collect();
        let expected = [(0, 1), (0, 2), (0, 3), (1, 1)].map(|(trajectory, current)| Sample {
            trajectory,
            current,
        });
        assert_eq!(samples, expected);
    }

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

    #[test]
    fn a_trajectory_that_is_too_short_is_named() {
        let error = SectionRule::Paper
            .sections(&[("forward", 900)])
            .unwrap_err();
        let expected =
            "trajectory forward has 900 frames, but the section rule needs at least 1202";
        assert!(error.to_string().starts_with(expected), "{error}");
        let error = SectionRule::Whole.sections(&[("a", 2)]).unwrap_err();
        let expected = "trajectory a has 2 frames, but the section rule needs at least 3";
        assert!(error.to_string().starts_with(expected), "{error}");
    }
}

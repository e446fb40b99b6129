//! Errors over k steps from the truth: a run starts at a true frame, knows the true frames before
//! it, and is fed with its own output from then on.
//!
//! Over k steps: √(mean over starts, the k frames after each and vertices of |p - p̂|²), as in
//! MeshGraphNets (Pfaff et al. 2021); at the last of them: the same over the k-th frame alone. All k
//! share their starts, spread evenly over where the longest run still fits. A rival that knows no
//! truth is measured on the same frames of its one whole run.

use glam::Vec3;
use selvedge_data::{Frames, Trajectory, metrics};
use serde::{Deserialize, Serialize};

use super::Curves;

/// Which k, and from how many starts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Horizons {
    /// Numbers of steps, rising, each at least 1.
    pub(crate) steps: Vec<usize>,
    /// Starts per trajectory, at least 1.
    pub(crate) starts: usize,
}

/// The error over k steps along one trajectory, or its mean over several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Horizon {
    /// k.
    pub(crate) steps: usize,
    /// Over all k frames `[m]`.
    pub(crate) position_rmse: f64,
    /// At the last of them `[m]`.
    pub(crate) last_position_rmse: f64,
    /// Over all k frames `[m]`.
    pub(crate) edge_length_rmse: f64,
}

/// Squares of the errors of each frame after a start `[m²]`, summed over starts.
struct Sums {
    position: Vec<f64>,
    edge_length: Vec<f64>,
    starts: usize,
}

impl Horizons {
    /// Each number of steps once.
    pub(crate) fn new(steps: impl Iterator<Item = usize>, starts: usize) -> Self {
        let mut steps: Vec<usize> = steps.collect();
        steps.sort_unstable();
        steps.dedup();
        Self { steps, starts }
    }

    /// Steps of all runs along a trajectory of so many frames.
    pub(crate) fn steps_in(&self, frames: usize) -> usize {
        let longest = self.longest(frames);
        longest * self.starts_in(frames).len()
    }

    /// The longest run that fits into `frames`; 0 where none does.
    fn longest(&self, frames: usize) -> usize {
        let fits = |steps: &&usize| **steps < frames;
        self.steps.iter().filter(fits).max().copied().unwrap_or(0)
    }

    /// First frames of the runs, rising: from the first frame to the last that leaves room for the
    /// longest run; the middle of these where there is one start.
    fn starts_in(&self, frames: usize) -> Vec<usize> {
        let longest = self.longest(frames);
        if longest == 0 {
            return Vec::new();
        }
        let last = frames - 1 - longest;
        match self.starts.min(last + 1) {
            0 => Vec::new(),
            1 => vec![last / 2],
            count => (0..count).map(|k| k * last / (count - 1)).collect(),
        }
    }

    /// The errors of runs that `run` makes: from a true frame, so many steps; its positions `[m]`,
    /// `[frames * vertices]`, begin with that frame and may end early.
    ///
    /// # Errors
    /// What `run` says.
    pub(crate) fn over_true_starts(
        &self,
        truth: &Trajectory,
        mut run: impl FnMut(usize, usize) -> anyhow::Result<Vec<Vec3>>,
    ) -> anyhow::Result<Vec<Horizon>> {
        let frames = truth.frame_count();
        let longest = self.longest(frames);
        let mut sums = Sums::new(longest);
        for start in self.starts_in(frames) {
            let positions = run(start, longest)?;
            let after = truth.frames().last(frames - start);
            let run = Frames::new(&positions, truth.vertex_count())?;
            let position = metrics::per_frame_rmse(after, run)?;
            let edges = metrics::per_frame_edge_length_rmse(after, run, truth.topology())?;
            sums.add(&position[1..], &edges[1..]);
        }
        Ok(self.errors(&sums))
    }

    /// The errors on the same frames of one whole run.
    pub(crate) fn of_whole_run(&self, curves: &Curves, frames: usize) -> Vec<Horizon> {
        let longest = self.longest(frames);
        let mut sums = Sums::new(longest);
        for start in self.starts_in(frames) {
            let after = |curve: &[f64]| {
                let reached = curve.len().min(start + longest + 1);
                curve.get(start + 1..reached).unwrap_or_default().to_vec()
            };
            let edges = after(&curves.edge_length_rmse);
            sums.add(&after(&curves.position_rmse), &edges);
        }
        self.errors(&sums)
    }

    fn errors(&self, sums: &Sums) -> Vec<Horizon> {
        let reached = sums.position.len();
        let kept = self.steps.iter().filter(|steps| **steps <= reached);
        let count = sums.starts as f64;
        kept.map(|&steps| {
            let over = |squares: &[f64]| {
                (squares[..steps].iter().sum::<f64>() / (count * steps as f64)).sqrt()
            };
            Horizon {
                steps,
                position_rmse: over(&sums.position),
                last_position_rmse: (sums.position[steps - 1] / count).sqrt(),
                edge_length_rmse: over(&sums.edge_length),
            }
        })
        .collect()
    }
}

impl Sums {
    fn new(longest: usize) -> Self {
        Self {
            position: vec![0.0; longest],
            edge_length: vec![0.0; longest],
            starts: 0,
        }
    }

    /// Adds a run. Where it ends early, all end there: a mean over some of the starts would be one
    /// over the easier ones.
    fn add(&mut self, position: &[f64], edge_length: &[f64]) {
        let add = |sums: &mut Vec<f64>, errors: &[f64]| {
            sums.truncate(errors.len());
            sums.iter_mut().zip(errors).for_each(|(s, e)| *s += e * e);
        };
        add(&mut self.position, position);
        add(&mut self.edge_length, edge_length);
        self.starts += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_spread_evenly_and_leave_room_for_the_longest_run() {
        let horizons = |steps: &[usize], starts| Horizons {
            steps: steps.to_vec(),
            starts,
        };
        let five = horizons(&[1, 20], 5);
        assert_eq!(five.starts_in(61), [0, 10, 20, 30, 40]);
        assert_eq!(five.steps_in(61), 100);
        // More starts than frames, a run that does not fit, one start, none.
        assert_eq!(horizons(&[5], 9).starts_in(8), [0, 1, 2]);
        assert_eq!(five.starts_in(20), [0, 4, 9, 13, 18]);
        assert_eq!(horizons(&[20], 1).starts_in(61), [20]);
        assert!(horizons(&[20], 3).starts_in(20).is_empty());
        assert!(horizons(&[], 3).starts_in(20).is_empty());
    }

    #[test]
    fn an_error_that_grows_with_the_frames_has_its_closed_form() {
        // Frame f of the whole run is off by 2 f and its edges by f.
        let curves = Curves {
            position_rmse: (0..10).map(|f| 2.0 * f64::from(f)).collect(),
            edge_length_rmse: (0..10).map(f64::from).collect(),
            largest_strain: Vec::new(),
        };
        let horizons = Horizons {
            steps: vec![1, 2, 5],
            starts: 2,
        };
        // The longest of 5 leaves starts 0 and 4.
        let errors = horizons.of_whole_run(&curves, 10);
        let rms = |frames: &[f64]| {
            let squares: f64 = frames.iter().map(|f| f * f).sum();
            (squares / frames.len() as f64).sqrt()
        };
        let expected = [
            (1, rms(&[1.0, 5.0]), rms(&[1.0, 5.0])),
            (2, rms(&[1.0, 2.0, 5.0, 6.0]), rms(&[2.0, 6.0])),
            (
                5,
                rms(&[1.0, 2.0, 3.0, 4.0, 5.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
                rms(&[5.0, 9.0]),
            ),
        ];
        for (error, (steps, over, last)) in errors.iter().zip(expected) {
            assert_eq!(error.steps, steps);
            // A handful of roundings of numbers of order 10.
            assert!((error.position_rmse - 2.0 * over).abs() < 1e-14);
            assert!((error.last_position_rmse - 2.0 * last).abs() < 1e-14);
            assert!((error.edge_length_rmse - over).abs() < 1e-14);
        }
        // A run that ended after frame 6: from start 4 only two steps were reached.
        let mut short = curves;
        short.position_rmse.truncate(7);
        short.edge_length_rmse.truncate(7);
        let errors = horizons.of_whole_run(&short, 10);
        let steps: Vec<usize> = errors.iter().map(|error| error.steps).collect();
        assert_eq!(steps, [1, 2]);
    }
}

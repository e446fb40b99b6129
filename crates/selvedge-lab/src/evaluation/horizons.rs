//! Errors over k steps from the truth: a run starts at a true frame, knows the true frames before
//! it, and is fed with its own output from then on.
//!
//! Over k steps: √(mean over starts, the k frames after each and vertices of |p - p̂|²), as in
//! MeshGraphNets (Pfaff et al. 2021); at the last of them: the same over the k-th frame alone. Each
//! k has starts of its own, spread evenly from the first frame to the last that leaves room for k,
//! so that its error does not depend on which other k are asked for. A rival that knows no truth is
//! measured on the same frames of its one whole run.

use std::convert::Infallible;

use glam::Vec3;
use selvedge_data::{Frames, Trajectory, metrics};
use serde::{Deserialize, Serialize};

use super::Curves;
use super::measures::MeasureError;

/// Numbers k of steps, and the starts of each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizons {
    /// Numbers of steps, rising, each at least 1.
    pub steps: Vec<usize>,
    /// Starts per trajectory, at least 1.
    pub starts: usize,
}

/// The error over k steps along one trajectory, or its mean over several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizon {
    /// k.
    pub steps: usize,
    /// Over all k frames `[m]`.
    pub position_rmse: f64,
    /// At the last of them `[m]`.
    pub last_position_rmse: f64,
    /// Over all k frames `[m]`.
    pub edge_length_rmse: f64,
}

/// Squares of errors, summed over frames and starts.
#[derive(Default)]
struct Sums {
    /// `[m²]`.
    position: f64,
    /// Of the last frames `[m²]`.
    last_position: f64,
    /// `[m²]`.
    edge_length: f64,
    starts: usize,
}

impl Horizons {
    /// Numbers of steps where nobody asks for others.
    pub const USUAL: [usize; 7] = [1, 5, 10, 20, 50, 100, 200];

    /// Each number of steps once.
    pub fn new(steps: impl Iterator<Item = usize>, starts: usize) -> Self {
        let mut steps: Vec<usize> = steps.collect();
        steps.sort_unstable();
        steps.dedup();
        Self { steps, starts }
    }

    /// Steps of all runs along a trajectory of so many frames.
    pub fn steps_in(&self, frames: usize) -> usize {
        let of = |&steps: &usize| steps * self.starts_of(steps, frames).len();
        self.steps.iter().map(of).sum()
    }

    /// First frames of the runs of so many steps, rising: from the first frame to the last that
    /// leaves room for them; the middle of these where there is one start; none where there is no
    /// room.
    fn starts_of(&self, steps: usize, frames: usize) -> Vec<usize> {
        let Some(last) = frames.checked_sub(1 + steps) else {
            return Vec::new();
        };
        spread(last, self.starts.min(last + 1))
    }

    /// The errors of runs that `run` makes: from a true frame, so many steps; its positions `[m]`,
    /// `[frames * vertices]`, begin with that frame and may end early.
    ///
    /// # Errors
    /// What `run` says.
    pub(super) fn over_true_starts<E: From<MeasureError>>(
        &self,
        truth: &Trajectory,
        mut run: impl FnMut(usize, usize) -> Result<Vec<Vec3>, E>,
    ) -> Result<Vec<Horizon>, E> {
        let frames = truth.frame_count();
        self.each(frames, |start, steps| {
            let positions = run(start, steps)?;
            let after = truth.frames().last(frames - start);
            let run = Frames::new(&positions, truth.vertex_count()).map_err(MeasureError::from)?;
            let position = metrics::per_frame_rmse(after, run).map_err(MeasureError::from)?;
            let edges = metrics::per_frame_edge_length_rmse(after, run, truth.topology());
            let edges = edges.map_err(MeasureError::from)?;
            Ok([position, edges].map(|errors| errors[1..].to_vec()))
        })
    }

    /// The errors on the same frames of one whole run.
    pub fn of_whole_run(&self, curves: &Curves, frames: usize) -> Vec<Horizon> {
        let errors: Result<_, Infallible> = self.each(frames, |start, steps| {
            let curves = [&curves.position_rmse, &curves.edge_length_rmse];
            Ok(curves.map(|curve| {
                let reached = curve.len().min(start + steps + 1);
                curve.get(start + 1..reached).unwrap_or_default().to_vec()
            }))
        });
        match errors {
            Ok(errors) => errors,
            Err(never) => match never {},
        }
    }

    /// The errors over each number of steps that fits, from those of position and edge length `[m]`
    /// in each frame after each start. None where a run ended early: a mean over the other starts
    /// would be one over the easier ones.
    fn each<E>(
        &self,
        frames: usize,
        mut run: impl FnMut(usize, usize) -> Result<[Vec<f64>; 2], E>,
    ) -> Result<Vec<Horizon>, E> {
        let mut errors = Vec::new();
        for &steps in &self.steps {
            let mut sums = Sums::default();
            let starts = self.starts_of(steps, frames);
            for &start in &starts {
                let [position, edges] = run(start, steps)?;
                if position.len() < steps {
                    break;
                }
                sums.add(&position, &edges);
            }
            if !starts.is_empty() && sums.starts == starts.len() {
                errors.push(sums.errors(steps));
            }
        }
        Ok(errors)
    }
}

impl Sums {
    fn add(&mut self, position: &[f64], edge_length: &[f64]) {
        let squares = |errors: &[f64]| errors.iter().map(|e| e * e).sum::<f64>();
        self.position += squares(position);
        self.last_position += position.last().map_or(0.0, |e| e * e);
        self.edge_length += squares(edge_length);
        self.starts += 1;
    }

    fn errors(&self, steps: usize) -> Horizon {
        let starts = self.starts as f64;
        let frames = starts * steps as f64;
        Horizon {
            steps,
            position_rmse: (self.position / frames).sqrt(),
            last_position_rmse: (self.last_position / starts).sqrt(),
            edge_length_rmse: (self.edge_length / frames).sqrt(),
        }
    }
}

/// `count` numbers from 0 to `last`, spread evenly; the middle where there is one.
pub(crate) fn spread(last: usize, count: usize) -> Vec<usize> {
    match count {
        0 => Vec::new(),
        1 => vec![last / 2],
        count => (0..count).map(|k| k * last / (count - 1)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_spread_evenly_and_leave_room_for_the_run() {
        let horizons = |starts| Horizons {
            steps: vec![1, 20],
            starts,
        };
        let five = horizons(5);
        assert_eq!(five.starts_of(20, 61), [0, 10, 20, 30, 40]);
        assert_eq!(five.starts_of(1, 61), [0, 14, 29, 44, 59]);
        assert_eq!(five.steps_in(61), 5 + 100);
        // More starts than frames, a run that does not fit, one start.
        assert_eq!(horizons(9).starts_of(5, 8), [0, 1, 2]);
        assert!(five.starts_of(20, 20).is_empty());
        assert_eq!(five.steps_in(20), 5);
        assert_eq!(horizons(1).starts_of(20, 61), [20]);
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
        let errors = horizons.of_whole_run(&curves, 10);
        let rms = |frames: &[f64]| {
            let squares: f64 = frames.iter().map(|f| f * f).sum();
            (squares / frames.len() as f64).sqrt()
        };
        // From the first frame and from the last that leaves room: 8, 7 and 4.
        let expected = [
            (1, rms(&[1.0, 9.0]), rms(&[1.0, 9.0])),
            (2, rms(&[1.0, 2.0, 8.0, 9.0]), rms(&[2.0, 9.0])),
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
        // What k is asked for beside it changes nothing.
        let alone = Horizons {
            steps: vec![2],
            starts: 2,
        };
        assert_eq!(alone.of_whole_run(&curves, 10), errors[1..2]);
        // A run that ended after frame 8: the second starts of 1 and 2 steps are not reached, nor
        // is that of 5.
        let mut short = curves;
        short.position_rmse.truncate(9);
        short.edge_length_rmse.truncate(9);
        assert!(horizons.of_whole_run(&short, 10).is_empty());
    }
}

//! The error relative to the size of the truth, and the first frame in which the cloth no longer
//! holds together.

use super::{MetricError, common, distances};
use crate::Frames;

/// Relative error, e₃D `[eq:relative-error]`: mean over frames of ‖P - P̂‖/‖P‖, Frobenius norms of
/// a frame's positions `[vertices, 3]` with P the truth `a`. No unit. It depends on where the
/// origin is, unlike the other errors: the farther away, the smaller. Infinite where all of a frame
/// lies at the origin and the run does not.
pub fn relative_error(a: Frames<'_>, b: Frames<'_>) -> Result<f64, MetricError> {
    let (a, b) = common(a, b)?;
    let of_frame = |(p, q): (&[glam::Vec3], &[glam::Vec3])| {
        let error: f64 = distances(p, q).map(|d| d * d).sum();
        let truth: f64 = p.iter().map(|p| p.as_dvec3().length_squared()).sum();
        if error == 0.0 {
            0.0
        } else {
            (error / truth).sqrt()
        }
    };
    let sum: f64 = a.iter().zip(b.iter()).map(of_frame).sum();
    Ok(sum / a.len() as f64)
}

/// The first frame of more than `frames` in a row whose largest strain, as from
/// [`largest_strain`](super::largest_strain), is above `limit` or is not a number: where a run
/// diverges, and does not merely stretch for a moment.
#[must_use]
pub fn diverged_frame(largest_strains: &[f64], limit: f64, frames: usize) -> Option<usize> {
    let holds = |strain: f64| strain <= limit;
    let mut first = 0;
    for (frame, &strain) in largest_strains.iter().enumerate() {
        if holds(strain) {
            first = frame + 1;
        } else if frame - first >= frames {
            return Some(first);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_diverges_where_it_stays_strained() {
        let run = |strained: &[usize]| -> Vec<f64> {
            let strain = |frame| if strained.contains(&frame) { 0.4 } else { 0.1 };
            (0..12).map(strain).collect()
        };
        assert_eq!(diverged_frame(&run(&[2, 3, 4]), 0.3, 3), None);
        assert_eq!(diverged_frame(&run(&[2, 3, 4, 5]), 0.3, 3), Some(2));
        assert_eq!(
            diverged_frame(&run(&[2, 3, 4, 6, 7, 8, 9]), 0.3, 3),
            Some(6)
        );
        assert_eq!(diverged_frame(&run(&[8, 9, 10, 11]), 0.3, 3), Some(8));
        assert_eq!(diverged_frame(&run(&[9, 10, 11]), 0.3, 3), None);
        assert_eq!(diverged_frame(&run(&[4]), 0.3, 0), Some(4));
        let lost = vec![f64::NAN; 3];
        assert_eq!(diverged_frame(&lost, 0.3, 2), Some(0));
    }
}

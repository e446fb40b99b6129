//! The character of a motion, without a truth beside it: how much it folds, stretches and shakes.
//! Two motions of one cloth are alike where the ratios of these numbers are near 1, wherever their
//! folds may be.

use glam::DVec3;
use selvedge_cloth::Cloth;
use serde::{Deserialize, Serialize};

use super::{bends, check_mesh};
use crate::Frames;
use crate::formats::file_error::Problem;

/// Strains that percentiles are of, at most: those of whole frames, spread evenly.
const MOST_STRAINS: usize = 2_000_000;

/// The character of a motion: folds, strains and speeds in numbers. `[eq:character]`
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Character {
    /// Mean over frames and interior edges of the bending angle's size `[rad]`: folds.
    pub folds: f64,
    /// Mean over frames of the curvature's size, as the sum of angle times length over the area
    /// `[1/m]`.
    pub curvature: f64,
    /// Strain of which 99 % of the edges have less.
    pub stretch: f64,
    /// Strain of which 1 % of the edges have less: compression, where it is negative.
    pub compression: f64,
    /// Mean kinetic energy `[J]`.
    pub kinetic_energy: f64,
    /// Root mean square acceleration of the vertices `[m/s²]`.
    pub acceleration: f64,
    /// Root mean square jerk of the vertices, the rate of their acceleration `[m/s³]`.
    pub jerk: f64,
}

impl Character {
    /// The number of numbers.
    pub const COUNT: usize = 7;

    /// Names of the numbers, in the order of [`Self::values`].
    pub const NAMES: [&'static str; Self::COUNT] = [
        "folds",
        "curvature",
        "stretch",
        "compression",
        "kinetic energy",
        "acceleration",
        "jerk",
    ];

    /// The character of `frames` of `cloth`, at so many frames per second. Numbers of rates are 0
    /// where there are too few frames for a difference.
    ///
    /// # Errors
    /// [`Problem`] for frames of another mesh, or none.
    pub fn of(frames: Frames<'_>, cloth: &Cloth, frame_rate: f64) -> Result<Self, Problem> {
        check_mesh(frames, cloth.topology())?;
        let [folds, curvature] = bending(frames, cloth);
        let [compression, stretch] = strains(frames, cloth);
        let masses = cloth.vertex_mass();
        let rate = frame_rate;
        let [_, energy] = difference(frames, [-1.0, 1.0, 0.0, 0.0], masses);
        let [acceleration, _] = difference(frames, [1.0, -2.0, 1.0, 0.0], masses);
        let [jerk, _] = difference(frames, [-1.0, 3.0, -3.0, 1.0], masses);
        Ok(Self {
            folds,
            curvature,
            stretch,
            compression,
            kinetic_energy: 0.5 * energy * rate.powi(2),
            acceleration: acceleration.sqrt() * rate.powi(2),
            jerk: jerk.sqrt() * rate.powi(3),
        })
    }

    /// The numbers.
    pub fn values(&self) -> [f64; Self::COUNT] {
        [
            self.folds,
            self.curvature,
            self.stretch,
            self.compression,
            self.kinetic_energy,
            self.acceleration,
            self.jerk,
        ]
    }

    /// The numbers of several motions over those of their truths, each the ratio of two sums; none
    /// where the truths have none of it.
    pub fn ratios(pairs: &[(Self, Self)]) -> [Option<f64>; Self::COUNT] {
        let (mut found, mut truth) = ([0.0; Self::COUNT], [0.0; Self::COUNT]);
        for (its, of_truth) in pairs {
            for (k, (a, b)) in its.values().iter().zip(of_truth.values()).enumerate() {
                found[k] += a;
                truth[k] += b;
            }
        }
        std::array::from_fn(|k| (truth[k] != 0.0).then(|| found[k] / truth[k]))
    }
}

/// Means over frames of a difference with these weights of a frame and those after it: of its
/// squares, over vertices too `[m²]`, and of the sums over vertices of mass times square `[kg m²]`.
fn difference(frames: Frames<'_>, weights: [f64; 4], masses: &[f32]) -> [f64; 2] {
    let width = weights.iter().rposition(|w| *w != 0.0).unwrap_or(0);
    let (mut squares, mut weighted, mut count) = (0.0, 0.0, 0_usize);
    for first in 0..frames.len().saturating_sub(width) {
        for (vertex, mass) in masses.iter().enumerate() {
            let mut sum = DVec3::ZERO;
            for (offset, weight) in weights.iter().enumerate().take(width + 1) {
                sum += frames.frame(first + offset)[vertex].as_dvec3() * *weight;
            }
            let square = sum.length_squared();
            squares += square;
            weighted += f64::from(*mass) * square;
        }
        count += 1;
    }
    let vertices = masses.len().max(1);
    [
        squares / (count.max(1) * vertices) as f64,
        weighted / count.max(1) as f64,
    ]
}

/// Mean of |θ| over the interior edges, and sum of |θ| l over the area of the cloth.
fn bending(frames: Frames<'_>, cloth: &Cloth) -> [f64; 2] {
    let areas = cloth.face_area();
    let (mut angles, mut turned, mut area, mut count) = (0.0, 0.0, 0.0, 0_usize);
    for positions in frames.iter() {
        for [angle, length] in bends(positions, cloth.topology()) {
            angles += angle.abs();
            turned += angle.abs() * length;
            count += 1;
        }
        area += areas.iter().map(|a| f64::from(*a)).sum::<f64>();
    }
    [
        angles / count.max(1) as f64,
        turned / area.max(f64::MIN_POSITIVE),
    ]
}

/// The strains of which 1 % and 99 % of all edges have less.
fn strains(frames: Frames<'_>, cloth: &Cloth) -> [f64; 2] {
    let lengths = cloth.pattern().edge_lengths();
    let every = (frames.len() * lengths.len()).div_ceil(MOST_STRAINS).max(1);
    let some = frames.iter().step_by(every);
    let mut all: Vec<f64> = some
        .flat_map(|positions| super::strains(positions, cloth.topology(), &lengths))
        .collect();
    let mut quantile = |part: f64| -> f64 {
        let Some(last) = all.len().checked_sub(1) else {
            return 0.0;
        };
        let place = (part * last as f64).round() as usize;
        *all.select_nth_unstable_by(place, f64::total_cmp).1
    };
    [quantile(0.01), quantile(0.99)]
}

#[cfg(test)]
mod tests;

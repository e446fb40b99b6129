//! Values over time: keys and how they are joined.
//!
//! Between two keys a value goes linearly (a turn along the shorter arc), stands until the next, or
//! follows glTF's cubic spline: with s from 0 to 1 over d seconds, v = (2s³ - 3s² + 1) v₀ + d (s³ -
//! 2s² + s) b₀ + (3s² - 2s³) v₁ + d (s³ - s²) a₁, a and b the tangents into and out of a key.
//! Before the first and after the last key it stands.

use std::iter::Sum;
use std::ops::Mul;

use glam::{DMat4, DQuat, DVec3};
use selvedge_cloth::geometry::slerp;

/// Interpolation between keys.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Joined<T> {
    /// In proportion to time.
    Linearly,
    /// Each stands until the next.
    InSteps,
    /// By the tangents into and out of each.
    BySplines(Vec<[T; 2]>),
}

/// Values at ascending times: at least one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track<T> {
    times: Vec<f64>,
    values: Vec<T>,
    joined: Joined<T>,
}

/// A value that can be interpolated.
pub(super) trait Value: Copy + Mul<f64, Output = Self> + Sum {
    /// The value at a fraction of the way from `self` to `to`.
    fn between(self, to: Self, fraction: f64) -> Self;
    /// The sum of values, each times its weight, as a value of its kind.
    fn combined(parts: [(Self, f64); 4]) -> Self {
        let weighted = parts.into_iter().map(|(value, weight)| value * weight);
        weighted.sum()
    }
    /// Returns true when all numbers are finite.
    fn is_sound(self) -> bool;
}

impl Value for f64 {
    fn between(self, to: Self, fraction: f64) -> Self {
        self + (to - self) * fraction
    }

    fn is_sound(self) -> bool {
        self.is_finite()
    }
}

impl Value for DVec3 {
    fn between(self, to: Self, fraction: f64) -> Self {
        self.lerp(to, fraction)
    }

    fn is_sound(self) -> bool {
        self.is_finite()
    }
}

impl Value for DQuat {
    fn between(self, to: Self, fraction: f64) -> Self {
        slerp(self, to, fraction)
    }

    fn combined(parts: [(Self, f64); 4]) -> Self {
        let sum = parts
            .into_iter()
            .fold(Self::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (q, w)| {
                sum + q * w
            });
        // A spline through opposite turns may pass through nothing.
        if sum.length_squared() > 0.0 { sum.normalize() } else { parts[0].0 }
    }

    fn is_sound(self) -> bool {
        self.is_finite() && (self.length() - 1.0).abs() < 1e-2
    }
}

impl Value for DMat4 {
    fn between(self, to: Self, fraction: f64) -> Self {
        self * (1.0 - fraction) + to * fraction
    }

    fn is_sound(self) -> bool {
        self.is_finite()
    }
}

impl<T: Value> Track<T> {
    /// A value that does not change.
    pub(super) fn constant(value: T) -> Self {
        Self {
            times: vec![0.0],
            values: vec![value],
            joined: Joined::InSteps,
        }
    }

    /// Values at times `[s]`.
    pub(super) fn new(
        times: Vec<f64>,
        values: Vec<T>,
        joined: Joined<T>,
    ) -> Result<Self, &'static str> {
        if times.is_empty() || times.len() != values.len() {
            return Err("needs as many values as times, and at least one");
        }
        if !times.iter().all(|time| time.is_finite()) || !values.iter().all(|v| v.is_sound()) {
            return Err("has a number that is not finite, or a turn that is not of length one");
        }
        if times.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err("has times that do not ascend");
        }
        Ok(Self {
            times,
            values,
            joined,
        })
    }

    /// The times of its keys `[s]`; none where nothing changes.
    pub(super) fn keys(&self) -> &[f64] {
        match self.times.len() {
            1 => &[],
            _ => &self.times,
        }
    }

    /// The value at `time` `[s]`.
    pub(super) fn at(&self, time: f64) -> T {
        let after = self.times.partition_point(|&key| key <= time);
        let last = self.values.len() - 1;
        let Some(before) = after.checked_sub(1) else {
            return self.values[0];
        };
        if before >= last {
            return self.values[last];
        }
        let (from, to) = (self.values[before], self.values[after]);
        let duration = self.times[after] - self.times[before];
        let s = (time - self.times[before]) / duration;
        match &self.joined {
            Joined::InSteps => from,
            Joined::Linearly => from.between(to, s),
            Joined::BySplines(tangents) => {
                let (s2, s3) = (s * s, s * s * s);
                T::combined([
                    (from, 2.0 * s3 - 3.0 * s2 + 1.0),
                    (tangents[before][1], duration * (s3 - 2.0 * s2 + s)),
                    (to, 3.0 * s2 - 2.0 * s3),
                    (tangents[after][0], duration * (s3 - s2)),
                ])
            }
        }
    }
}

/// The first and the last of some times.
pub(super) fn ends(times: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let times = times.into_iter().map(|time| [time; 2]);
    times.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(joined: Joined<DVec3>) -> Track<DVec3> {
        let values = vec![DVec3::ZERO, DVec3::X, DVec3::splat(8.0)];
        Track::new(vec![1.0, 2.0, 4.0], values, joined).unwrap()
    }

    #[test]
    fn values_are_joined_as_they_are_to_be() {
        for (time, linear, step) in [
            (0.0, 0.0, 0.0),
            (1.5, 0.5, 0.0),
            (2.0, 1.0, 1.0),
            (3.0, 4.5, 1.0),
            (9.0, 8.0, 8.0),
        ] {
            assert_eq!(track(Joined::Linearly).at(time).x, linear, "{time}");
            assert_eq!(track(Joined::InSteps).at(time).x, step, "{time}");
        }
        assert_eq!(track(Joined::Linearly).keys(), [1.0, 2.0, 4.0]);
        assert!(Track::constant(DVec3::X).keys().is_empty());
    }

    #[test]
    fn turns_go_the_shorter_way() {
        let turn = |angle: f64| DQuat::from_rotation_y(angle);
        let track = Track::new(
            vec![0.0, 1.0],
            vec![turn(0.2), -turn(0.8)],
            Joined::Linearly,
        );
        let middle = track.unwrap().at(0.5);
        assert!(middle.dot(turn(0.5)).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn what_cannot_be_used_is_refused() {
        let new = |times: &[f64], values: &[f64]| {
            let values = values.iter().map(|&v| DVec3::splat(v)).collect();
            Track::new(times.to_vec(), values, Joined::Linearly).is_ok()
        };
        assert!(new(&[0.0, 1.0], &[0.0, 1.0]));
        assert!(!new(&[], &[]) && !new(&[0.0], &[0.0, 1.0]));
        assert!(!new(&[1.0, 1.0], &[0.0, 1.0]) && !new(&[0.0, f64::NAN], &[0.0, 1.0]));
        assert!(!new(&[0.0], &[f64::INFINITY]));
    }
}

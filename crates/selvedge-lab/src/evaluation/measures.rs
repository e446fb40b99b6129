//! Measures of a frame against the true one, and their means over frames and over runs.

use glam::DVec3;
use selvedge_cloth::{Cloth, Topology};
use selvedge_data::metrics::{self, bends, largest, mean, rms, strains};
use serde::{Deserialize, Serialize};

/// How the measures of the frames of a run become one.
#[derive(Clone, Copy)]
enum Pooling {
    /// √(mean of squares).
    Square,
    Mean,
    Largest,
}

/// Makes [`Errors`] of the table of measures: its fields, its names and its values.
macro_rules! errors {
    ($($(#[$doc:meta])* $name:ident: $pooling:ident;)+) => {
        /// Measures of a frame against the true one, or means of several.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Errors {
            $($(#[$doc])* pub $name: f64,)+
        }

        impl Errors {
            /// Names of the measures, as JSON and CSV have them.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            const POOLING: &'static [Pooling] = &[$(Pooling::$pooling),+];

            /// Values in the order of [`Self::NAMES`].
            pub fn values(&self) -> Vec<f64> {
                vec![$(self.$name),+]
            }

            fn of(values: impl IntoIterator<Item = f64>) -> Self {
                let mut values = values.into_iter();
                Self { $($name: values.next().unwrap_or(f64::NAN),)+ }
            }
        }
    };
}

errors! {
    /// √(mean over vertices of the squared distance to the truth) `[m]`.
    position_rmse: Square;
    /// Mean over vertices of the distance to the truth `[m]`.
    mean_vertex_error: Mean;
    /// The largest distance of a vertex to the truth `[m]`.
    largest_vertex_error: Largest;
    /// e₃D, ‖error‖/‖truth‖; it depends on where the origin is. `[eq:relative-error]`
    relative_error: Mean;
    /// √(mean over edges of the squared difference of lengths) `[m]`.
    edge_length_rmse: Square;
    /// √(mean over inner edges of the squared difference of bending angles) `[rad]`.
    fold_rmse: Square;
    /// Mean size of the bending angles `[rad]`.
    folds: Mean;
    /// The truth's `[rad]`.
    true_folds: Mean;
    /// The truth's largest strain of an edge, (l - l₀)/l₀ against the material.
    true_largest_strain: Largest;
}

/// A frame of a run, a whole run, or the mean of several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameErrors {
    /// Frames after the start.
    pub frame: usize,
    /// The largest strain of an edge, (l - l₀)/l₀ against the material.
    pub largest_strain: f64,
    /// Against the truth; none where nobody knows it.
    pub errors: Option<Errors>,
}

impl Errors {
    /// Folds as a part of the truth's; none where that is flat.
    pub fn fold_ratio(&self) -> Option<f64> {
        (self.true_folds > 0.0).then(|| self.folds / self.true_folds)
    }

    fn pooled(all: &[Self], of: impl Fn(&[f64], Pooling) -> f64) -> Option<Self> {
        let values: Vec<Vec<f64>> = all.iter().map(Self::values).collect();
        let places = Self::POOLING.iter().enumerate();
        let pooled = places.map(|(place, pooling)| {
            let column: Vec<f64> = values.iter().map(|row| row[place]).collect();
            of(&column, *pooling)
        });
        (!all.is_empty()).then(|| Self::of(pooled))
    }
}

impl FrameErrors {
    /// Frames of one run as one, called by the last of them.
    pub(super) fn over_time(frames: &[Self]) -> Option<Self> {
        Self::pooled(frames, |values, pooling| match pooling {
            Pooling::Square => rms(values.iter().copied()),
            Pooling::Mean => mean(values.iter().copied()),
            Pooling::Largest => largest(values.iter().copied()),
        })
    }

    /// Runs as one: the mean of errors, the largest of extremes.
    pub fn over_runs(runs: &[Self]) -> Option<Self> {
        Self::pooled(runs, |values, pooling| match pooling {
            Pooling::Square | Pooling::Mean => mean(values.iter().copied()),
            Pooling::Largest => largest(values.iter().copied()),
        })
    }

    fn pooled(all: &[Self], of: impl Fn(&[f64], Pooling) -> f64) -> Option<Self> {
        let errors: Option<Vec<Errors>> = all.iter().map(|at| at.errors).collect();
        Some(Self {
            frame: all.last()?.frame,
            largest_strain: largest(all.iter().map(|at| at.largest_strain)),
            errors: errors.and_then(|errors| Errors::pooled(&errors, of)),
        })
    }

    pub(super) fn is_finite(&self) -> bool {
        let errors = self.errors.iter().flat_map(Errors::values);
        errors
            .chain([self.largest_strain])
            .all(|value| value.is_finite())
    }
}

/// A cloth as the measures need it.
pub(super) struct Gauge<'a> {
    topology: &'a Topology,
    /// `[m]`, `[edges]`
    material_length: Vec<f64>,
}

impl<'a> Gauge<'a> {
    pub(super) fn of(cloth: &'a Cloth) -> Self {
        Self {
            topology: cloth.topology(),
            material_length: cloth.pattern().edge_lengths(),
        }
    }

    /// Measures the positions `found` in frame `frame` after the start, against `truth`.
    pub(super) fn measure(
        &self,
        frame: usize,
        found: &[DVec3],
        truth: Option<&[DVec3]>,
    ) -> FrameErrors {
        FrameErrors {
            frame,
            largest_strain: self.largest_strain(found),
            errors: truth.map(|truth| self.errors(truth, found)),
        }
    }

    fn errors(&self, truth: &[DVec3], found: &[DVec3]) -> Errors {
        let distances = || metrics::distances(truth, found);
        let angles = |positions| bends(positions, self.topology).map(|[angle, _]| angle);
        let turns = angles(truth).zip(angles(found)).map(|(a, b)| turned(b - a));
        let true_square: f64 = truth.iter().map(|p| p.length_squared()).sum();
        let square: f64 = distances().map(|d| d * d).sum();
        Errors {
            position_rmse: rms(distances()),
            mean_vertex_error: mean(distances()),
            largest_vertex_error: largest(distances()),
            relative_error: (square / true_square).sqrt(),
            edge_length_rmse: rms(metrics::edge_errors(truth, found, self.topology)),
            fold_rmse: rms(turns),
            folds: mean(angles(found).map(f64::abs)),
            true_folds: mean(angles(truth).map(f64::abs)),
            true_largest_strain: self.largest_strain(truth),
        }
    }

    fn largest_strain(&self, positions: &[DVec3]) -> f64 {
        largest(strains(positions, self.topology, &self.material_length))
    }
}

/// A difference of two angles by the shorter way round `[rad]`: a fold of nearly π may go on as one
/// of nearly -π.
fn turned(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    match angle {
        a if a > PI => a - TAU,
        a if a < -PI => a + TAU,
        a => a,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec2;
    use selvedge_cloth::{Handles, Mesh};

    use super::*;

    #[test]
    fn a_case_made_by_hand_has_its_closed_form() {
        // A square metre of two triangles that share a diagonal of length √2.
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from);
        let flat = corners.map(|p| p.extend(0.0));
        let mesh = Mesh::new(&[[0, 1, 2], [0, 2, 3]], corners.to_vec(), flat.to_vec()).unwrap();
        let cloth = Cloth::of_mesh(&mesh, 0.1, Handles::new(&[0], 4).unwrap()).unwrap();
        let gauge = Gauge::of(&cloth);
        // Everything lifted by 3 m and one corner by 4 m more, about the diagonal of the other two.
        let mut lifted: Vec<DVec3> = flat.iter().map(|p| *p + DVec3::Y * 3.0).collect();
        lifted[1] += DVec3::Z * 4.0;
        let at = gauge.measure(7, &lifted, Some(&flat));
        let errors = at.errors.unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6 * b.abs().max(1.0), "{a} {b}");
        near(errors.position_rmse, ((3.0 * 9.0 + 25.0) / 4.0_f64).sqrt());
        near(errors.mean_vertex_error, 14.0 / 4.0);
        near(errors.largest_vertex_error, 5.0);
        near(errors.relative_error, (52.0_f64 / 4.0).sqrt());
        // The corner is √½ from the hinge and 4 m above it.
        let angle = 4.0_f64.atan2(0.5_f64.sqrt());
        near(errors.fold_rmse, angle);
        near(errors.folds, angle);
        assert_eq!((errors.true_folds, errors.fold_ratio()), (0.0, None));
        // Two of five edges have become √(1 + 16) long.
        let longer = 17.0_f64.sqrt() - 1.0;
        near(
            errors.edge_length_rmse,
            (2.0 * longer * longer / 5.0).sqrt(),
        );
        near(at.largest_strain, longer);
        near(errors.true_largest_strain, 0.0);
        assert_eq!(gauge.measure(0, &lifted, None).errors, None);
    }

    #[test]
    fn angles_are_compared_by_the_shorter_way() {
        assert!((turned((PI - 0.1) - (0.1 - PI)) + 0.2).abs() < 1e-14);
        assert!((turned((0.1 - PI) - (PI - 0.1)) - 0.2).abs() < 1e-14);
        assert_eq!(turned(1.0), 1.0);
    }

    #[test]
    fn frames_and_runs_are_pooled_each_in_its_way() {
        let at = |frame: usize, error: f64| FrameErrors {
            frame,
            largest_strain: error,
            errors: Some(Errors::of(vec![error; Errors::NAMES.len()])),
        };
        let over_time = FrameErrors::over_time(&[at(1, 3.0), at(2, 4.0)]).unwrap();
        let errors = over_time.errors.unwrap();
        assert_eq!(errors.position_rmse, 12.5_f64.sqrt());
        assert_eq!(errors.mean_vertex_error, 3.5);
        assert_eq!((over_time.frame, over_time.largest_strain), (2, 4.0));
        let over_runs = FrameErrors::over_runs(&[at(2, 3.0), at(2, 4.0)]).unwrap();
        assert_eq!(over_runs.errors.unwrap().position_rmse, 3.5);
        assert_eq!(over_runs.errors.unwrap().largest_vertex_error, 4.0);
        assert_eq!(FrameErrors::over_runs(&[]), None);
        assert!(!at(1, f64::NAN).is_finite());
    }
}

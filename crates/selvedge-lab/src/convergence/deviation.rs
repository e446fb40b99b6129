//! Measures of a state against the true one of the same frame.

use glam::{DVec2, DVec3};
use selvedge_cloth::geometry::dihedral_angle;
use selvedge_cloth::{Scene, Topology};
use serde::Serialize;

use super::reference::State;

/// A state, or the mean of several, against the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// √(mean over vertices of the squared distance) `[m]`.
    pub position_rmse: f64,
    /// √(mean over vertices of the squared difference of velocities) `[m/s]`.
    pub velocity_rmse: f64,
    /// √(mean over inner edges of the squared difference of dihedral angles) `[rad]`.
    pub fold_rmse: f64,
    /// √(mean over edges of the squared difference of lengths) `[m]`.
    pub edge_length_rmse: f64,
    /// Kinetic and gravitational energy, less that of the truth `[J]`.
    pub energy_difference: f64,
    /// Mean size of the dihedral angles `[rad]`.
    pub folds: f64,
    /// The truth's `[rad]`.
    pub true_folds: f64,
    /// The largest (l - l₀)/l₀ of an edge in any frame since the start.
    pub largest_strain: f64,
    /// The truth's.
    pub true_largest_strain: f64,
}

impl Deviation {
    /// Names of the measures, as JSON and CSV have them.
    pub const NAMES: [&'static str; 9] = [
        "position_rmse",
        "velocity_rmse",
        "fold_rmse",
        "edge_length_rmse",
        "energy_difference",
        "folds",
        "true_folds",
        "largest_strain",
        "true_largest_strain",
    ];

    /// Values in the order of [`Self::NAMES`].
    #[must_use]
    pub fn values(&self) -> [f64; 9] {
        [
            self.position_rmse,
            self.velocity_rmse,
            self.fold_rmse,
            self.edge_length_rmse,
            self.energy_difference,
            self.folds,
            self.true_folds,
            self.largest_strain,
            self.true_largest_strain,
        ]
    }

    /// The mean of `all`, and the largest of the strains; none where there are none.
    #[must_use]
    pub fn pooled(all: &[Self]) -> Option<Self> {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let most = |of: fn(&Self) -> f64| all.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        (!all.is_empty()).then(|| Self {
            position_rmse: mean(|d| d.position_rmse),
            velocity_rmse: mean(|d| d.velocity_rmse),
            fold_rmse: mean(|d| d.fold_rmse),
            edge_length_rmse: mean(|d| d.edge_length_rmse),
            energy_difference: mean(|d| d.energy_difference),
            folds: mean(|d| d.folds),
            true_folds: mean(|d| d.true_folds),
            largest_strain: most(|d| d.largest_strain),
            true_largest_strain: most(|d| d.true_largest_strain),
        })
    }

    /// Folds as a part of the truth's; none where that is flat.
    #[must_use]
    pub fn fold_ratio(&self) -> Option<f64> {
        (self.true_folds > 0.0).then(|| self.folds / self.true_folds)
    }

    /// The largest strain as a part of the truth's; none where no edge of that is stretched.
    #[must_use]
    pub fn strain_ratio(&self) -> Option<f64> {
        let truth = self.true_largest_strain;
        (truth > 0.0).then(|| self.largest_strain / truth)
    }
}

/// The cloth as the measures need it.
pub(super) struct Gauge<'a> {
    topology: &'a Topology,
    /// Length of each edge in material space `[m]`.
    material_length: Vec<f64>,
    /// Mass of each vertex `[kg]`.
    mass: Vec<f64>,
    /// Acceleration `[m/s²]`.
    gravity: DVec3,
}

impl<'a> Gauge<'a> {
    pub(super) fn of(scene: &'a Scene) -> Self {
        let rest = scene.rest_shape();
        Self {
            topology: scene.mesh.topology(),
            material_length: rest.edge_length,
            mass: rest.vertex_mass,
            gravity: scene.environment.gravity,
        }
    }

    /// The state `found` against `truth`; `strains` are the largest of each since the start.
    pub(super) fn deviation(
        &self,
        truth: State<'_>,
        found: State<'_>,
        strains: Strains,
    ) -> Deviation {
        let [true_angles, angles] = [truth, found].map(|state| self.angles(state.positions));
        let [true_lengths, lengths] = [truth, found].map(|state| self.lengths(state.positions));
        let bends = true_angles.iter().zip(&angles).map(|(a, b)| turned(b - a));
        let stretches = true_lengths.iter().zip(&lengths).map(|(a, b)| b - a);
        Deviation {
            position_rmse: rms(distances(truth.positions, found.positions)),
            velocity_rmse: rms(distances(truth.velocities, found.velocities)),
            fold_rmse: rms(bends),
            edge_length_rmse: rms(stretches),
            energy_difference: self.energy_difference(truth, found),
            folds: mean_size(&angles),
            true_folds: mean_size(&true_angles),
            largest_strain: strains.found,
            true_largest_strain: strains.truth,
        }
    }

    /// The largest strain of an edge, (l - l₀)/l₀.
    pub(super) fn largest_strain(&self, positions: &[DVec3]) -> f64 {
        let lengths = self.lengths(positions).into_iter();
        let strains = lengths
            .zip(&self.material_length)
            .map(|(l, l0)| (l - l0) / l0);
        strains.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest strains of both, as yet of this frame alone.
    pub(super) fn strains(&self, truth: State<'_>, found: State<'_>) -> Strains {
        Strains {
            truth: self.largest_strain(truth.positions),
            found: self.largest_strain(found.positions),
        }
    }

    /// The dihedral angle of each inner edge `[rad]`.
    fn angles(&self, positions: &[DVec3]) -> Vec<f64> {
        let edges = self.topology.edges().iter();
        let angle = |edge: &selvedge_cloth::Edge| {
            let [from, to] = edge.vertices.map(|v| positions[v.index()]);
            let (left, right) = edge.opposite;
            let [left, right] = [left, right?].map(|v| positions[v.index()]);
            Some(dihedral_angle(from, to, left, right))
        };
        edges.filter_map(angle).collect()
    }

    fn lengths(&self, positions: &[DVec3]) -> Vec<f64> {
        let edges = self.topology.edges().iter();
        let ends = edges.map(|edge| edge.vertices.map(|v| positions[v.index()]));
        ends.map(|[a, b]| a.distance(b)).collect()
    }

    /// Energy of `found` less that of `truth`, vertex by vertex: their sums are large, and nearly
    /// the same.
    fn energy_difference(&self, truth: State<'_>, found: State<'_>) -> f64 {
        let kinetic = truth.velocities.iter().zip(found.velocities);
        let kinetic = kinetic.map(|(a, b)| 0.5 * (b.length_squared() - a.length_squared()));
        let moved = truth.positions.iter().zip(found.positions);
        let potential = moved.map(|(a, b)| -self.gravity.dot(*b - *a));
        let both = kinetic.zip(potential).zip(&self.mass);
        both.map(|((kinetic, potential), mass)| mass * (kinetic + potential))
            .sum()
    }
}

/// Largest strains since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strains {
    pub(super) truth: f64,
    pub(super) found: f64,
}

impl Strains {
    /// None that was measured.
    pub(super) const NONE: Self = Self {
        truth: f64::NEG_INFINITY,
        found: f64::NEG_INFINITY,
    };

    /// The larger of each.
    pub(super) fn max(self, other: Self) -> Self {
        Self {
            truth: self.truth.max(other.truth),
            found: self.found.max(other.found),
        }
    }
}

fn distances<'a>(a: &'a [DVec3], b: &'a [DVec3]) -> impl Iterator<Item = f64> + 'a {
    a.iter().zip(b).map(|(a, b)| a.distance(*b))
}

/// √(mean of squares); 0 of none.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    // The sum of squares, and how many.
    let sum = values.fold(DVec2::ZERO, |sum, value| {
        sum + DVec2::new(value * value, 1.0)
    });
    (sum.x / sum.y.max(1.0)).sqrt()
}

fn mean_size(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|value| value.abs()).sum();
    sum / values.len().max(1) as f64
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

    use super::*;

    /// A square metre of two triangles that share a diagonal of length √2.
    fn scene() -> Scene {
        let loaded = selvedge_data::open_scene("default").unwrap();
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from);
        let mesh = selvedge_cloth::Mesh::new(
            &[[0, 1, 2], [0, 2, 3]],
            corners.to_vec(),
            corners.map(|p| p.extend(0.0)).to_vec(),
        );
        Scene {
            mesh: mesh.unwrap(),
            ..loaded.scene
        }
    }

    const NO_STRAINS: Strains = Strains {
        truth: 0.0,
        found: 0.0,
    };

    #[test]
    fn a_case_made_by_hand_has_its_closed_form() {
        let scene = scene();
        let gauge = Gauge::of(&scene);
        let (still, moving) = ([DVec3::ZERO; 4], [DVec3::X * 2.0; 4]);
        let flat = scene.mesh.positions();
        // Everything lifted by 3 m and one corner by 4 m more, about the diagonal of the other two.
        let mut lifted: Vec<DVec3> = flat.iter().map(|p| *p + DVec3::Y * 3.0).collect();
        lifted[1] += DVec3::Z * 4.0;
        let truth = State {
            positions: flat,
            velocities: &still,
        };
        let found = State {
            positions: &lifted,
            velocities: &moving,
        };
        let d = gauge.deviation(truth, found, NO_STRAINS);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-14 * b.abs().max(1.0), "{a} {b}");
        near(d.position_rmse, ((3.0 * 9.0 + 25.0) / 4.0_f64).sqrt());
        near(d.velocity_rmse, 2.0);
        // The corner is √½ from the hinge and 4 m above it.
        let angle = 4.0_f64.atan2(0.5_f64.sqrt());
        near(d.fold_rmse, angle);
        near(d.folds, angle);
        assert_eq!((d.true_folds, d.fold_ratio()), (0.0, None));
        // Two of five edges have become √(1 + 16) long.
        let longer = 17.0_f64.sqrt() - 1.0;
        near(d.edge_length_rmse, (2.0 * longer * longer / 5.0).sqrt());
        // Gravity is along y: 9.8 m/s² × 3 m, and v²/2 = 2, times the mass of a square metre.
        near(
            d.energy_difference,
            scene.material.density * (9.8 * 3.0 + 2.0),
        );
        near(gauge.largest_strain(&lifted), longer);
        assert_eq!(gauge.largest_strain(flat), 0.0);
        let same = gauge.deviation(truth, truth, NO_STRAINS);
        assert_eq!(same.values(), [0.0; 9]);
    }

    #[test]
    fn angles_are_compared_by_the_shorter_way() {
        assert!((turned((PI - 0.1) - (0.1 - PI)) + 0.2).abs() < 1e-14);
        assert!((turned((0.1 - PI) - (PI - 0.1)) - 0.2).abs() < 1e-14);
        assert_eq!(turned(1.0), 1.0);
    }

    #[test]
    fn errors_are_pooled_by_their_mean_and_strains_by_the_largest() {
        let scene = scene();
        let gauge = Gauge::of(&scene);
        let still = [DVec3::ZERO; 4];
        let flat = scene.mesh.positions();
        let of = |x: f64, found: f64| {
            let moved: Vec<DVec3> = flat.iter().map(|p| *p + DVec3::X * x).collect();
            let [truth, state] = [flat, &moved].map(|positions| State {
                positions,
                velocities: &still,
            });
            gauge.deviation(truth, state, Strains { truth: 0.2, found })
        };
        let pooled = Deviation::pooled(&[of(1.0, 0.5), of(3.0, 0.4)]).unwrap();
        assert!((pooled.position_rmse - 2.0).abs() < 1e-14);
        assert_eq!(pooled.strain_ratio(), Some(2.5));
        assert_eq!(Deviation::pooled(&[]), None);
    }
}

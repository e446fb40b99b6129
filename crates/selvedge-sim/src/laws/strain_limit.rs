//! Strain limiting: after a solve, vertices are moved as little as possible until every face's
//! principal stretches are within the material's limits. Thomaszewski, Pabst and Straßer 2009 and
//! Narain et al. 2012 describe the purpose; the projection here is position-based (Müller et al.
//! 2007).
//!
//! Sweeps visit the faces in order and give each its nearest allowed shape, until no face is beyond
//! its limits or [`MOST_SWEEPS`] have passed. The rest is left to the next solve. A face keeps its
//! centre of mass, and turns so that its corners' moves have no angular momentum. Exact handles do
//! not move: a face with three held corners cannot be limited, one with two only by its third
//! corner. Velocities follow the moves, v += Δx/dt.

use glam::{DVec2, DVec3};
use selvedge_cloth::{HandleConstraint, Scene, StrainLimits};

use crate::laws::stretch::StretchElement;
use crate::state::State;

/// Sweeps over all faces per solve.
pub(crate) const MOST_SWEEPS: usize = 100;
/// Distance beyond its limits that a stretch may keep.
const TOLERANCE: f64 = 1e-6;
/// Stretch below which a face has no direction in which it could be widened.
const THINNEST: f64 = 1e-6;

/// The limits of a cloth.
pub(crate) struct StrainLimiter {
    faces: Vec<LimitedFace>,
}

struct LimitedFace {
    limits: StrainLimits,
    corners: [u32; 3],
    /// Material coordinates `[m]`.
    rest: [DVec2; 3],
    element: StretchElement,
    /// Share of each corner in the face's pivot: by mass, or all of it at held corners.
    shares: [f64; 3],
    /// Masses of the corners that may move `[kg]`, 0 where held.
    masses: [f64; 3],
}

/// The face's shape nearest to its limits: columns of F.
struct Allowed {
    along_u: DVec3,
    along_v: DVec3,
}

impl StrainLimiter {
    /// The limiter of a scene of which a material has limits; vertex `mass` in kg, `[vertices]`.
    /// Faces of a material without limits are left as they are.
    pub(crate) fn new(scene: &Scene, mass: &[f64]) -> Option<Self> {
        let (materials, material_of) = scene.materials();
        if materials
            .iter()
            .all(|material| material.strain_limits.is_none())
        {
            return None;
        }
        let held = match scene.physics.handles {
            HandleConstraint::Exact => scene.handles.mask(mass.len()),
            HandleConstraint::Spring => vec![false; mass.len()],
        };
        let shapes = scene.mesh.pattern().faces();
        let faces = scene.mesh.topology().face_indices().into_iter().zip(shapes);
        let limited = faces
            .zip(material_of)
            .filter_map(|((corners, rest), material)| {
                let limits = materials[material].strain_limits?;
                if corners.iter().all(|&v| held[v as usize]) {
                    return None;
                }
                let free = corners.map(|v| (!held[v as usize]).then_some(mass[v as usize]));
                Some(LimitedFace {
                    limits,
                    ..LimitedFace::new(corners, rest, free)
                })
            });
        Some(Self {
            faces: limited.collect(),
        })
    }

    /// Returns true if a face of `state` is at a limit or beyond.
    pub(crate) fn is_reached(&self, state: &State) -> bool {
        let mut faces = self.faces.iter();
        faces.any(|face| {
            let tighter = StrainLimits {
                min: face.limits.min + 2.0 * TOLERANCE,
                max: face.limits.max - 2.0 * TOLERANCE,
            };
            let (along_u, along_v) = face
                .element
                .gradient(face.corners.map(|v| state.positions[v as usize]));
            allowed(tighter, along_u, along_v).is_some()
        })
    }

    /// Moves `state`, the result of a solve over `dt` `[s]`, within the limits. Gives the number of
    /// sweeps.
    pub(crate) fn limit(&self, dt: f64, state: &mut State) -> usize {
        (0..MOST_SWEEPS)
            .find(|_| !self.sweep(dt, state))
            .unwrap_or(MOST_SWEEPS)
    }

    /// One sweep over the faces. Returns true if it moved any.
    fn sweep(&self, dt: f64, state: &mut State) -> bool {
        let mut moved = false;
        for face in &self.faces {
            moved |= face.limit(face.limits, dt, state);
        }
        moved
    }
}

impl LimitedFace {
    /// A face with the masses of its corners; a held corner has none.
    fn new(corners: [u32; 3], rest: [DVec2; 3], free: [Option<f64>; 3]) -> Self {
        let held = free.iter().filter(|mass| mass.is_none()).count();
        let masses = free.map(Option::unwrap_or_default);
        let total: f64 = masses.iter().sum();
        let shares = match held {
            0 => masses.map(|mass| mass / total),
            held => free.map(|mass| match mass {
                Some(_) => 0.0,
                None => 1.0 / held as f64,
            }),
        };
        Self {
            limits: StrainLimits {
                min: 0.0,
                max: f64::INFINITY,
            },
            corners,
            rest,
            element: StretchElement::new(rest),
            shares,
            masses,
        }
    }

    /// Moves the corners to the nearest allowed shape. Returns true if that was needed.
    fn limit(&self, limits: StrainLimits, dt: f64, state: &mut State) -> bool {
        let corners = self.corners.map(|v| state.positions[v as usize]);
        let (along_u, along_v) = self.element.gradient(corners);
        let Some(allowed) = allowed(limits, along_u, along_v) else {
            return false;
        };
        let normal = along_u.cross(along_v).normalize_or_zero();
        let moves = self.moves(corners, &allowed, normal);
        for ((&vertex, shift), mass) in self.corners.iter().zip(moves).zip(self.masses) {
            if mass > 0.0 {
                state.positions[vertex as usize] += shift;
                state.velocities[vertex as usize] += shift / dt;
            }
        }
        true
    }

    /// Moves of the corners to the allowed shape `[m]`. The shape is put on the pivot and turned
    /// about the normal by the angle for which Σ m x × Δx = 0 over the free corners.
    fn moves(&self, corners: [DVec3; 3], allowed: &Allowed, normal: DVec3) -> [DVec3; 3] {
        let pivot: DVec3 = (0..3).map(|k| corners[k] * self.shares[k]).sum();
        let rest_pivot: DVec2 = (0..3).map(|k| self.rest[k] * self.shares[k]).sum();
        let arms = self.rest.map(|place| {
            let place = place - rest_pivot;
            allowed.along_u * place.x + allowed.along_v * place.y
        });
        let (mut sine, mut cosine) = (0.0, 0.0);
        // Two held corners leave no turn in the plane.
        if self.shares.iter().filter(|share| **share > 0.0).count() != 2 {
            for k in 0..3 {
                let now = corners[k] - pivot;
                sine += self.masses[k] * arms[k].cross(now).dot(normal);
                cosine += self.masses[k] * arms[k].dot(now);
            }
        }
        let (sine, cosine) = match sine.hypot(cosine) {
            length if length > 0.0 => (sine / length, cosine / length),
            _ => (0.0, 1.0),
        };
        std::array::from_fn(|k| {
            let turned = arms[k] * cosine + normal.cross(arms[k]) * sine;
            pivot + turned - corners[k]
        })
    }
}

/// F with its singular values σ clamped to the limits, F V diag(σ'/σ) Vᵀ; none if they are within
/// the limits. `[eq:strain-limit]`
fn allowed(limits: StrainLimits, along_u: DVec3, along_v: DVec3) -> Option<Allowed> {
    let (uu, vv) = (along_u.length_squared(), along_v.length_squared());
    let uv = along_u.dot(along_v);
    let (mean, half) = (0.5 * (uu + vv), 0.5 * (uu - vv));
    let spread = half.hypot(uv);
    let largest = (mean + spread).sqrt();
    let smallest = (mean - spread).max(0.0).sqrt();
    if largest <= limits.max + TOLERANCE && smallest >= limits.min - TOLERANCE {
        return None;
    }
    let ratio = |stretch: f64| {
        if stretch < THINNEST {
            1.0
        } else {
            stretch.clamp(limits.min, limits.max) / stretch
        }
    };
    let (first, second) = (ratio(largest), ratio(smallest));
    if first == 1.0 && second == 1.0 {
        return None;
    }
    let (sine, cosine) = (0.5 * uv.atan2(half)).sin_cos();
    let t_uu = first * cosine * cosine + second * sine * sine;
    let t_vv = first * sine * sine + second * cosine * cosine;
    let t_uv = (first - second) * sine * cosine;
    Some(Allowed {
        along_u: along_u * t_uu + along_v * t_uv,
        along_v: along_u * t_uv + along_v * t_vv,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: StrainLimits = StrainLimits { min: 0.9, max: 1.1 };
    const REST: [DVec2; 3] = [
        DVec2::new(0.0, 0.0),
        DVec2::new(0.04, 0.01),
        DVec2::new(0.01, 0.03),
    ];
    const DT: f64 = 1.0 / 240.0;

    /// Stretched by 1.3 in one direction and pressed to 0.7 across it, and turned in space.
    fn strained() -> [DVec3; 3] {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.4, -1.0, 2.0));
        let direction = DVec2::from_angle(0.6);
        REST.map(|place| {
            let along = 1.3 * place.dot(direction);
            let across = 0.7 * place.dot(direction.perp());
            turn * (direction * along + direction.perp() * across).extend(0.0) + DVec3::ONE
        })
    }

    fn state() -> State {
        State {
            positions: strained().to_vec(),
            velocities: vec![DVec3::new(0.1, -0.2, 0.3); 3],
        }
    }

    fn stretches(face: &LimitedFace, positions: &[DVec3]) -> [f64; 2] {
        let corners = face.corners.map(|v| positions[v as usize]);
        let (u, v) = face.element.gradient(corners);
        let trace = u.length_squared() + v.length_squared();
        let area = u.cross(v).length();
        let spread = (0.25 * trace * trace - area * area).max(0.0).sqrt();
        [1.0, -1.0].map(|sign| (0.5 * trace + sign * spread).sqrt())
    }

    #[test]
    fn a_free_face_gets_its_limits_and_keeps_its_momenta() {
        let masses = [0.001, 0.004, 0.002];
        let face = LimitedFace::new([0, 1, 2], REST, masses.map(Some));
        let (before, mut after) = (state(), state());
        let measured = stretches(&face, &before.positions);
        assert!((measured[0] - 1.3).abs() < 1e-12 && (measured[1] - 0.7).abs() < 1e-12);
        assert!(face.limit(LIMITS, DT, &mut after));
        let [largest, smallest] = stretches(&face, &after.positions);
        assert!((largest - 1.1).abs() < 1e-12 && (smallest - 0.9).abs() < 1e-12);
        assert!(!face.limit(LIMITS, DT, &mut after));
        let (mut momentum, mut angular) = (DVec3::ZERO, DVec3::ZERO);
        for (k, mass) in masses.into_iter().enumerate() {
            let shift = after.positions[k] - before.positions[k];
            let change = after.velocities[k] - before.velocities[k];
            assert!(change.distance(shift / DT) < 1e-12);
            momentum += mass * shift;
            angular += mass * before.positions[k].cross(shift);
        }
        // Positions of size 1 m are rounded by 1e-16, for 7 g in all and a few operations.
        assert!(momentum.length() < 5e-18, "{momentum}");
        assert!(angular.length() < 5e-18, "{angular}");
    }

    #[test]
    fn held_corners_stay() {
        for held in [[true, false, false], [true, false, true]] {
            let masses = held.map(|held| (!held).then_some(0.002));
            let face = LimitedFace::new([0, 1, 2], REST, masses);
            // The edge 0-2 is as long as at rest, so that the limits can be met by moving corner 1.
            let start = [
                REST[0].extend(0.0),
                DVec3::new(0.06, 0.03, 0.02),
                REST[2].extend(0.0),
            ];
            let mut after = State {
                positions: start.to_vec(),
                velocities: vec![DVec3::ZERO; 3],
            };
            // One held corner is met at once; projections between two converge by at least a
            // constant factor each time.
            for _ in 0..200 {
                face.limit(LIMITS, DT, &mut after);
            }
            for k in 0..3 {
                assert!(!held[k] || after.positions[k] == start[k], "{held:?} {k}");
            }
            let [largest, smallest] = stretches(&face, &after.positions);
            let allowed = 0.9 - 2e-6..1.1 + 2e-6;
            assert!(allowed.contains(&largest) && allowed.contains(&smallest));
        }
    }

    #[test]
    fn faces_within_their_limits_and_collapsed_ones_are_left() {
        let face = LimitedFace::new([0, 1, 2], REST, [Some(1.0); 3]);
        let flat: Vec<DVec3> = REST.iter().map(|place| place.extend(0.0)).collect();
        for (positions, limits) in [
            (flat.clone(), LIMITS),
            (vec![DVec3::ONE; 3], LIMITS),
            (strained().to_vec(), StrainLimits { min: 0.0, max: 1.4 }),
        ] {
            let mut state = State {
                positions: positions.clone(),
                velocities: vec![DVec3::ZERO; 3],
            };
            assert!(!face.limit(limits, DT, &mut state));
            assert_eq!(state.positions, positions);
        }
    }
}

//! The drape test (Cusick 1968): a disc of cloth, clamped between two smaller ones, hangs over
//! their rim. Its measures, from the shadow straight from above: how much of the disc it covers,
//! and how it is folded.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::geometry::{atan2, sin_cos};
use crate::{Cloth, Handles, Topology};

/// Cells of the shadow's raster `[m]`.
const CELL: f64 = 1e-3;
/// Directions in which the shadow's radius is measured.
const DIRECTIONS: usize = 360;
/// Directions of a sector of the profile.
const SECTOR: usize = 5;
/// Harmonics of the radius in which folds are counted.
const HARMONICS: usize = 16;
/// Height of a fold above the least radius `[m]` within so many directions on either side.
const FOLD: (f64, usize) = (2e-3, 30);
/// Distances that count as equal, in radii of the sheet.
const NEAR: f64 = 2e-3;

/// The measures of a draped disc. Lengths in m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drape {
    /// (A - A_disc)/(A_sheet - A_disc), A the area of the shadow on a raster of 1 mm.
    /// `[eq:drape-coefficient]`
    pub coefficient: f64,
    /// Folds of the hem: maxima of the shadow's radius (harmonics 0 to 16) at least 2 mm above the
    /// least radius within 30°.
    pub nodes: usize,
    /// Amplitudes of the harmonics 2 to 8 of the radius.
    pub harmonics: [f64; 7],
    /// Mean, least and largest radius of the shadow.
    pub radius: [f64; 3],
    /// The lowest point and the mean height of the hem, from the clamp.
    pub hem: [f64; 2],
    /// Largest radius in sectors of 5°, from +x towards +z.
    pub profile: Vec<f64>,
}

impl Drape {
    /// The measures of `cloth` at `positions` `[m]`, `[vertices]`; none if this is no drape test: a
    /// disc whose handles are a smaller disc in its middle, level and as wide as in the material.
    pub fn of(cloth: &Cloth, positions: &[Vec3]) -> Option<Self> {
        Self::measure(
            cloth.topology(),
            cloth.material_coordinates(),
            cloth.handles(),
            positions,
        )
    }

    /// The same of the parts of a cloth: material coordinates and positions `[m]`, `[vertices]`.
    pub fn measure(
        topology: &Topology,
        material: &[Vec2],
        handles: &Handles,
        positions: &[Vec3],
    ) -> Option<Self> {
        let held: Vec<usize> = handles.vertices().iter().map(|v| v.index()).collect();
        let is_boundary = topology.boundary_vertices();
        let boundary: Vec<usize> = (0..positions.len()).filter(|v| is_boundary[*v]).collect();
        let is_held = handles.mask(positions.len());
        let flat = |v: &usize| material.get(*v).map(|p| p.as_dvec2());
        let above = |v: &usize| DVec2::new(positions[*v].x.into(), positions[*v].z.into());
        let (middle, sheet) = round(boundary.iter().map(flat))?;
        let (clamped, clamp) = round(held.iter().map(flat))?;
        let (centre, held_radius) = round(held.iter().map(|v| Some(above(v))))?;
        let near = NEAR * sheet;
        let height = f64::from(positions[*held.first()?].y);
        let is_level = |v: &usize| (f64::from(positions[*v].y) - height).abs() < near;
        let is_hem = |v: &usize| flat(v).is_some_and(|p| (p.distance(middle) - sheet).abs() < near);
        let is_within = (0..positions.len()).all(|v| {
            let distance = flat(&v).map_or(0.0, |p| p.distance(middle));
            is_held[v] || distance > 0.8 * clamp
        });
        let holds = middle.distance(clamped) < near
            && (held_radius - clamp).abs() < near
            && clamp < 0.95 * sheet
            && held.len() > 2
            && held.iter().all(is_level)
            && boundary.iter().all(is_hem)
            && is_within;
        if !holds {
            return None;
        }
        let shadow = Shadow::new(topology, |v| above(&v) - centre);
        let radius = shadow.radius();
        let share = 1.0 / DIRECTIONS as f64;
        let [discs, sheets] = [clamp, sheet].map(|r| PI * r * r);
        let waves: Vec<DVec2> = (0..=HARMONICS).map(|k| wave(&radius, k)).collect();
        let depths = || boundary.iter().map(|v| f64::from(positions[*v].y) - height);
        Some(Self {
            coefficient: (shadow.area() - discs) / (sheets - discs),
            nodes: folds(&waves),
            harmonics: std::array::from_fn(|k| 2.0 * waves[k + 2].length()),
            radius: [
                radius.iter().sum::<f64>() * share,
                radius.iter().copied().fold(f64::INFINITY, f64::min),
                radius.iter().copied().fold(0.0, f64::max),
            ],
            hem: [
                depths().fold(f64::INFINITY, f64::min),
                depths().sum::<f64>() / boundary.len() as f64,
            ],
            profile: radius
                .chunks(SECTOR)
                .map(|r| r.iter().copied().fold(0.0, f64::max))
                .collect(),
        })
    }
}

/// The middle of the box around some points, and the largest distance from it.
fn round(points: impl Iterator<Item = Option<DVec2>> + Clone) -> Option<(DVec2, f64)> {
    let points: Vec<DVec2> = points.collect::<Option<_>>()?;
    let low = points.iter().copied().reduce(DVec2::min)?;
    let high = points.iter().copied().reduce(DVec2::max)?;
    let middle = 0.5 * (low + high);
    Some((
        middle,
        points
            .iter()
            .map(|p| p.distance(middle))
            .fold(0.0, f64::max),
    ))
}

/// The direction `n`, however often around.
fn turn(n: usize) -> DVec2 {
    let (sine, cosine) = sin_cos(TAU * (n % DIRECTIONS) as f64 / DIRECTIONS as f64);
    DVec2::new(cosine, sine)
}

/// Mean of the radius times e^(i k θ).
fn wave(radius: &[f64], k: usize) -> DVec2 {
    let sum: DVec2 = radius
        .iter()
        .enumerate()
        .map(|(n, r)| *r * turn(k * n))
        .sum();
    sum / DIRECTIONS as f64
}

/// Folds of a radius with these `waves`.
fn folds(waves: &[DVec2]) -> usize {
    let smooth: Vec<f64> = (0..DIRECTIONS)
        .map(|n| {
            let part = |(k, wave): (usize, &DVec2)| {
                (if k == 0 { 1.0 } else { 2.0 }) * wave.dot(turn(k * n))
            };
            waves.iter().enumerate().map(part).sum()
        })
        .collect();
    let at = |n: usize| smooth[n % DIRECTIONS];
    let is_fold = |&n: &usize| {
        let (height, reach) = FOLD;
        let around = (0..=2 * reach).map(|k| at(n + DIRECTIONS + k - reach));
        at(n) > at(n + DIRECTIONS - 1)
            && at(n) >= at(n + 1)
            && at(n) - around.fold(f64::INFINITY, f64::min) >= height
    };
    (0..DIRECTIONS).filter(is_fold).count()
}

/// The cells that a cloth covers, seen from above.
struct Shadow {
    low: DVec2,
    columns: usize,
    covered: Vec<bool>,
}

impl Shadow {
    /// The shadow of faces whose vertices are at `place` `[m]`.
    fn new(topology: &Topology, place: impl Fn(usize) -> DVec2) -> Self {
        let faces = || topology.face_indices().into_iter();
        let points = || faces().flatten().map(|v| place(v as usize));
        let low = points().fold(DVec2::INFINITY, DVec2::min);
        let low = (low / CELL).floor() * CELL;
        let cells = |p: DVec2| (p - low) / CELL - 0.5;
        let most = points().map(cells).fold(DVec2::ZERO, DVec2::max).ceil();
        let (columns, rows) = (most.x as usize + 1, most.y as usize + 1);
        let mut covered = vec![false; columns * rows];
        for face in faces() {
            let [a, b, c] = face.map(|v| cells(place(v as usize)));
            let (from, to) = (
                a.min(b).min(c).ceil().max(DVec2::ZERO),
                a.max(b).max(c).floor(),
            );
            let turn = (b - a).perp_dot(c - a);
            let is_inside = |p: DVec2| {
                let sides = [(a, b), (b, c), (c, a)];
                sides
                    .iter()
                    .all(|(s, e)| (*e - *s).perp_dot(p - *s) * turn >= 0.0)
            };
            for row in from.y as usize..=to.y.max(0.0) as usize {
                for column in from.x as usize..=to.x.max(0.0) as usize {
                    if row < rows
                        && column < columns
                        && is_inside(DVec2::new(column as f64, row as f64))
                    {
                        covered[row * columns + column] = true;
                    }
                }
            }
        }
        Self {
            low,
            columns,
            covered,
        }
    }

    /// Covered area `[m²]`.
    fn area(&self) -> f64 {
        self.covered.iter().filter(|is| **is).count() as f64 * CELL * CELL
    }

    /// Largest distance of a covered cell from the origin in each direction `[m]`.
    fn radius(&self) -> Vec<f64> {
        let mut radius = vec![0.0; DIRECTIONS];
        for (cell, _) in self.covered.iter().enumerate().filter(|(_, is)| **is) {
            let place = DVec2::new((cell % self.columns) as f64, (cell / self.columns) as f64);
            let place = self.low + (place + 0.5) * CELL;
            let turn = atan2(place.y, place.x) / TAU + 1.0;
            let direction: &mut f64 = &mut radius[(turn * DIRECTIONS as f64) as usize % DIRECTIONS];
            *direction = direction.max(place.length());
        }
        radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Shape, Sheet, SheetSpec, sheet};

    fn disc() -> Sheet {
        let spec = SheetSpec {
            shape: Shape::DrapeDisc,
            vertices: 2000,
            size: 0.3,
            width: None,
            seed: 1,
        };
        sheet(&spec).unwrap()
    }

    /// The measures of a disc of 150 mm, each vertex of it placed by polar coordinates.
    fn measured(place: impl Fn(f64, f64) -> Vec3) -> Option<Drape> {
        let Sheet { mesh, labels } = disc();
        let count = mesh.topology().vertex_count();
        let handles = Handles::new(&labels["clamped"], count).unwrap();
        let flat: Vec<Vec2> = mesh
            .material_coordinates()
            .iter()
            .map(|p| p.as_vec2())
            .collect();
        let positions: Vec<Vec3> = flat
            .iter()
            .map(|p| (p.as_dvec2() - 0.15).to_array())
            .map(|[x, z]| place(x.hypot(z), z.atan2(x)))
            .collect();
        Drape::measure(mesh.topology(), &flat, &handles, &positions)
    }

    #[test]
    fn waves_of_a_hem_have_their_folds_area_and_amplitude() {
        // Beyond the clamp the radius is drawn in by a wave of eight folds.
        let wave = |angle: f64| 1.0 - 0.3 * (1.0 - (8.0 * angle).cos());
        let drape = measured(|r, angle| {
            let r = if r > 0.09 { 0.09 + (r - 0.09) * wave(angle) } else { r };
            Vec3::new(
                (r * angle.cos()) as f32,
                (0.09 - r.max(0.09)) as f32,
                (r * angle.sin()) as f32,
            )
        })
        .unwrap();
        assert_eq!(drape.nodes, 8);
        // r = 0.132 + 0.018 cos 8θ.
        assert!(
            (drape.harmonics[6] - 0.018).abs() < 5e-4,
            "{:?}",
            drape.harmonics
        );
        assert!(
            drape.harmonics[..6].iter().all(|a| *a < 5e-4),
            "{:?}",
            drape.harmonics
        );
        assert!((drape.radius[0] - 0.132).abs() < 1e-3, "{:?}", drape.radius);
        let area = PI * (0.132_f64.powi(2) + 0.5 * 0.018_f64.powi(2));
        let expected = (area - PI * 0.0081) / (PI * 0.0144);
        assert!(
            (drape.coefficient - expected).abs() < 4e-3,
            "{}",
            drape.coefficient
        );
        assert_eq!(drape.profile.len(), 72);
        assert!((drape.hem[0] + 0.06).abs() < 1e-3, "{:?}", drape.hem);
    }

    #[test]
    fn only_a_level_disc_is_a_drape_test() {
        let flat = |r: f64, angle: f64| [(r * angle.cos()) as f32, (r * angle.sin()) as f32];
        let level =
            measured(|r, angle| Vec3::new(flat(r, angle)[0], 0.5, flat(r, angle)[1])).unwrap();
        assert!(
            (level.coefficient - 1.0).abs() < 5e-3,
            "{}",
            level.coefficient
        );
        assert_eq!(level.nodes, 0);
        let upright = measured(|r, angle| Vec3::new(flat(r, angle)[0], flat(r, angle)[1], 0.0));
        assert_eq!(upright, None);
    }
}

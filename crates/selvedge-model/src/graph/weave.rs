//! The elasticity of a cloth, edge by edge, for the features that tell a model how stiff its fabric
//! is: a spring in the place of each edge and a torque about each hinge, from the tables of the
//! fabrics. It is a measure of the forces, not the law of the solver.

use selvedge_cloth::{Cloth, EdgeSide, Material};

use crate::graph::Hinge;

/// The elastic elements of a cloth.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Weave {
    /// `[edges]`.
    pub(crate) springs: Vec<Spring>,
    /// `[hinges]`.
    pub(crate) torques: Vec<Torque>,
}

/// A spring in the place of an edge, which stiffens as its fabric does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spring {
    /// Length of the edge in the pattern `[m]`.
    pub(crate) length: f32,
    /// Without strain, and at the stretch of the measurements, 7/6 `[N/m]`.
    stiffness: [f32; 2],
}

/// The force with which a hinge bends back, on a wing of the mean height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Torque {
    /// Force per angle at the table's curvatures 0 to 4 `[N/rad]`.
    stiffness: [f32; 5],
    /// The table's curvature per angle `[1/rad]`.
    curvature: f32,
}

impl Weave {
    /// The elements of `cloth`, whose faces are of these `materials`, `[faces]`.
    pub(crate) fn new(cloth: &Cloth, hinges: &[Hinge], materials: &[&Material]) -> Self {
        let (pattern, edges) = (cloth.pattern(), cloth.topology().edges());
        let lengths = pattern.edge_lengths();
        let springs = edges.iter().zip(&lengths).map(|(edge, &length)| {
            let (left, right) = pattern.sides(edge);
            let mut stiffness = [0.0; 2];
            for side in [Some(left), right].into_iter().flatten() {
                let along = stretch_along(materials[side.face.index()], &side);
                let part = side.area() / (length * length);
                stiffness = std::array::from_fn(|k| stiffness[k] + part * along[k]);
            }
            Spring {
                length: length as f32,
                stiffness: stiffness.map(|k| k as f32),
            }
        });
        let torques = hinges.iter().map(|hinge| {
            let (left, right) = pattern.sides(&edges[hinge.edge as usize]);
            let sides = [left, right.unwrap_or(left)];
            let [first, second] = sides.map(|side| bend_along(materials[side.face.index()], &side));
            let (length, area) = (
                lengths[hinge.edge as usize],
                sides.iter().map(EdgeSide::area).sum::<f64>(),
            );
            let scale = length.powi(3) / (4.0 * area * area);
            Torque {
                stiffness: std::array::from_fn(|k| (0.5 * scale * (first[k] + second[k])) as f32),
                curvature: (0.1 * length / area) as f32,
            }
        });
        Self {
            springs: springs.collect(),
            torques: torques.collect(),
        }
    }
}

/// The direction of an edge in the pattern, folded into 0 to 90° from the course axis: cosine, sine
/// and angle `[rad]`.
fn direction(side: &EdgeSide<glam::Vec2>) -> [f64; 3] {
    let along = (side.ends[1] - side.ends[0]).as_dvec2().abs();
    let unit = along.normalize_or_zero();
    [unit.x, unit.y, unit.y.atan2(unit.x)]
}

/// Stiffness of a material stretched along an edge, without strain and at a stretch of 7/6 `[N/m]`:
/// n·S(n nᵀ) of the measured law, n the edge's direction.
fn stretch_along(material: &Material, side: &EdgeSide<glam::Vec2>) -> [f64; 2] {
    let [c, s, angle] = direction(side);
    let rows = &material.stretch.0;
    let place = (angle / std::f64::consts::FRAC_PI_8).clamp(0.0, 4.0);
    let low = (place as usize).min(3);
    let part = place - low as f64;
    let stretched: [f64; 4] =
        std::array::from_fn(|k| (1.0 - part) * rows[1 + low][k] + part * rows[2 + low][k]);
    [rows[0], stretched].map(|row| {
        let [k0, k1, k2, k3] = row.map(|k| 2.0 * k.max(0.0));
        k0 * c.powi(4) + k2 * s.powi(4) + 2.0 * (k1 + k3) * (c * s).powi(2)
    })
}

/// The bending table of a material for an edge in this direction `[N·m]`.
fn bend_along(material: &Material, side: &EdgeSide<glam::Vec2>) -> [f64; 5] {
    let [_, _, angle] = direction(side);
    let place = (angle / std::f64::consts::FRAC_PI_4).clamp(0.0, 2.0);
    let low = (place as usize).min(1);
    let (part, rows) = (place - low as f64, &material.bend.0);
    std::array::from_fn(|k| (1.0 - part) * rows[low][k] + part * rows[low + 1][k])
}

impl Spring {
    /// Strain of the edge at this length `[m]`.
    pub(crate) fn strain(&self, length: f32) -> f32 {
        length / self.length - 1.0
    }

    /// The pull of its ends on each other at this length `[N]`, and its derivative by the length
    /// `[N/m]`. `[eq:edge-pull]`
    pub(crate) fn pull(&self, length: f32) -> [f32; 2] {
        let ([soft, firm], longer) = (self.stiffness, length - self.length);
        let part = 6.0 * self.strain(length);
        let stiffness = soft + part.clamp(0.0, 1.0) * (firm - soft);
        let stiffens = part > 0.0 && part < 1.0;
        let growth = if stiffens { 6.0 / self.length * (firm - soft) } else { 0.0 };
        [stiffness * longer, stiffness + growth * longer]
    }
}

impl Torque {
    /// The force on a wing at this angle `[N]`, with the angle's sign, and its derivative by the
    /// angle `[N/rad]`. `[eq:hinge-push]`
    pub(crate) fn push(&self, angle: f32) -> [f32; 2] {
        let last = (self.stiffness.len() - 1) as f32;
        let curvature = self.curvature * angle.abs();
        let low = (curvature.min(last) as usize).min(self.stiffness.len() - 2);
        let rise = self.stiffness[low + 1] - self.stiffness[low];
        let stiffness = self.stiffness[low] + (curvature.min(last) - low as f32) * rise;
        let growth = if curvature < last { curvature * rise } else { 0.0 };
        [stiffness * angle, stiffness + growth]
    }
}

#[cfg(test)]
mod tests;

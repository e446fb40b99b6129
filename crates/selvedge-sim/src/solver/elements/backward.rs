//! Derivatives of λᵀ(b - A Δv) of a linearisation, by where it is linearised and by all numbers of
//! the elements.
//!
//! With λ = A⁻¹ g these are the derivatives of gᵀ Δv. The Jacobian J stands in b and in A alike, so that
//! both are one form λᵀ J w, w = γ (ahead + c) rates + γ (γ + c) Δv. Where J is the Hessian of an energy
//! the derivative of that form is symmetric in λ and w.

use glam::{DVec2, DVec3};
use selvedge_cloth::{Edge, FaceId, Scene};

use super::{Elements, Linearisation, StretchLaws, select};
use crate::laws::bend;
use crate::laws::external::{AirResistance, slow_air};
use crate::laws::stretch_energy::{EnergySums, Form};
use crate::state::State;

/// λᵀ(b - A Δv) of a solve.
pub(crate) struct Residual<'a> {
    pub(crate) at: Linearisation<'a>,
    /// v̄ of a stage `[m/s]`, `[vertices]`; none with backward Euler, which has no M (v̄ - v) in b.
    pub(crate) base: Option<&'a [DVec3]>,
    /// Δv `[m/s]`, `[vertices]`; 0 where held.
    pub(crate) changes: &'a [DVec3],
    /// λ, `[vertices]`; 0 where held.
    pub(crate) multipliers: &'a [DVec3],
}

/// Sums of derivatives by the numbers of the elements.
#[derive(Clone, Debug)]
pub(crate) struct ElementSums {
    pub(crate) gravity: DVec3,
    pub(crate) wind: DVec3,
    pub(crate) air_density: f64,
    pub(crate) air_drag: f64,
    /// By the mass of each vertex, `[vertices]`.
    pub(crate) mass: Vec<f64>,
    /// By the energy of each material, and by its damping.
    energies: Vec<EnergySums>,
    damping: Vec<f64>,
    /// By stiffness, rest angle, damping, length and area of each hinge.
    hinges: Vec<([f64; 5], f64, f64, [f64; 2])>,
    /// Sums T of each face, `[faces]`: corner k of its rest shape has the derivative T (∂u, ∂v) of its shape.
    faces: Vec<[[f64; 2]; 2]>,
    /// By the length in the pattern of each edge, up to the last one that has a derivative, `[edges]`.
    pub(crate) lengths: Vec<f64>,
}

/// Derivatives by the materials of a scene, by the rest angle of each edge, `[edges]`, and by the pattern,
/// `[points]`.
pub(crate) struct SceneSlopes {
    pub(crate) materials: Vec<MaterialGradient>,
    pub(crate) rest_angles: Vec<f64>,
    pub(crate) pattern: Vec<DVec2>,
}

/// Derivatives by the numbers of a material, as its file has them.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialGradient {
    /// By the density `[kg/m²]`.
    pub density: f64,
    /// By the damping `[s]`; 0 where `physics.least_damping` takes its place.
    pub damping: f64,
    /// By the table of stretching `[N/m]`, through the energy that is fitted to it. Those of a table
    /// that says the same at all strains are of all rows alike.
    pub stretch: [[f64; 4]; 6],
    /// By the table of bending `[N·m]`.
    pub bend: [[f64; 5]; 3],
}

impl Elements {
    /// Sums of 0.
    pub(crate) fn no_sums(&self) -> ElementSums {
        let energies = match &self.stretch_laws {
            StretchLaws::Energy(laws) => laws.iter().map(|law| law.no_sums()).collect(),
            StretchLaws::Grid(_) => Vec::new(),
        };
        ElementSums {
            gravity: DVec3::ZERO,
            wind: DVec3::ZERO,
            air_density: 0.0,
            air_drag: 0.0,
            mass: vec![0.0; self.mass.len()],
            energies,
            damping: vec![0.0; self.damping.len()],
            hinges: vec![Default::default(); self.hinges.count()],
            faces: vec![Default::default(); self.faces.count()],
            lengths: Vec::new(),
        }
    }

    /// Adds the derivatives of `residual` by positions and rates to `by`, those by numbers of the
    /// elements to `sums`, and λᵀM, that by v̄, to `by_base`. The law is an energy, and the air takes
    /// the rates.
    pub(crate) fn pull_back(
        &self,
        residual: &Residual<'_>,
        by: &mut State,
        mut by_base: Option<&mut [DVec3]>,
        sums: &mut ElementSums,
    ) {
        let at = residual.at;
        for (v, multiplier) in residual.multipliers.iter().enumerate() {
            let mass = self.mass[v];
            let mut moved = self.environment.gravity * at.dt - residual.changes[v];
            if let Some(base) = residual.base {
                moved += base[v] - at.rates[v];
                by.velocities[v] -= *multiplier * mass;
            }
            if let Some(by_base) = &mut by_base {
                by_base[v] += *multiplier * mass;
            }
            sums.mass[v] += multiplier.dot(moved);
            sums.gravity += *multiplier * (mass * at.dt);
        }
        self.pull_faces(residual, by, sums);
        let hinges = self.hinges.corners().zip(self.hinges.elements());
        for (k, (corners, element)) in hinges.enumerate() {
            let damping = self.hinges.damping(k);
            let push = Push::new(residual, &corners, damping);
            let places = select(at.positions, &corners);
            let slopes = element.slopes(at.dt, places, push.multipliers, push.w);
            let (stiffness, rest_angle, by_damping, by_shape) = &mut sums.hinges[k];
            for (sum, slope) in stiffness.iter_mut().zip(slopes.by_stiffness) {
                *sum += slope;
            }
            *rest_angle += slopes.by_rest_angle;
            for (sum, slope) in by_shape.iter_mut().zip(slopes.by_shape) {
                *sum += slope;
            }
            *by_damping += push.spread(&at, damping, &corners, slopes.by_w, by);
            for (corner, slope) in corners.iter().zip(slopes.by_places) {
                by.positions[*corner as usize] += slope;
            }
        }
    }

    fn pull_faces(&self, residual: &Residual<'_>, by: &mut State, sums: &mut ElementSums) {
        let StretchLaws::Energy(laws) = &self.stretch_laws else {
            return;
        };
        let at = residual.at;
        let elements = self.faces.corners().zip(self.faces.elements());
        for (face, (corners, (element, material))) in elements.enumerate() {
            let material = material as usize;
            let (law, damping) = (&laws[material], self.damping[material]);
            let push = Push::new(residual, &corners, damping);
            let places = select(at.positions, &corners);
            let ([fu, fv], [lu, lv], [wu, wv]) = (
                <[DVec3; 2]>::from(element.gradient(places)),
                <[DVec3; 2]>::from(element.gradient(push.multipliers)),
                <[DVec3; 2]>::from(element.gradient(push.w)),
            );
            let strained =
                |u: DVec3, v: DVec3| [fu.dot(u), fv.dot(v), 0.5 * (fu.dot(v) + fv.dot(u))];
            let form = Form {
                strain: element.strain(places),
                gamma: at.dt,
                l: strained(lu, lv),
                w: strained(wu, wv),
                x: [lu.dot(wu), lv.dot(wv), lu.dot(wv) + lv.dot(wu)],
            };
            let slopes = law.slopes(&form, -element.area, &mut sums.energies[material]);
            let [g, l, w] = [slopes.by_strain, slopes.by_l, slopes.by_w];
            let t = slopes.tension;
            // Entries 0 and 2/2 of u, 1 and 2/2 of v.
            let along = |s: [f64; 3], u: DVec3, v: DVec3| {
                [u * s[0] + v * (0.5 * s[2]), v * s[1] + u * (0.5 * s[2])]
            };
            let ([gu, gv], [a, b], [c, d]) = (along(g, fu, fv), along(l, lu, lv), along(w, wu, wv));
            let [eu, ev] = along(w, fu, fv);
            let spread = |u: DVec3, v: DVec3| -> [DVec3; 3] {
                std::array::from_fn(|k| {
                    (u * element.shape_u[k] + v * element.shape_v[k]) * -element.area
                })
            };
            let (eu, ev) = (eu + lu * t[0] + lv * t[2], ev + lv * t[1] + lu * t[2]);
            let by_w = spread(eu, ev);
            sums.damping[material] += push.spread(&at, damping, &corners, by_w, by);
            let (bu, bv) = (gu + a + c, gv + b + d);
            for (corner, slope) in corners.iter().zip(spread(bu, bv)) {
                by.positions[*corner as usize] += slope;
            }
            // By the shape, which makes gradients of three fields, and by the area: the form is one in λ.
            let [hu, hv] = along(l, fu, fv);
            let (hu, hv) = (hu + wu * t[0] + wv * t[2], hv + wv * t[1] + wu * t[2]);
            let fields = [[fu, lu, wu], [fv, lv, wv]];
            let form = hu.dot(lu) + hv.dot(lv);
            let air = self.pull_air(residual, element.area, &corners, by, sums);
            for (d, (row, of)) in sums.faces[face].iter_mut().zip(fields).enumerate() {
                for (c, (sum, by)) in row.iter_mut().zip([[bu, hu, eu], [bv, hv, ev]]).enumerate() {
                    let product: f64 = of.iter().zip(by).map(|(of, by)| of.dot(by)).sum();
                    let whole = if c == d { air - element.area * form } else { 0.0 };
                    *sum += whole + element.area * product;
                }
            }
        }
    }

    /// The part of the air on a face of this `area` `[m²]`; returns it.
    fn pull_air(
        &self,
        residual: &Residual<'_>,
        area: f64,
        corners: &[u32; 3],
        by: &mut State,
        sums: &mut ElementSums,
    ) -> f64 {
        let at = residual.at;
        let mean = |of: &[DVec3]| select(of, corners).into_iter().sum::<DVec3>() / 3.0;
        let [a, b, c] = select(at.positions, corners);
        let (first, second) = (b - a, c - a);
        let twice_area = first.cross(second);
        let length = twice_area.length();
        if length == 0.0 {
            return 0.0;
        }
        let n = twice_area / length;
        let air = &self.environment;
        let (density, drag) = (air.air_density, air.air_drag);
        let r = air.wind - mean(at.air_velocities);
        let (l, y) = (mean(residual.multipliers), mean(residual.changes));
        let factor = match at.air_resistance {
            AirResistance::Tangent => 2.0,
            AirResistance::None | AirResistance::Secant => 1.0,
        };
        let slow = slow_air(density);
        let (t, ln, yn) = (n.dot(r), n.dot(l), n.dot(y));
        let through = factor * density * t.abs() - drag;
        let by_t =
            2.0 * density * t.abs() * ln - drag * ln - factor * density * t.signum() * yn * ln;
        let by_ln = density * t.abs() * t - drag * t - through * yn;
        let scale = at.dt * area;
        let by_r = (n * by_t + l * (drag + slow)) * scale;
        let by_n = (r * by_t + l * by_ln - y * (through * ln)) * scale;
        let by_twice_area = (by_n - n * n.dot(by_n)) / length;
        let (by_first, by_second) = (second.cross(by_twice_area), by_twice_area.cross(first));
        let places = [-(by_first + by_second), by_first, by_second];
        for (corner, place) in corners.iter().zip(places) {
            by.positions[*corner as usize] += place;
            by.velocities[*corner as usize] -= by_r / 3.0;
        }
        sums.wind += by_r;
        let slowly = slow_air(1.0) * (l.dot(r) - l.dot(y));
        let by_density = scale * (t.abs() * t * ln + slowly - factor * t.abs() * yn * ln);
        let by_drag = scale * (l.dot(r) - t * ln + yn * ln - l.dot(y));
        sums.air_density += by_density;
        sums.air_drag += by_drag;
        density * by_density + drag * by_drag
    }

    /// The derivatives that `sums` are, by the numbers of `scene`.
    pub(crate) fn by_scene(&self, scene: &Scene, sums: &ElementSums) -> SceneSlopes {
        let (materials, material_of) = scene.materials();
        let mut by: Vec<MaterialGradient> = materials
            .iter()
            .map(|_| MaterialGradient {
                density: 0.0,
                damping: 0.0,
                stretch: [[0.0; 4]; 6],
                bend: [[0.0; 5]; 3],
            })
            .collect();
        if let StretchLaws::Energy(laws) = &self.stretch_laws {
            for (k, law) in laws.iter().enumerate() {
                by[k].stretch = law.by_table(&materials[k].stretch, &sums.energies[k]).0;
                by[k].damping = sums.damping[k];
            }
        }
        let mut faces = sums.faces.clone();
        let widen = |face: &mut [[f64; 2]; 2], by: f64| {
            face[0][0] += by;
            face[1][1] += by;
        };
        let elements = self.faces.corners().zip(self.faces.elements());
        for ((corners, (element, material)), face) in elements.zip(&mut faces) {
            let masses = corners.map(|corner| sums.mass[corner as usize]);
            let by_density = element.area / 3.0 * masses.iter().sum::<f64>();
            by[material as usize].density += by_density;
            widen(face, by_density * materials[material as usize].density);
        }
        let mesh = &scene.mesh;
        let (topology, pattern) = (mesh.topology(), mesh.pattern());
        let mut by_points = vec![DVec2::ZERO; pattern.points().len()];
        let mut pull_edge = |face: FaceId, edge: &Edge, by: DVec2| {
            for (vertex, sign) in edge.vertices.into_iter().zip([-1.0, 1.0]) {
                let corner = topology.faces()[face.index()]
                    .iter()
                    .position(|v| *v == vertex);
                let point = pattern.corner_points(face)[corner.unwrap_or_default()];
                by_points[point as usize] += by * sign;
            }
        };
        for (edge, by_length) in topology.edges().iter().zip(&sums.lengths) {
            let (left, right) = pattern.sides(edge);
            let part = if right.is_some() { 0.5 } else { 1.0 };
            for side in [Some(left), right].into_iter().flatten() {
                let along = side.ends[1] - side.ends[0];
                pull_edge(side.face, edge, along.normalize() * (part * by_length));
            }
        }
        let factors = crate::solver::even::factors(scene);
        let mut rest_angles = vec![0.0; topology.edges().len()];
        let mut by_factors = rest_angles.clone();
        let mut hinges = sums.hinges.iter();
        for (number, edge) in topology.edges().iter().enumerate() {
            let (left, Some(right)) = pattern.sides(edge) else {
                continue;
            };
            let Some((stiffness, rest_angle, damping, [by_length, by_area])) = hinges.next() else {
                break;
            };
            rest_angles[number] = *rest_angle;
            for side in [left, right] {
                let material = material_of[side.face.index()];
                by[material].damping += 0.5 * damping;
                let half = stiffness.map(|k| 0.5 * factors[number] * k);
                let (along, table) = (side.ends[1] - side.ends[0], &materials[material].bend);
                let plain = bend::stiffness_along(table, along);
                let by_plain = stiffness.iter().zip(plain).map(|(by, k)| 0.5 * by * k);
                by_factors[number] += by_plain.sum::<f64>();
                let turned = bend::pull_stiffness(along, table, half, &mut by[material].bend);
                let by_along = along.normalize() * (0.5 * by_length) + turned;
                pull_edge(side.face, edge, by_along);
                widen(&mut faces[side.face.index()], by_area * side.area());
            }
        }
        crate::solver::even::pull_factors(scene, &by_factors, &mut by_points);
        for (by, material) in by.iter_mut().zip(&materials) {
            if scene.physics.damping(material.damping) > material.damping {
                by.damping = 0.0;
            }
        }
        let corners = pattern.corners().into_iter().zip(self.faces.elements());
        for ((points, (element, _)), face) in corners.zip(faces) {
            for (k, point) in points.into_iter().enumerate() {
                let shape = [element.shape_u[k], element.shape_v[k]];
                let [u, v] = face.map(|row| row[0] * shape[0] + row[1] * shape[1]);
                by_points[point as usize] += DVec2::new(u, v);
            }
        }
        SceneSlopes {
            materials: by,
            rest_angles,
            pattern: by_points,
        }
    }
}

/// λ and w at the corners of an element.
struct Push<const N: usize> {
    multipliers: [DVec3; N],
    /// γ rates + γ Δv, whose factor is the damping.
    damped: [DVec3; N],
    w: [DVec3; N],
}

impl<const N: usize> Push<N> {
    fn new(residual: &Residual<'_>, corners: &[u32; N], damping: f64) -> Self {
        let at = &residual.at;
        let rates = select(at.rates, corners);
        let changes = select(residual.changes, corners);
        let (rate, jacobian) = (at.rate(damping), at.jacobian(damping));
        Self {
            multipliers: select(residual.multipliers, corners),
            damped: std::array::from_fn(|k| (rates[k] + changes[k]) * at.dt),
            w: std::array::from_fn(|k| rates[k] * rate + changes[k] * jacobian),
        }
    }

    /// Adds the derivatives by rates, from those by w. Returns that by the damping.
    fn spread(
        &self,
        at: &Linearisation<'_>,
        damping: f64,
        corners: &[u32; N],
        by_w: [DVec3; N],
        by: &mut State,
    ) -> f64 {
        let rate = at.rate(damping);
        let mut by_damping = 0.0;
        for (k, corner) in corners.iter().enumerate() {
            by.velocities[*corner as usize] += by_w[k] * rate;
            by_damping += by_w[k].dot(self.damped[k]);
        }
        by_damping
    }
}

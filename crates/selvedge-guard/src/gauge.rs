//! Measures of two consecutive frames: strains of the edges and speeds of the vertices. They need
//! no material, and take one pass over the edges and one over the vertices.

use glam::Vec3;

/// Measures of two consecutive frames of a cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Largest strain (l - l₀)/l₀ of an edge in the later frame, against the material.
    pub largest_strain: f64,
    /// Smallest strain of an edge in the later frame.
    pub smallest_strain: f64,
    /// ε = √(mean over edges of ((l - l₀)/l₀)²). In a cloth of uniform stiffness the elastic energy
    /// is proportional to ε². The largest strain tells of one edge, ε of the whole cloth.
    pub strain_rms: f64,
    /// Kinetic energy over mass, Σ m |v|²/(2 Σ m) with v = (p - p₋) · frame rate `[J/kg]`.
    pub kinetic_energy: f64,
    /// Largest speed of a vertex between the frames `[m/s]`.
    pub largest_speed: f64,
}

/// Measures frames of one cloth.
pub(crate) struct Gauge {
    edges: Vec<[u32; 2]>,
    /// Lengths in material space `[m]`, `[edges]`.
    lengths: Vec<f64>,
    /// Share of each vertex in the total mass, `[vertices]`.
    shares: Vec<f64>,
    frame_rate: f64,
}

impl Gauge {
    /// A gauge of a cloth with these `edges`, their `lengths` in material space `[m]`, `[edges]`,
    /// all positive, and vertices of `mass` `[kg]`, `[vertices]`.
    pub(crate) fn new(
        edges: Vec<[u32; 2]>,
        lengths: Vec<f64>,
        mass: &[f32],
        frame_rate: f64,
    ) -> Self {
        let whole: f64 = mass.iter().map(|&m| f64::from(m)).sum();
        Self {
            edges,
            lengths,
            shares: mass.iter().map(|&m| f64::from(m) / whole).collect(),
            frame_rate,
        }
    }

    /// Mean length of an edge in material space `[m]`.
    pub(crate) fn mean_length(&self) -> f64 {
        self.lengths.iter().sum::<f64>() / self.lengths.len().max(1) as f64
    }

    /// Measures the frame `now` after the frame `before` `[m]`, `[vertices]`. A position that is
    /// not finite makes the measures so. `[eq:trust]`
    pub(crate) fn measure(&self, before: &[Vec3], now: &[Vec3]) -> Measured {
        let mut measured = Measured {
            largest_strain: f64::NEG_INFINITY,
            smallest_strain: f64::INFINITY,
            ..Measured::default()
        };
        for (ends, length) in self.edges.iter().zip(&self.lengths) {
            let [a, b] = ends.map(|v| now[v as usize].as_dvec3());
            let strain = (a.distance(b) - length) / length;
            measured.largest_strain = larger(measured.largest_strain, strain);
            measured.smallest_strain = -larger(-measured.smallest_strain, -strain);
            measured.strain_rms += strain * strain;
        }
        measured.strain_rms = (measured.strain_rms / self.edges.len() as f64).sqrt();
        for ((p, q), share) in now.iter().zip(before).zip(&self.shares) {
            let speed = p.as_dvec3().distance(q.as_dvec3()) * self.frame_rate;
            measured.largest_speed = larger(measured.largest_speed, speed);
            measured.kinetic_energy += 0.5 * share * speed * speed;
        }
        measured
    }
}

/// The larger of two numbers; NaN if one of them is NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use selvedge_cloth::generate::square;

    fn gauge() -> (Gauge, Vec<Vec3>) {
        let mesh = square(40, 1.0, 2).unwrap().mesh;
        let flat = mesh.material_coordinates();
        let edges: Vec<[u32; 2]> = mesh
            .topology()
            .edges()
            .iter()
            .map(|edge| edge.vertices.map(|v| v.0))
            .collect();
        let lengths = edges
            .iter()
            .map(|[a, b]| flat[*a as usize].distance(flat[*b as usize]))
            .collect();
        let mass: Vec<f32> = (0..40).map(|v| 0.001 * (1 + v % 3) as f32).collect();
        let positions = mesh.positions().iter().map(|p| p.as_vec3()).collect();
        (Gauge::new(edges, lengths, &mass, 50.0), positions)
    }

    #[test]
    fn a_sheet_stretched_and_moved_has_its_closed_form() {
        let (gauge, flat) = gauge();
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.0, -0.4));
        let moved = |scale: f64, shift: DVec3| -> Vec<Vec3> {
            let place = |p: &Vec3| (scale * (turn * p.as_dvec3()) + shift).as_vec3();
            flat.iter().map(place).collect()
        };
        let step = DVec3::new(0.02, -0.01, 0.02);
        let measured = gauge.measure(&moved(1.25, DVec3::ONE), &moved(1.25, DVec3::ONE + step));
        // Positions of 2 m are rounded by 1e-7 m, edges are 0.1 m and longer, frames 1/50 s apart.
        for strain in [
            measured.largest_strain,
            measured.smallest_strain,
            measured.strain_rms,
        ] {
            assert!((strain - 0.25).abs() < 4e-6, "{strain}");
        }
        let speed = step.length() * 50.0;
        assert!((measured.largest_speed - speed).abs() < 2e-5);
        assert!((measured.kinetic_energy - 0.5 * speed * speed).abs() < 3e-5);
    }

    #[test]
    fn energy_is_that_of_the_masses_and_strains_are_told_apart() {
        let (gauge, flat) = gauge();
        let mut now = flat.clone();
        now[20].x += 0.1;
        let measured = gauge.measure(&flat, &now);
        // Only vertex 20 moves, by 0.1 m in 1/50 s.
        let share = gauge.shares[20];
        assert!((measured.kinetic_energy - 0.5 * share * 25.0).abs() < 1e-5);
        // It moves across its plane. By Pythagoras the shortest edge is strained most.
        let edges = gauge.edges.iter().zip(&gauge.lengths);
        let here = edges
            .filter(|(ends, _)| ends.contains(&20))
            .map(|(_, l)| *l);
        let shortest = here.fold(f64::INFINITY, f64::min);
        let expected = (shortest.hypot(0.1) - shortest) / shortest;
        assert!((measured.largest_strain - expected).abs() < 1e-5);
        assert!(measured.smallest_strain.abs() < 2e-6);
        now[3] = Vec3::NAN;
        let measured = gauge.measure(&flat, &now);
        assert!(measured.largest_strain.is_nan() && measured.smallest_strain.is_nan());
        assert!(measured.largest_speed.is_nan() && measured.kinetic_energy.is_nan());
    }
}

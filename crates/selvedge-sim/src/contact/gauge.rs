//! What contact left in frames that are there already: intersections, and the smallest gap.

use glam::{DVec3, Vec3};
use selvedge_cloth::Scene;
use selvedge_contact::{Candidates, Reach, Ways, gap};

use super::{Contact, YieldedContact};

/// Measures the frames of a scene with contact.
pub struct ContactGauge {
    contact: Contact,
    candidates: Candidates,
    points: Vec<DVec3>,
    rate: f64,
    yielded: Vec<YieldedContact>,
}

/// Contact in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameContact {
    /// Pairs of faces that meet, exactly, of the cloth with itself and with obstacles.
    pub intersections: usize,
    /// Smallest gap of two features without a common vertex `[m]`; none where no gap is below the
    /// thickness.
    pub smallest_gap: Option<f64>,
}

impl ContactGauge {
    /// The gauge of a validated scene; none if that has no contact.
    #[must_use]
    pub fn of(scene: &Scene) -> Option<Self> {
        let contact = Contact::of(scene, &vec![0.0; scene.mesh.positions().len()])?;
        let touches_itself = contact.settings.self_contact;
        let points = contact.start.clone();
        Some(Self {
            candidates: Candidates::new(&contact.surface, &points, touches_itself),
            contact,
            points,
            rate: scene.frame_rate,
            yielded: Vec::new(),
        })
    }

    /// The same gauge, which leaves out contact that was released in the frames in which it was.
    #[must_use]
    pub fn without(mut self, yielded: &[YieldedContact]) -> Self {
        self.yielded = yielded.to_vec();
        self
    }

    /// Measures `positions` `[m]`, `[vertices]`, of frame `frame`, as they are in single precision.
    pub fn measure(&mut self, frame: usize, positions: &[Vec3]) -> FrameContact {
        if !self.yielded.is_empty() {
            let all = self.yielded.iter();
            let now = all.filter(|one| (one.frames[0]..=one.frames[1]).contains(&frame));
            let now: Vec<_> = now.map(|one| one.released).collect();
            self.candidates.release(&now);
            self.contact.candidates.release(&now);
        }
        let cloth: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
        let met = self.contact.intersections(&cloth, frame, self.rate);
        self.points.clear();
        self.points.extend(&cloth);
        let time = frame as f64 / self.rate;
        for obstacle in &self.contact.obstacles {
            self.points.extend(obstacle.positions_at(time));
        }
        let thickness = self.contact.largest_thickness();
        let reach = Reach {
            gap: thickness,
            slack: 0.0,
        };
        let (surface, points) = (&self.contact.surface, &self.points);
        self.candidates.find(surface, Ways::still(points), reach);
        let gaps = self.candidates.pairs().iter().map(|pair| {
            let corners = pair.corners.map(|p| points[p as usize]);
            gap(pair.kind, corners).distance
        });
        let smallest = gaps.fold(f64::INFINITY, f64::min);
        FrameContact {
            intersections: met.len(),
            smallest_gap: (smallest < thickness).then_some(smallest),
        }
    }
}

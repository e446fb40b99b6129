//! What contact left in frames that are there already: intersections, and the smallest gap.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use selvedge_cloth::Scene;
use selvedge_contact::{Reach, Ways, gap};

use super::{Contact, YieldedContact};

/// Measures the frames of a scene with contact.
pub struct ContactGauge {
    contact: Contact,
    rate: f64,
    yielded: Vec<YieldedContact>,
    /// Points `[m]` and contact of the last frame: a cloth that rests has many alike.
    last: Option<(Vec<DVec3>, FrameContact)>,
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
    pub fn of(scene: &Scene) -> Option<Self> {
        Some(Self {
            contact: Contact::of(scene, &vec![0.0; scene.mesh.positions().len()])?,
            rate: scene.frame_rate,
            yielded: Vec::new(),
            last: None,
        })
    }

    /// The same gauge, which leaves out contact that was released in the frames in which it was.
    pub fn without(mut self, yielded: &[YieldedContact]) -> Self {
        self.yielded = yielded.to_vec();
        self
    }

    /// Measures the frames of a run, of which `positions` `[m]`, `[frames * vertices]`, has those from
    /// `first` on, on the threads of rayon's pool; `yielded` is left out. Hears from `on_frame`, on
    /// any thread, whether to go on. Gives each frame that was measured, in order, with its number;
    /// none without contact.
    pub fn measure_run(
        scene: &Scene,
        yielded: &[YieldedContact],
        first: usize,
        positions: &[Vec3],
        on_frame: &(dyn Fn() -> ControlFlow<()> + Sync),
    ) -> Option<Vec<(usize, FrameContact)>> {
        scene.contact.as_ref()?;
        let vertices = scene.mesh.positions().len();
        // Every piece needs a gauge of its own, with a copy of the obstacles.
        let pieces = 4 * rayon::current_num_threads();
        let frames = (positions.len() / vertices).div_ceil(pieces).max(1);
        let of_chunk = |(chunk, positions): (usize, &[Vec3])| {
            let mut gauge = None;
            let mut found = Vec::new();
            for (k, positions) in positions.chunks(vertices).enumerate() {
                if on_frame().is_break() {
                    break;
                }
                if gauge.is_none() {
                    gauge = Self::of(scene).map(|gauge| gauge.without(yielded));
                }
                let frame = first + frames * chunk + k;
                let measured = gauge.as_mut().map(|gauge| gauge.measure(frame, positions));
                found.extend(measured.map(|measured| (frame, measured)));
            }
            found
        };
        let chunks = positions.par_chunks(frames * vertices).enumerate();
        Some(chunks.flat_map_iter(of_chunk).collect())
    }

    /// Measures `positions` `[m]`, `[vertices]`, of frame `frame`, as they are in single precision.
    pub fn measure(&mut self, frame: usize, positions: &[Vec3]) -> FrameContact {
        if !self.yielded.is_empty() {
            let all = self.yielded.iter();
            let now = all.filter(|one| (one.frames[0]..=one.frames[1]).contains(&frame));
            let now: Vec<_> = now.map(|one| one.released).collect();
            self.contact.candidates.release(&now);
        }
        let mut points: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
        let contact = &mut self.contact;
        points.extend(contact.body_points(frame, self.rate));
        if let Some((same, measured)) = &self.last
            && *same == points
        {
            return *measured;
        }
        let met = contact.written_intersections(positions, frame, self.rate);
        let thickness = contact.largest_thickness();
        let reach = Reach {
            gap: thickness,
            slack: 0.0,
            own_slack: 0.0,
        };
        let candidates = &mut contact.candidates;
        candidates.find(&contact.mesh, Ways::still(&points), reach);
        let pairs = candidates.pairs().iter();
        let surface = &contact.mesh;
        let gaps = pairs
            .map(|pair| gap(pair.kind, pair.places(&points)).distance - surface.radius_of(pair));
        let smallest = gaps.fold(f64::INFINITY, f64::min);
        let measured = FrameContact {
            intersections: met.len(),
            smallest_gap: (smallest < thickness).then_some(smallest),
        };
        self.last = self.yielded.is_empty().then_some((points, measured));
        measured
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use selvedge_cloth::bodies::plane;
    use selvedge_cloth::generate::square;
    use selvedge_cloth::{ContactSettings, Handles, Obstacle};

    use super::*;

    /// A hanging sheet of 36 vertices that sinks through the ground, by a centimetre a frame.
    fn sinking() -> (Scene, Vec<Vec3>) {
        let mesh = square(36, 1.0, 1).unwrap().mesh;
        let material = toml::from_str(selvedge_assets::MATERIALS[0].1).unwrap();
        let frames = (0..41).flat_map(|frame| {
            let way = DVec3::Y * (0.2 - 0.01 * frame as f64);
            let moved = mesh.positions().iter().map(move |p| (*p + way).as_vec3());
            moved.collect::<Vec<_>>()
        });
        let frames = frames.collect();
        let handles = Handles::new(&[], 36).unwrap();
        let mut scene = Scene::of("sinking", mesh, handles, material);
        scene.contact = Some(ContactSettings::default());
        let ground = plane([4.0; 2]);
        let points = ground.points.iter().map(|p| *p - DVec3::Y).collect();
        scene.obstacles = vec![Obstacle::new("ground", points, ground.faces).unwrap()];
        (scene, frames)
    }

    #[test]
    fn a_run_is_measured_as_its_frames_are() {
        let (scene, positions) = sinking();
        let mut gauge = ContactGauge::of(&scene).unwrap();
        let frames = positions.chunks(36).zip(5..);
        let each: Vec<_> = frames
            .map(|(positions, frame)| (frame, gauge.measure(frame, positions)))
            .collect();
        let go_on = || ControlFlow::Continue(());
        let all = ContactGauge::measure_run(&scene, &[], 5, &positions, &go_on).unwrap();
        assert_eq!(all, each);
        let meets = all
            .iter()
            .filter(|(_, found)| found.intersections > 0)
            .count();
        assert!((10..30).contains(&meets), "{meets}");
    }

    #[test]
    fn a_measurement_that_is_stopped_has_no_more_frames() {
        let (scene, positions) = sinking();
        let heard = AtomicUsize::new(0);
        let stop = || match heard.fetch_add(1, Ordering::Relaxed) {
            0..4 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        };
        let found = ContactGauge::measure_run(&scene, &[], 0, &positions, &stop).unwrap();
        assert_eq!(found.len(), 4);
    }

    #[test]
    fn a_scene_without_contact_has_no_gauge() {
        let (mut scene, positions) = sinking();
        scene.contact = None;
        let go_on = || ControlFlow::Continue(());
        assert!(ContactGauge::measure_run(&scene, &[], 0, &positions, &go_on).is_none());
    }
}

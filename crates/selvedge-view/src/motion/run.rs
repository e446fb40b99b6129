//! Runs: the frames of a motion, borrowed and checked once.

use std::fmt::Display;

use glam::{Vec2, Vec3};
use selvedge_cloth::{Topology, VertexId};

use super::body::Body;
use crate::{Rgb, ViewError};

/// A body this many times as long as the cloth is large, and a point this many times its length
/// away is far.
const LARGE: f32 = 4.0;
const FAR: f32 = 4.0;

/// The motion of one cloth. Every frame has the mesh's vertices, and all of them are finite.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    topology: &'a Topology,
    frames: Vec<&'a [Vec3]>,
    handles: &'a [VertexId],
    frame_rate: f64,
    bodies: Vec<Body<'a>>,
    /// The colour of the cloth's front, where it is said.
    pub(crate) colour: Option<Rgb>,
    /// The places of each face's corners on the fabric `[m]`; none where they are not said.
    pub(crate) fabric: Vec<[Vec2; 3]>,
}

impl<'a> Run<'a> {
    /// Frames of positions `[m]`, `[frames, vertices]`, at `frame_rate` `[1/s]`. The `handles` are
    /// marked in pictures.
    pub fn new(
        topology: &'a Topology,
        frames: impl IntoIterator<Item = &'a [Vec3]>,
        handles: &'a [VertexId],
        frame_rate: f64,
    ) -> Result<Self, ViewError> {
        let frames: Vec<&[Vec3]> = frames.into_iter().collect();
        let vertex_count = topology.vertex_count();
        if frames.is_empty() {
            return Err(ViewError::empty_run());
        }
        if !(frame_rate.is_finite() && frame_rate > 0.0) {
            return Err(ViewError::Invalid(format!(
                "the frame rate must be finite and positive, found {frame_rate} frames per second"
            )));
        }
        if let Some(&vertex) = handles.iter().find(|v| v.index() >= vertex_count) {
            return Err(ViewError::Invalid(format!(
                "handle vertex {vertex} is out of range: the mesh has {vertex_count} vertices"
            )));
        }
        for (frame, positions) in frames.iter().enumerate() {
            check_frame(frame, positions, vertex_count)?;
        }
        Ok(Self {
            topology,
            frames,
            handles,
            frame_rate,
            bodies: Vec::new(),
            colour: None,
            fabric: Vec::new(),
        })
    }

    /// The same run of a cloth whose front has this colour; its back is paler.
    pub fn in_colour(mut self, colour: Rgb) -> Self {
        self.colour = Some(colour);
        self
    }

    /// The same run of a cloth that is woven: the places of each face's corners on the flat fabric
    /// `[m]`, `[faces, 3]`.
    pub fn woven(mut self, fabric: Vec<[Vec2; 3]>) -> Self {
        debug_assert_eq!(fabric.len(), self.topology.faces().len());
        self.fabric = fabric;
        self
    }

    /// The same run with bodies beside the cloth, still or with as many frames.
    pub fn with_bodies(mut self, bodies: Vec<Body<'a>>) -> Self {
        let frames = [1, self.frames.len()];
        let fits = |body: &Body<'_>| frames.contains(&body.frame_count());
        debug_assert!(bodies.iter().all(fits));
        self.bodies = bodies;
        self
    }

    /// Height of the lowest floor among the bodies: one that is still, level and much larger than
    /// the cloth `[m]`. The backdrop shows it.
    pub(crate) fn floor(&self) -> Option<f32> {
        let large = self.bodies.iter().filter(|body| self.is_large(body));
        large.filter_map(Body::level).reduce(f32::min)
    }

    /// The bodies that are drawn: all but floors.
    pub(crate) fn props(&self) -> impl Iterator<Item = &Body<'a>> {
        let is_floor = |body: &Body<'_>| self.is_large(body) && body.level().is_some();
        self.bodies.iter().filter(move |body| !is_floor(body))
    }

    /// Points of the bodies in a frame that pictures hold whole: of all but large ones, and those
    /// that are far from the cloth.
    pub(crate) fn body_points(&self, frame: usize) -> impl Iterator<Item = Vec3> {
        let cloth = self.frames[frame];
        let (here, far) = (cloth[0], FAR * longest_side(cloth));
        let small = self.bodies.iter().filter(|body| !self.is_large(body));
        small
            .flat_map(move |body| body.points(frame).iter().copied())
            .filter(move |point| point.distance(here) < far)
    }

    /// Returns true for a body that is much larger than the cloth.
    fn is_large(&self, body: &Body<'_>) -> bool {
        longest_side(body.points(0)) > LARGE * longest_side(self.frames[0])
    }

    /// The connectivity.
    pub fn topology(&self) -> &'a Topology {
        self.topology
    }

    /// Positions in each frame `[m]`, `[frames, vertices]`.
    pub fn frames(&self) -> &[&'a [Vec3]] {
        &self.frames
    }

    /// The vertices that are marked as handles.
    pub fn handles(&self) -> &'a [VertexId] {
        self.handles
    }

    /// Frames per second.
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }

    /// Time of a frame since the first `[s]`.
    pub fn time(&self, frame: usize) -> f64 {
        frame as f64 / self.frame_rate
    }

    /// Checks that another run has the same clock; the labels are those of both.
    pub(crate) fn check_clock(&self, other: &Run<'_>, labels: [&str; 2]) -> Result<(), ViewError> {
        let frames = [self, other].map(|run| run.frames.len());
        check_same("frames", frames, labels)?;
        let rates = [self.frame_rate, other.frame_rate];
        check_same("frames per second", rates, labels)
    }

    /// Checks that another run has the same clock and number of vertices.
    pub(crate) fn check_match(&self, other: &Run<'_>, labels: [&str; 2]) -> Result<(), ViewError> {
        self.check_clock(other, labels)?;
        let vertices = [self, other].map(|run| run.topology.vertex_count());
        check_same("vertices", vertices, labels)
    }
}

/// Longest side of the box around `points` `[m]`.
fn longest_side(points: &[Vec3]) -> f32 {
    let (low, high) = points
        .iter()
        .fold((Vec3::MAX, Vec3::MIN), |(low, high), p| {
            (low.min(*p), high.max(*p))
        });
    (high - low).max_element()
}

/// Checks that a number of two runs with these labels is the same.
fn check_same<T: PartialEq + Display>(
    what: &str,
    [expected, found]: [T; 2],
    [first, other]: [&str; 2],
) -> Result<(), ViewError> {
    if expected == found {
        return Ok(());
    }
    Err(ViewError::Invalid(format!(
        "panel \"{other}\" has {found} {what}, but panel \"{first}\" has {expected}: panels side by side must match"
    )))
}

fn check_frame(frame: usize, positions: &[Vec3], expected: usize) -> Result<(), ViewError> {
    let found = positions.len();
    if found != expected {
        return Err(ViewError::Invalid(format!(
            "frame {frame} has {found} vertices, but the mesh has {expected}"
        )));
    }
    match positions.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(ViewError::Invalid(format!(
            "frame {frame}: the position of vertex {vertex} is not finite: {}",
            positions[vertex]
        ))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Topology {
        Topology::new(3, &[[0, 1, 2]]).unwrap()
    }

    #[test]
    fn a_picture_holds_no_body_that_is_far_or_large() {
        let topology = triangle();
        let cloth = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let at = |place: Vec3, size: f32| {
            let points = cloth.map(|point| place + size * point).to_vec();
            Body::new(&[[0, 1, 2]], [points.into()])
        };
        let run = Run::new(&topology, [&cloth[..]], &[], 60.0).unwrap();
        for (place, size, held) in [
            (Vec3::Z, 1.0, 3),
            (Vec3::Z, 5.0, 0),
            (1000.0 * Vec3::Z, 1.0, 0),
        ] {
            let run = run.clone().with_bodies(vec![at(place, size)]);
            assert_eq!(run.body_points(0).count(), held, "{place} {size}");
        }
    }

    #[test]
    fn each_defect_of_a_run_has_its_message() {
        let topology = triangle();
        let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let bad = [Vec3::ZERO, Vec3::new(1.0, f32::NAN, 0.0), Vec3::Y];
        let run = |frames: &[&'static [Vec3]], handles: &'static [VertexId], rate| {
            Run::new(&topology, frames.to_vec(), handles, rate)
                .map(|_| ())
                .unwrap_err()
                .to_string()
        };
        let good: &'static [Vec3] = good.to_vec().leak();
        let bad: &'static [Vec3] = bad.to_vec().leak();
        assert_eq!(
            run(&[], &[], 60.0),
            "the run has no frames: there is nothing to show"
        );
        assert_eq!(
            run(&[good, &good[..2]], &[], 60.0),
            "frame 1 has 2 vertices, but the mesh has 3"
        );
        assert_eq!(
            run(&[good, bad], &[], 60.0),
            "frame 1: the position of vertex 1 is not finite: [1, NaN, 0]"
        );
        assert_eq!(
            run(&[good], &[VertexId(3)], 60.0),
            "handle vertex 3 is out of range: the mesh has 3 vertices"
        );
        assert!(run(&[good], &[], 0.0).contains("found 0 frames per second"));
    }
}

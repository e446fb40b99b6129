//! Frames of a trajectory as they are exported: which of them, and which axis points up.

use super::options::{ExportFormat, ExportOptions};
use super::outcome::ExportError;
use crate::UpAxis;
use crate::trajectory::Trajectory;
use glam::{DVec3, Vec3};

/// Frames of a trajectory, in the axes of a file.
#[derive(Clone, Debug)]
pub(super) struct Take<'a> {
    pub(super) trajectory: &'a Trajectory,
    frames: Vec<usize>,
    /// Every how many frames one is taken.
    pub(super) every: usize,
    /// Axis that points up.
    pub(super) up: UpAxis,
    /// True where normals are wanted.
    pub(super) normals: bool,
    /// True where velocities are wanted.
    pub(super) velocities: bool,
}

impl<'a> Take<'a> {
    /// The frames of `trajectory` that `options` choose.
    pub(super) fn new(
        trajectory: &'a Trajectory,
        options: &ExportOptions,
    ) -> Result<Self, ExportError> {
        let frames = options.frames.of(trajectory.frame_count())?;
        let refused = |problem: &str| Err(ExportError::refused(problem));
        match options.format {
            format if format.holds_one_frame() && frames.len() > 1 => {
                return refused(&format!(
                    "an .obj file holds one frame, and {} were asked for: choose one, or a folder for all of them",
                    frames.len()
                ));
            }
            ExportFormat::Glb if options.up == UpAxis::Z => {
                return refused("glTF has y up: the axis cannot be chosen");
            }
            format if !format.has_velocities() && options.velocities => {
                return refused(
                    "the format has no velocities: leave them out, or take USD or Alembic",
                );
            }
            _ => {}
        }
        Ok(Self {
            trajectory,
            frames,
            every: options.frames.every,
            up: options.up,
            normals: options.normals,
            velocities: options.velocities,
        })
    }

    /// Number of frames taken.
    pub(super) fn len(&self) -> usize {
        self.frames.len()
    }

    /// Frames of the trajectory between the first one taken and the one taken as `number`.
    pub(super) fn frames_since_first(&self, number: usize) -> usize {
        self.frames[number] - self.frames[0]
    }

    /// When the frame taken as `number` is `[s]`; the first is at 0.
    pub(super) fn time(&self, number: usize) -> f64 {
        self.frames_since_first(number) as f64 / self.trajectory.frame_rate()
    }

    /// Positions in the frame taken as `number` `[m]`, `[vertices]`.
    pub(super) fn positions(&self, number: usize) -> Vec<Vec3> {
        self.turned(self.trajectory.frame(self.frames[number]))
    }

    /// Velocities in the frame taken as `number` `[m/s]`, `[vertices]`.
    pub(super) fn velocities(&self, number: usize) -> Vec<Vec3> {
        self.slopes(number, |frame| self.turned(self.trajectory.frame(frame)))
    }

    /// Velocities `[m/s]` of points whose places `[m]` in every frame of the trajectory `of` gives:
    /// the slope of the parabola through a frame and its two neighbours, at the ends through the
    /// three frames there; of two frames their difference, of one zero. Neighbours count whether
    /// they are taken or not. In double precision, rounded once. `[eq:frame-velocity]`
    pub(super) fn slopes(&self, number: usize, of: impl Fn(usize) -> Vec<Vec3>) -> Vec<Vec3> {
        let (frame, last) = (self.frames[number], self.trajectory.frame_count() - 1);
        let terms: &[(usize, f64)] = match frame {
            0 if last == 0 => &[(0, 0.0)],
            _ if last == 1 => &[(0, -1.0), (1, 1.0)],
            0 => &[(0, -1.5), (1, 2.0), (2, -0.5)],
            _ if frame == last => &[(last, 1.5), (last - 1, -2.0), (last - 2, 0.5)],
            _ => &[(frame - 1, -0.5), (frame + 1, 0.5)],
        };
        let mut sums = Vec::new();
        for &(frame, weight) in terms {
            let points = of(frame);
            sums.resize(points.len(), DVec3::ZERO);
            for (sum, point) in sums.iter_mut().zip(points) {
                *sum += weight * point.as_dvec3();
            }
        }
        let rate = self.trajectory.frame_rate();
        sums.into_iter().map(|sum| (rate * sum).as_vec3()).collect()
    }

    /// The sagged rest pose `[m]`, `[vertices]`.
    pub(super) fn rest_positions(&self) -> Vec<Vec3> {
        self.turned(self.trajectory.cloth().rest_positions())
    }

    /// Positions of the handles in the frame taken as `number` `[m]`, `[handles]`.
    pub(super) fn handle_positions(&self, number: usize) -> Vec<Vec3> {
        let frame = self.trajectory.frame(self.frames[number]);
        let handles = self.trajectory.handles().vertices().iter();
        handles
            .map(|vertex| self.up.to_theirs(frame[vertex.index()]))
            .collect()
    }

    /// The number of the handle that each vertex is, -1 where it is none, `[vertices]`.
    pub(super) fn handle_numbers(&self) -> Vec<i32> {
        let mut numbers = vec![-1; self.trajectory.vertex_count()];
        for (number, vertex) in (0..).zip(self.trajectory.handles().vertices()) {
            numbers[vertex.index()] = number;
        }
        numbers
    }

    /// The frame of the trajectory taken as `number`.
    pub(super) fn frame(&self, number: usize) -> usize {
        self.frames[number]
    }

    /// Positions in the axes of the file.
    pub(super) fn turned(&self, positions: &[Vec3]) -> Vec<Vec3> {
        positions.iter().map(|&p| self.up.to_theirs(p)).collect()
    }

    /// Unit normals at `positions`, `[vertices]`: the mean of the faces around by their areas; up
    /// where these cancel.
    pub(super) fn normals_at(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for face in self.trajectory.topology().faces() {
            let [a, b, c] = face.map(|vertex| positions[vertex.index()]);
            let twice_area = (b - a).cross(c - a);
            for vertex in face {
                normals[vertex.index()] += twice_area;
            }
        }
        let up = self.up.to_theirs(Vec3::Y);
        normals
            .into_iter()
            .map(|normal| normal.try_normalize().unwrap_or(up))
            .collect()
    }
}

/// The corners of the box that holds `positions`.
pub(super) fn extent(positions: &[Vec3]) -> [Vec3; 2] {
    let first = positions.first().copied().unwrap_or_default();
    positions
        .iter()
        .fold([first, first], |[low, high], &p| [low.min(p), high.max(p)])
}

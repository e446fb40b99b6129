//! Frames of a trajectory as they are exported: which of them, which axis points up, and the bodies
//! that move in them.

use std::f32::consts::FRAC_1_SQRT_2;
use std::io;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use super::options::{ExportFormat, ExportOptions};
use crate::UpAxis;
use crate::formats::file_error::Problem;
use crate::trajectory::Trajectory;
use crate::trajectory::obstacles::ObstacleTrack;

/// Frames of a trajectory, in the axes of a file.
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
    velocities: bool,
    /// Tells the observer of one more frame of the cloth; an error where it asks to stop.
    pub(super) beat: &'a dyn Fn() -> io::Result<()>,
}

/// A mesh over the frames taken: the cloth, or an obstacle beside it.
#[derive(Clone)]
pub(super) struct Body<'a> {
    take: &'a Take<'a>,
    /// Name of letters, digits and underscores, that no other has; `sheet` of the cloth.
    pub(super) name: String,
    /// None of the cloth.
    pub(super) track: Option<&'a ObstacleTrack>,
}

impl<'a> Take<'a> {
    /// The frames of `trajectory` that `options` choose.
    pub(super) fn new(
        trajectory: &'a Trajectory,
        options: &ExportOptions,
        beat: &'a dyn Fn() -> io::Result<()>,
    ) -> Result<Self, Problem> {
        let frames = options.frames.of(trajectory.frame_count())?;
        let format = options.format;
        let problem = if format.holds_one_frame() && frames.len() > 1 {
            format!(
                "an .obj file holds one frame, and {} were asked for: choose one, or a folder for all of them",
                frames.len()
            )
        } else if format == ExportFormat::Glb && options.up == UpAxis::Z {
            "glTF has y up: the axis cannot be chosen".to_owned()
        } else if options.velocities && !format.has_velocities() {
            "the format has no velocities: leave them out, or take USD or Alembic".to_owned()
        } else {
            return Ok(Self {
                trajectory,
                frames,
                every: options.frames.every,
                up: options.up,
                normals: options.normals,
                velocities: options.velocities,
                beat,
            });
        };
        Err(Problem(problem))
    }

    /// The cloth as a body.
    pub(super) fn sheet(&'a self) -> Body<'a> {
        Body {
            take: self,
            name: "sheet".to_owned(),
            track: None,
        }
    }

    /// The obstacles beside the cloth.
    pub(super) fn obstacles(&'a self) -> Vec<Body<'a>> {
        let named = obstacles_of(self.trajectory).into_iter();
        let body = |(name, track)| Body {
            take: self,
            name,
            track: Some(track),
        };
        named.map(body).collect()
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
    fn turned(&self, positions: &[Vec3]) -> Vec<Vec3> {
        positions.iter().map(|&p| self.up.to_theirs(p)).collect()
    }

    /// Unit normals of the cloth at `positions`, `[vertices]`.
    pub(super) fn normals_at(&self, positions: &[Vec3]) -> Vec<Vec3> {
        self.sheet().normals_at(positions)
    }
}

impl Body<'_> {
    /// Unit normals at `positions`: the mean of the faces around by their areas; up where these cancel.
    pub(super) fn normals_at(&self, positions: &[Vec3]) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for face in self.faces() {
            let [a, b, c] = face.map(|k| positions[k as usize]);
            let twice_area = (b - a).cross(c - a);
            face.iter().for_each(|k| normals[*k as usize] += twice_area);
        }
        let (up, normals) = (self.take.up.to_theirs(Vec3::Y), normals.into_iter());
        normals.map(|n| n.try_normalize().unwrap_or(up)).collect()
    }

    /// Returns true where these normals serve: at edges they are smeared, and more than 45° off a face.
    pub(super) fn is_round(&self, positions: &[Vec3], normals: &[Vec3]) -> bool {
        let faces = self.faces();
        let is_off = |face: &&[u32; 3]| {
            let [a, b, c] = face.map(|k| positions[k as usize]);
            let own = (b - a).cross(c - a).normalize_or_zero();
            face.iter()
                .any(|k| own.dot(normals[*k as usize]) < FRAC_1_SQRT_2)
        };
        10 * faces.iter().filter(is_off).count() <= faces.len()
    }

    /// Faces by their points.
    pub(super) fn faces(&self) -> Vec<[u32; 3]> {
        match self.track {
            Some(track) => track.faces().to_vec(),
            None => self.take.trajectory.topology().face_indices(),
        }
    }

    pub(super) fn point_count(&self) -> usize {
        let trajectory = self.take.trajectory;
        let of_cloth = || trajectory.vertex_count();
        self.track.map_or_else(of_cloth, ObstacleTrack::point_count)
    }

    pub(super) fn is_still(&self) -> bool {
        self.track.is_some_and(ObstacleTrack::is_still)
    }

    /// Frames taken in which its points differ: one of a still obstacle.
    pub(super) fn frame_count(&self) -> usize {
        if self.is_still() { 1 } else { self.take.len() }
    }

    /// Points in a frame of the trajectory `[m]`, `[points]`.
    fn at(&self, frame: usize) -> Vec<Vec3> {
        match self.track {
            Some(track) => self.take.turned(&track.frame(frame)),
            None => self.take.turned(self.take.trajectory.frame(frame)),
        }
    }

    /// Points in the frame taken as `number` `[m]`, `[points]`.
    pub(super) fn positions(&self, number: usize) -> Vec<Vec3> {
        self.at(self.take.frames[number])
    }

    /// True where it moves, and velocities are wanted.
    pub(super) fn has_velocities(&self) -> bool {
        self.take.velocities && !self.is_still()
    }

    /// Velocities of its points in the frame taken as `number` `[m/s]`, `[points]`: the slope of the
    /// parabola through a frame and its two neighbours, at the ends through the three frames there;
    /// of two frames their difference, of one zero. Neighbours count whether they are taken or not.
    /// In double precision, rounded once. `[eq:frame-velocity]`
    pub(super) fn velocities(&self, number: usize) -> Vec<Vec3> {
        let trajectory = self.take.trajectory;
        let (frame, last) = (self.take.frames[number], trajectory.frame_count() - 1);
        let terms: &[(usize, f64)] = match frame {
            0 if last == 0 => &[(0, 0.0)],
            _ if last == 1 => &[(0, -1.0), (1, 1.0)],
            0 => &[(0, -1.5), (1, 2.0), (2, -0.5)],
            _ if frame == last => &[(last, 1.5), (last - 1, -2.0), (last - 2, 0.5)],
            _ => &[(frame - 1, -0.5), (frame + 1, 0.5)],
        };
        let mut sums = Vec::new();
        for &(frame, weight) in terms {
            let points = self.at(frame);
            sums.resize(points.len(), DVec3::ZERO);
            for (sum, point) in sums.iter_mut().zip(points) {
                *sum += weight * point.as_dvec3();
            }
        }
        let rate = trajectory.frame_rate();
        sums.into_iter().map(|sum| (rate * sum).as_vec3()).collect()
    }

    /// Its file beside `path`, `x.NAME.EXTENSION`.
    pub(super) fn beside(&self, path: &Path, extension: &str) -> PathBuf {
        beside(path, &self.name, extension)
    }
}

fn beside(path: &Path, name: &str, extension: &str) -> PathBuf {
    path.with_extension(format!("{name}.{extension}"))
}

/// The obstacles of `trajectory` with their names in files.
fn obstacles_of(trajectory: &Trajectory) -> Vec<(String, &ObstacleTrack)> {
    let mut taken: Vec<(String, &ObstacleTrack)> = Vec::new();
    for track in trajectory.obstacles() {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let mut name: String = track.name().chars().map(plain).collect();
        // USD's names begin with a letter; "sheet" and "handle_0" are the cloth's, "materials"
        // a scope of USD's, "x_mesh" the mesh of x in Alembic, and "x_faces" the faces of x in .npz.
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "obstacle_");
        }
        let is_taken = |name: &str| {
            let own = ["sheet", "cloth", "materials"].contains(&name)
                || name.starts_with("handle_")
                || ["_mesh", "_faces"].iter().any(|end| name.ends_with(end));
            // Some systems do not tell small from capital letters in names of files.
            own || taken.iter().any(|other| other.0.eq_ignore_ascii_case(name))
        };
        if is_taken(&name) {
            let numbered = (1..).map(|k| format!("obstacle_{name}_{k}"));
            name = numbered.clone().find(|n| !is_taken(n)).unwrap_or(name);
        }
        taken.push((name, track));
    }
    taken
}

/// Files that an export of `trajectory` to `path` writes beside it: the mesh of each obstacle, and
/// for point caches their caches and the cloth's mesh.
pub fn files_beside(trajectory: &Trajectory, format: ExportFormat, path: &Path) -> Vec<PathBuf> {
    let is_cache = format == ExportFormat::Pc2;
    if !is_cache && format != ExportFormat::Obj {
        return Vec::new();
    }
    let mut files = Vec::new();
    if is_cache {
        files.push(path.with_extension("obj"));
    }
    for (name, track) in obstacles_of(trajectory) {
        files.push(beside(path, &name, "obj"));
        if is_cache && !track.is_still() {
            files.push(beside(path, &name, "pc2"));
        }
    }
    files
}

/// The corners of the box that holds `positions`.
pub(super) fn extent(positions: &[Vec3]) -> [Vec3; 2] {
    let first = positions.first().copied().unwrap_or_default();
    positions
        .iter()
        .fold([first, first], |[low, high], &p| [low.min(p), high.max(p)])
}

#[cfg(test)]
mod tests;

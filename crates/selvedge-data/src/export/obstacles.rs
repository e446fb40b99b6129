//! Obstacles of the frames that are taken: their names in files, and their points.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::options::ExportFormat;
use super::take::Take;
use crate::trajectory::Trajectory;
use crate::trajectory::obstacles::ObstacleTrack;

/// An obstacle, as a file has it.
pub(super) struct TakenObstacle<'a> {
    /// Name of letters, digits and underscores, that no other has.
    pub(super) name: String,
    pub(super) track: &'a ObstacleTrack,
}

impl<'a> Take<'a> {
    /// The obstacles beside the cloth.
    pub(super) fn obstacles(&self) -> Vec<TakenObstacle<'a>> {
        TakenObstacle::all(self.trajectory)
    }
}

/// Files that an export of `trajectory` to `path` writes beside it: the mesh of each obstacle, and
/// for point caches their caches and the cloth's mesh.
#[must_use]
pub fn files_beside(trajectory: &Trajectory, format: ExportFormat, path: &Path) -> Vec<PathBuf> {
    let is_cache = format == ExportFormat::Pc2;
    if !is_cache && format != ExportFormat::Obj {
        return Vec::new();
    }
    let mut files = Vec::new();
    if is_cache {
        files.push(path.with_extension("obj"));
    }
    for obstacle in TakenObstacle::all(trajectory) {
        files.push(obstacle.beside(path, "obj"));
        if is_cache && !obstacle.is_still() {
            files.push(obstacle.beside(path, "pc2"));
        }
    }
    files
}

impl<'a> TakenObstacle<'a> {
    /// The obstacles of `trajectory`.
    fn all(trajectory: &'a Trajectory) -> Vec<Self> {
        let mut taken: Vec<Self> = Vec::new();
        for track in trajectory.obstacles() {
            let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
            let mut name: String = track.name().chars().map(plain).collect();
            // USD's names begin with a letter; "sheet" and "handle_0" are the cloth's, "materials"
            // a scope of USD's, and "x_mesh" the mesh of x in Alembic.
            if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
                name.insert_str(0, "obstacle_");
            }
            let is_taken = |name: &str| {
                let own = ["sheet", "cloth", "materials"].contains(&name)
                    || name.starts_with("handle_")
                    || name.ends_with("_mesh");
                own || taken.iter().any(|other| other.name == name)
            };
            if is_taken(&name) {
                let numbered = (1..).map(|k| format!("obstacle_{name}_{k}"));
                name = numbered.clone().find(|n| !is_taken(n)).unwrap_or(name);
            }
            taken.push(TakenObstacle { name, track });
        }
        taken
    }
}

impl TakenObstacle<'_> {
    /// Its file beside `path`, `x.NAME.EXTENSION`.
    pub(super) fn beside(&self, path: &Path, extension: &str) -> PathBuf {
        path.with_extension(format!("{}.{extension}", self.name))
    }

    pub(super) fn is_still(&self) -> bool {
        self.track.is_still()
    }

    /// Frames of `take` in which its points differ: one of a still obstacle.
    pub(super) fn frame_count(&self, take: &Take<'_>) -> usize {
        if self.is_still() { 1 } else { take.len() }
    }

    /// Points in the frame taken as `number` `[m]`, `[points]`.
    pub(super) fn positions(&self, take: &Take<'_>, number: usize) -> Vec<Vec3> {
        take.turned(&self.track.frame(take.frame(number)))
    }

    /// Velocities of its points in the frame taken as `number` `[m/s]`, `[points]`.
    pub(super) fn velocities(&self, take: &Take<'_>, number: usize) -> Vec<Vec3> {
        take.slopes(number, |frame| take.turned(&self.track.frame(frame)))
    }
}

#[cfg(test)]
mod tests;

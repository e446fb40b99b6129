//! What was seen of a cloth: places of vertices in frames, of which any may be missing.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use glam::DVec3;
use selvedge_cloth::Scene;
use selvedge_data::Trajectory;
use serde::Deserialize;

/// Frames after the start at most.
const MOST_FRAMES: usize = 100_000;

/// The part `data` of an order.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SeenFile {
    markers: Option<PathBuf>,
    trajectory: Option<PathBuf>,
    /// Standard deviation of each coordinate `[m]`.
    pub(super) noise: Option<f64>,
}

/// A vertex that was seen in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mark {
    /// Frames after the start of the run.
    pub(super) frame: usize,
    pub(super) vertex: usize,
    x: f64,
    y: f64,
    z: f64,
}

impl Mark {
    /// Its place `[m]`.
    pub(super) fn place(&self) -> DVec3 {
        DVec3::new(self.x, self.y, self.z)
    }
}

impl SeenFile {
    /// The file, relative to `folder`, and its marks in order of their frames; there is one at least.
    pub(super) fn read(&self, folder: &Path, scene: &Scene) -> Result<(PathBuf, Vec<Mark>)> {
        let (file, mut marks) = match (&self.markers, &self.trajectory) {
            (Some(file), None) => (folder.join(file), table(&folder.join(file))?),
            (None, Some(file)) => (folder.join(file), frames(&folder.join(file), scene)?),
            _ => anyhow::bail!(
                "data: needs `markers` (.csv) or `trajectory` (.safetensors), one of them"
            ),
        };
        let name = file.display();
        let vertices = scene.mesh.positions().len();
        ensure!(
            !marks.is_empty(),
            "{name}: nothing was seen: the table has no rows"
        );
        for (row, mark) in marks.iter().enumerate() {
            let Mark { frame, vertex, .. } = *mark;
            let row = format!("{name}: row {}", row + 1);
            ensure!(
                vertex < vertices,
                "{row}: there is no vertex {vertex}: the scene {:?} has {vertices}, 0 to {}",
                scene.name,
                vertices - 1
            );
            ensure!(
                frame <= MOST_FRAMES,
                "{row}: frame {frame} is beyond {MOST_FRAMES}"
            );
            ensure!(
                mark.place().is_finite(),
                "{row}: a place is not finite: leave out the row of a marker that was not seen"
            );
        }
        marks.sort_by_key(|mark| (mark.frame, mark.vertex));
        if let Some(pair) = marks
            .windows(2)
            .find(|p| (p[0].frame, p[0].vertex) == (p[1].frame, p[1].vertex))
        {
            let Mark { frame, vertex, .. } = pair[0];
            anyhow::bail!(
                "{name}: vertex {vertex} is there twice in frame {frame}: leave one of the rows"
            );
        }
        let noise = self.noise.unwrap_or(1.0);
        ensure!(
            noise.is_finite() && noise > 0.0,
            "data.noise must be positive, in metres; found {noise}"
        );
        Ok((file, marks))
    }
}

fn table(file: &Path) -> Result<Vec<Mark>> {
    let name = || {
        format!(
            "{}: expected rows of frame,vertex,x,y,z in metres, with this header",
            file.display()
        )
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(file)
        .with_context(|| file.display().to_string())?;
    reader
        .deserialize()
        .map(|row| row.with_context(name))
        .collect()
}

fn frames(file: &Path, scene: &Scene) -> Result<Vec<Mark>> {
    let seen = Trajectory::read(file)?;
    let [found, expected] =
        [seen.topology(), scene.mesh.topology()].map(|mesh| mesh.vertex_count());
    ensure!(
        found == expected,
        "{}: has {found} vertices, the scene {:?} {expected}: take its trajectory, or markers",
        file.display(),
        scene.name
    );
    let [found, expected] = [seen.frame_rate(), scene.frame_rate];
    ensure!(
        found == expected,
        "{}: has {found} frames per second, the scene {:?} {expected}: set its frame_rate",
        file.display(),
        scene.name
    );
    let mark = |frame| {
        move |(vertex, place): (usize, &glam::Vec3)| {
            let [x, y, z] = place.as_dvec3().to_array();
            Mark {
                frame,
                vertex,
                x,
                y,
                z,
            }
        }
    };
    let of_frame = |frame| seen.frame(frame).iter().enumerate().map(mark(frame));
    Ok((0..seen.frame_count()).flat_map(of_frame).collect())
}

//! What was seen of a cloth: places of vertices in frames, of which any may be missing.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use selvedge_cloth::Scene;
use selvedge_data::Trajectory;
use serde::Deserialize;

/// Frames after the start at most.
const MOST_FRAMES: usize = 100_000;

/// The part `data` of an order.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SeenFile {
    markers: Option<PathBuf>,
    trajectory: Option<PathBuf>,
    /// Standard deviation of each coordinate `[m]`.
    pub(super) noise: Option<f64>,
}

/// A vertex that was seen in a frame after the start of the run, at a place `[m]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mark {
    pub(super) frame: usize,
    pub(super) vertex: usize,
    x: f64,
    y: f64,
    z: f64,
}

impl Mark {
    pub(super) fn place(&self) -> DVec3 {
        DVec3::new(self.x, self.y, self.z)
    }
}

impl SeenFile {
    /// The marks in order of their frames, of a file relative to `folder`; there is one at least.
    pub(super) fn read(&self, folder: &Path, scene: &Scene) -> Result<Vec<Mark>> {
        let noise = self.noise.unwrap_or(1.0);
        let is_one = noise.is_finite() && noise > 0.0;
        ensure!(
            is_one,
            "data.noise must be positive, in metres; found {noise}"
        );
        let (file, of): (_, fn(&Path, &Scene) -> Result<Vec<Mark>>) =
            match (&self.markers, &self.trajectory) {
                (Some(file), None) => (folder.join(file), table),
                (None, Some(file)) => (folder.join(file), frames),
                _ => bail!("data needs markers (.csv) or trajectory (.safetensors), one of them"),
            };
        of(&file, scene).with_context(|| file.display().to_string())
    }
}

fn table(file: &Path, scene: &Scene) -> Result<Vec<Mark>> {
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.trim(csv::Trim::All).from_path(file)?;
    let rows = reader.deserialize().collect::<Result<Vec<Mark>, _>>();
    let mut marks = rows.context("expected the columns frame,vertex,x,y,z, in metres")?;
    ensure!(!marks.is_empty(), "nothing was seen: there is no row");
    let vertices = scene.mesh.positions().len();
    for (row, mark) in marks.iter().enumerate() {
        let Mark { frame, vertex, .. } = mark;
        let row = row + 2;
        ensure!(
            *vertex < vertices,
            "line {row}: there is no vertex {vertex}: the scene has {vertices}, from 0"
        );
        ensure!(
            *frame <= MOST_FRAMES,
            "line {row}: frame {frame} is beyond {MOST_FRAMES}"
        );
        let is_seen = mark.place().is_finite();
        ensure!(
            is_seen,
            "line {row}: is not finite: leave out what was not seen"
        );
    }
    marks.sort_by_key(|mark| (mark.frame, mark.vertex));
    let twice = marks
        .windows(2)
        .find(|two| (two[0].frame, two[0].vertex) == (two[1].frame, two[1].vertex));
    if let Some([Mark { frame, vertex, .. }, _]) = twice {
        bail!("vertex {vertex} is there twice in frame {frame}: leave out one of the lines");
    }
    Ok(marks)
}

fn frames(file: &Path, scene: &Scene) -> Result<Vec<Mark>> {
    let seen = Trajectory::read(file)?;
    let (vertices, rate) = (scene.mesh.positions().len(), scene.frame_rate);
    ensure!(
        (seen.vertex_count(), seen.frame_rate()) == (vertices, rate),
        "has {} vertices and {} frames per second, the scene {vertices} and {rate}: they must be the same, otherwise take markers",
        seen.vertex_count(),
        seen.frame_rate()
    );
    let all = seen.positions().iter().enumerate();
    let mark = |(number, place): (usize, &glam::Vec3)| {
        let [x, y, z] = place.as_dvec3().to_array();
        Mark {
            frame: number / vertices,
            vertex: number % vertices,
            x,
            y,
            z,
        }
    };
    Ok(all.map(mark).collect())
}

//! What was seen of a cloth: places of vertices in frames, of which any may be missing.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use glam::{DVec3, Vec3};
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

    fn at(&self) -> (usize, usize) {
        (self.frame, self.vertex)
    }
}

impl SeenFile {
    /// The marks in order of their frames, of a file relative to `folder`; there is one at least.
    pub(super) fn read(&self, folder: &Path, scene: &Scene) -> Result<Vec<Mark>> {
        let noise = self.noise.unwrap_or(1.0);
        let is_one = noise.is_finite() && noise > 0.0;
        ensure!(is_one, "noise must be positive, in metres; found {noise}");
        let (file, marks) = match (&self.markers, &self.trajectory) {
            (Some(file), None) => (file, table(&folder.join(file))),
            (None, Some(file)) => (file, frames(&folder.join(file), scene)),
            _ => bail!("give markers (.csv) or trajectory (.safetensors), one of them"),
        };
        let marks = marks.and_then(|marks| check(marks, scene.mesh.positions().len()));
        marks.with_context(|| folder.join(file).display().to_string())
    }
}

fn table(file: &Path) -> Result<Vec<Mark>> {
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.trim(csv::Trim::All).from_path(file)?;
    let rows = reader.deserialize().collect::<Result<_, _>>();
    rows.context("expected the columns frame,vertex,x,y,z, in metres")
}

fn frames(file: &Path, scene: &Scene) -> Result<Vec<Mark>> {
    let seen = Trajectory::read(file)?;
    let found = (seen.vertex_count(), seen.frame_rate());
    let expected = (scene.mesh.positions().len(), scene.frame_rate);
    ensure!(
        found == expected,
        "expected {expected:?} vertices and frames per second, as the scene has, found {found:?}"
    );
    let all = seen.positions().iter().enumerate();
    let mark = |(number, place): (usize, &Vec3)| {
        let [x, y, z] = place.as_dvec3().to_array();
        let (frame, vertex) = (number / expected.0, number % expected.0);
        Mark {
            frame,
            vertex,
            x,
            y,
            z,
        }
    };
    Ok(all.map(mark).collect())
}

fn check(mut marks: Vec<Mark>, vertices: usize) -> Result<Vec<Mark>> {
    ensure!(!marks.is_empty(), "nothing was seen: there is no row");
    for (row, mark) in marks.iter().enumerate() {
        let (row, Mark { frame, vertex, .. }) = (row + 1, mark);
        let is_seen = mark.place().is_finite();
        ensure!(
            is_seen,
            "row {row}: a number is not finite: leave out what was not seen"
        );
        ensure!(
            *vertex < vertices && *frame <= MOST_FRAMES,
            "row {row}: vertex {vertex} in frame {frame}: the scene has {vertices} vertices, from 0, and frames are at most {MOST_FRAMES}"
        );
    }
    marks.sort_by_key(Mark::at);
    let twice = marks.windows(2).find(|two| two[0].at() == two[1].at());
    if let Some([one, _]) = twice {
        bail!(
            "frame and vertex {:?} are there twice: leave out one row",
            one.at()
        );
    }
    Ok(marks)
}

//! Contact sheets and clips of one or two runs of a cloth, side by side.

use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;
use glam::Vec3;
use selvedge_data::{Trajectory, metrics, write_atomically};
use selvedge_view::{
    Body, ClipEnd, ClipSettings, Colouring, Panel, Run, ScalarField, SheetSettings, contact_sheet,
    write_clip,
};

use crate::interrupt;
use crate::output::End;
use crate::progress::Progress;

/// A run to draw, alone or beside another.
pub(crate) struct Show<'a> {
    /// The heading.
    pub(crate) title: &'a str,
    /// The label over the run.
    pub(crate) label: &'a str,
    /// The run: the model's, where there is a truth.
    pub(crate) prediction: &'a Trajectory,
    /// The run to compare it with, of as many frames.
    pub(crate) truth: Option<&'a Trajectory>,
}

/// The label over a model's run.
pub(crate) const MODEL: &str = "model";
/// The label over a run of the physics.
pub(crate) const PHYSICS: &str = "physics";

/// Writes a contact sheet (.png) of moments in motion; beside a truth, the model's run once
/// more in the colours of its error.
///
/// # Errors
/// What cannot be drawn or written.
pub(crate) fn write_sheet(path: &Path, show: &Show<'_>) -> anyhow::Result<()> {
    let prediction = run_of(show.prediction)?;
    let truth = show.truth.map(run_of).transpose()?;
    let error = match &truth {
        Some(truth) => Some(ScalarField::distance(truth, &prediction)?),
        None => None,
    };
    let mut panels = panels(show.label, &prediction, truth.as_ref());
    panels.extend(error.as_ref().map(|error| Panel {
        label: "error",
        run: &prediction,
        colouring: Colouring::PerVertex(error),
    }));
    let settings = SheetSettings {
        tile: [240, 240],
        columns: 6,
        pictures: 6,
        ..SheetSettings::default()
    };
    let png = contact_sheet(show.title, &panels, &settings)?.to_png()?;
    Ok(write_atomically(path, |out| out.write_all(&png))?)
}

/// Writes a contact sheet (.png) of moments in motion in the colours of the strain: of each vertex,
/// the largest elongation of its edges against the material.
///
/// # Errors
/// What cannot be drawn or written.
pub(crate) fn write_strain_sheet(
    path: &Path,
    title: &str,
    trajectory: &Trajectory,
) -> anyhow::Result<()> {
    let run = run_of(trajectory)?;
    let topology = trajectory.topology();
    let lengths = metrics::material_edge_lengths(trajectory.cloth());
    let of_frame = |positions: &[Vec3]| {
        let mut strain = vec![0.0_f32; positions.len()];
        for (edge, length) in topology.edges().iter().zip(&lengths) {
            let [a, b] = edge.vertices.map(|vertex| vertex.index());
            let stretch = f64::from(positions[a].distance(positions[b])) / length;
            let percent = (100.0 * (stretch - 1.0)) as f32;
            for vertex in [a, b] {
                strain[vertex] = strain[vertex].max(percent);
            }
        }
        strain
    };
    let values = trajectory.frames().iter().map(of_frame).collect();
    let strain = ScalarField::new("largest elongation [%]", values)?;
    let panel = Panel {
        label: "",
        run: &run,
        colouring: Colouring::PerVertex(&strain),
    };
    let settings = SheetSettings::default();
    let png = contact_sheet(title, &[panel], &settings)?.to_png()?;
    Ok(write_atomically(path, |out| out.write_all(&png))?)
}

/// Writes a clip (.gif) in real time. A clip that is interrupted ends early, but is whole.
///
/// # Errors
/// What cannot be drawn or written.
pub(crate) fn write_clip_of(path: &Path, show: &Show<'_>) -> anyhow::Result<End> {
    let prediction = run_of(show.prediction)?;
    let truth = show.truth.map(run_of).transpose()?;
    let panels = panels(show.label, &prediction, truth.as_ref());
    let settings = ClipSettings::default();
    let seconds = prediction.time(prediction.frames().len() - 1);
    let pictures = (1e3 * seconds / f64::from(settings.delay_ms)) as usize + 1;
    let progress = Progress::new("drawing the clip", pictures, "pictures");
    let mut end = End::Complete;
    write_atomically(path, |out| {
        let result = write_clip(out, show.title, &panels, &settings, &mut |_| {
            progress.advance();
            interrupt::flow()
        });
        if let ClipEnd::Stopped { .. } = result.map_err(io::Error::other)? {
            end = End::Interrupted;
        }
        Ok(())
    })?;
    Ok(end)
}

/// The truth first, as in a table of results.
fn panels<'a>(
    label: &'a str,
    prediction: &'a Run<'a>,
    truth: Option<&'a Run<'a>>,
) -> Vec<Panel<'a>> {
    let panel = |label: &'a str, run| Panel {
        label,
        run,
        colouring: Colouring::Plain,
    };
    truth
        .map(|run| panel(PHYSICS, run))
        .into_iter()
        .chain([panel(label, prediction)])
        .collect()
}

fn run_of(trajectory: &Trajectory) -> anyhow::Result<Run<'_>> {
    let frames: Vec<usize> = (0..trajectory.frame_count()).collect();
    run_of_frames(trajectory, &frames, trajectory.frame_rate())
}

/// These frames of a trajectory, `frame_rate` per second, with the obstacles beside the cloth.
///
/// # Errors
/// A run that cannot be drawn.
pub(crate) fn run_of_frames<'a>(
    trajectory: &'a Trajectory,
    frames: &[usize],
    frame_rate: f64,
) -> anyhow::Result<Run<'a>> {
    let run = Run::new(
        trajectory.topology(),
        frames.iter().map(|&frame| trajectory.frame(frame)),
        trajectory.handles().vertices(),
        frame_rate,
    );
    let bodies = trajectory.obstacles().iter().map(|obstacle| {
        let taken = if obstacle.is_still() {
            &frames[..1]
        } else {
            frames
        };
        let points = taken.iter().map(|&frame| obstacle.frame(frame));
        Body::new(obstacle.faces(), points)
    });
    let bodies: Result<Vec<Body<'a>>, _> = bodies.collect();
    run.and_then(|run| run.with_bodies(bodies?))
        .context("a run to draw")
}

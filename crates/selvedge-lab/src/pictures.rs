//! Pictures of one or two trajectories of a cloth, side by side, as bytes of a file.

use std::io::Write;
use std::ops::ControlFlow;

use glam::Vec3;
use selvedge_data::Trajectory;
use selvedge_view::{
    Body, ClipSettings, Panel, Rgb, Run, ScalarField, SheetSettings, ViewError, contact_sheet,
    pictures_in, still, write_clip,
};

/// A run to draw, alone or beside another.
pub struct Show<'a> {
    /// The heading.
    pub title: &'a str,
    /// The label over the run.
    pub label: &'a str,
    /// The run: the model's, where there is a truth.
    pub prediction: &'a Trajectory,
    /// The run to compare it with, of as many frames.
    pub truth: Option<&'a Trajectory>,
}

/// The label over a model's run.
pub const MODEL: &str = "model";
/// The label over a run of the physics.
const PHYSICS: &str = "physics";

/// A contact sheet (.png) of even moments: the run; beside a truth, that one first, and the run
/// once more in the colours of its error.
pub fn sheet(show: &Show<'_>) -> Result<Vec<u8>, ViewError> {
    let settings = SheetSettings {
        tile: [240, 240],
        columns: 6,
        pictures: 6,
    };
    with_panels(show, |panels| {
        contact_sheet(show.title, panels, &settings)?.to_png()
    })
}

/// A contact sheet (.png) of even moments in the colours of the strain: of each vertex, the
/// largest elongation of its edges against the material.
pub fn strain_sheet(title: &str, trajectory: &Trajectory) -> Result<Vec<u8>, ViewError> {
    let run = run_of(trajectory)?;
    let strain = strain_of(trajectory)?;
    let panel = Panel {
        field: Some(&strain),
        ..Panel::of(&run)
    };
    contact_sheet(title, &[panel], &SheetSettings::default())?.to_png()
}

/// One frame (.png) of `size` (width, height) `[pixels]`.
pub fn picture(
    trajectory: &Trajectory,
    frame: usize,
    size: [u32; 2],
) -> Result<Vec<u8>, ViewError> {
    let frames = trajectory.frame_count();
    if frame >= frames {
        return Err(ViewError::no_frame(frame, frames));
    }
    let run = run_of_frames(trajectory, &[frame], trajectory.frame_rate())?;
    still(&Panel::of(&run), 0, size)?.to_png()
}

/// Number of pictures of a clip of `trajectory`.
pub fn clip_pictures(trajectory: &Trajectory) -> usize {
    pictures_in(trajectory.frame_count(), trajectory.frame_rate())
}

/// Writes a clip (.gif) in real time to `out`, of the same panels as [`sheet`]. `on_picture` hears of
/// every picture and may stop; the clip then ends early, but is whole.
pub fn clip(
    out: &mut dyn Write,
    show: &Show<'_>,
    on_picture: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<ControlFlow<()>, ViewError> {
    let settings = ClipSettings::default();
    with_panels(show, |panels| {
        write_clip(out, show.title, panels, &settings, on_picture)
    })
}

fn strain_of(trajectory: &Trajectory) -> Result<ScalarField, ViewError> {
    let topology = trajectory.topology();
    let lengths = trajectory.cloth().pattern().edge_lengths();
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
    ScalarField::new("largest elongation [%]", values)
}

/// Draws a run; beside a truth that one first, as in a table of results, and the run once more in
/// the colours of its error.
fn with_panels<R>(
    show: &Show<'_>,
    draw: impl FnOnce(&[Panel<'_>]) -> Result<R, ViewError>,
) -> Result<R, ViewError> {
    let panel = |label, run, field| Panel { label, run, field };
    let prediction = run_of(show.prediction)?;
    let own = panel(show.label, &prediction, None);
    let Some(truth) = show.truth else {
        return draw(&[own]);
    };
    let truth = run_of(truth)?;
    let error = ScalarField::distance(&truth, &prediction)?;
    draw(&[
        panel(PHYSICS, &truth, None),
        own,
        panel("error", &prediction, Some(&error)),
    ])
}

fn run_of(trajectory: &Trajectory) -> Result<Run<'_>, ViewError> {
    let frames: Vec<usize> = (0..trajectory.frame_count()).collect();
    run_of_frames(trajectory, &frames, trajectory.frame_rate())
}

/// These frames of a trajectory, `frame_rate` per second, with the obstacles beside the cloth.
pub fn run_of_frames<'a>(
    trajectory: &'a Trajectory,
    frames: &[usize],
    frame_rate: f64,
) -> Result<Run<'a>, ViewError> {
    let run = Run::new(
        trajectory.topology(),
        frames.iter().map(|&frame| trajectory.frame(frame)),
        trajectory.handles().vertices(),
        frame_rate,
    )?;
    let bodies = trajectory.obstacles().iter().map(|obstacle| {
        let taken = if obstacle.is_still() { &frames[..1] } else { frames };
        let points = taken.iter().map(|&frame| obstacle.frame(frame));
        Body::new(obstacle.faces(), points)
    });
    let run = run
        .with_bodies(bodies.collect())
        .woven(trajectory.cloth().pattern().faces().collect());
    let material = trajectory.provenance().scene["setting"]["material"]["name"].as_str();
    Ok(match material.and_then(colour_of) {
        Some(colour) => run.in_colour(colour),
        None => run,
    })
}

/// The colour of a shipped fabric; none for others.
fn colour_of(material: &str) -> Option<Rgb> {
    match material {
        "gray-interlock" | "interlock" => Some([112, 120, 136]),
        "camel-ponte-roma" | "ponte" => Some([176, 128, 78]),
        "11oz-black-denim" | "denim" => Some([78, 84, 104]),
        "navy-sparkle-sweat" | "sweat" => Some([48, 64, 122]),
        "blue-cotton" => Some([72, 104, 168]),
        "red-wool" => Some([168, 66, 60]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_fabric_has_a_colour_in_which_folds_show() {
        for (name, _) in selvedge_assets::MATERIALS {
            let colour = colour_of(name).expect(name);
            // Half of the light of the darkest is lost in a fold: 64 of 255 leave 24 of 255.
            assert!(
                colour.into_iter().max().is_some_and(|c| c > 64),
                "{name}: {colour:?}"
            );
        }
    }
}

//! `selvedge simulate`: the physics on a scene, as a trajectory.

use std::path::{Path, PathBuf};

use selvedge_cloth::Scene;
use selvedge_data::{Trajectory, metrics, open_scene};
use selvedge_sim::{SaggedRest, Threads};
use serde::Serialize;

use crate::cli::{From, SimulateArgs};
use crate::output::{Answer, End, Facts, percent};
use crate::pictures::Show;
use crate::progress::Progress;
use crate::{interrupt, pictures, place, reference};

#[derive(Serialize)]
struct Report {
    scene: String,
    out: PathBuf,
    vertices: usize,
    frames: usize,
    ms_per_frame: f64,
    sag_solves: Option<u32>,
    sag_residual: Option<f64>,
    largest_strain: f64,
    /// Mean speed of the vertices in the last second `[m/s]`.
    final_speed: f64,
    clip: Option<PathBuf>,
    interrupted: bool,
}

/// Simulates a scene and writes the trajectory.
///
/// # Errors
/// What of the scene, the solve or the file went wrong.
pub(crate) fn run(args: &SimulateArgs) -> anyhow::Result<Answer> {
    place::check_file(&args.out, "--out", &["safetensors"])?;
    if let Some(clip) = &args.clip {
        place::check_file(clip, "--clip", &["gif"])?;
    }
    let loaded = open_scene(&args.scene)?;
    let scene = &loaded.scene;
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => scene.frame_count()?,
    };
    let rest = rest_of(scene, args.from())?;
    let sheet = scene.mesh.positions();
    let rest_positions = rest.as_ref().map_or(sheet, |rest| &rest.positions);
    let start = match args.from() {
        From::Rest => rest_positions.to_vec(),
        From::Start => sheet.to_vec(),
    };
    let progress = Progress::new("simulating", frames, "frames");
    let run = reference::run(scene, start, frames, Threads::Pool, &mut || {
        progress.advance();
        interrupt::flow()
    })?;
    drop(progress);
    let trajectory = reference::trajectory(&loaded.spec, scene, rest_positions, run.positions)?;
    trajectory.write(&args.out)?;
    let end = match &args.clip {
        Some(clip) if run.end == End::Complete => draw(clip, &scene.name, &trajectory)?,
        _ => run.end,
    };
    let report = Report {
        scene: scene.name.clone(),
        out: args.out.clone(),
        clip: args.clip.clone().filter(|_| run.end == End::Complete),
        vertices: trajectory.vertex_count(),
        frames: trajectory.frame_count(),
        ms_per_frame: run.ms_per_frame,
        sag_solves: rest.as_ref().map(|rest| rest.solves),
        sag_residual: rest.as_ref().map(|rest| rest.residual),
        largest_strain: reference::largest_strain(&trajectory)?,
        final_speed: metrics::final_speed(trajectory.frames(), scene.frame_rate)?,
        interrupted: run.end == End::Interrupted,
    };
    Ok(Answer::new(text(&report, frames + 1), &report)?.ended(end))
}

/// Draws the run as a clip.
fn draw(clip: &Path, title: &str, trajectory: &Trajectory) -> anyhow::Result<End> {
    let show = Show {
        title,
        label: pictures::PHYSICS,
        prediction: trajectory,
        truth: None,
    };
    pictures::write_clip_of(clip, &show)
}

/// The sagged rest pose. A cloth that nothing holds has none: it can only be let go where it
/// starts, and is then at rest there.
fn rest_of(scene: &Scene, from: From) -> anyhow::Result<Option<SaggedRest>> {
    if scene.handles.is_empty() && from == From::Start {
        return Ok(None);
    }
    if scene.handles.is_empty() {
        anyhow::bail!(
            "scene {:?} has no handles, so that nothing holds the cloth: let it fall with --from-start",
            scene.name
        );
    }
    Ok(Some(reference::rest_pose(scene)?))
}

fn text(report: &Report, wanted: usize) -> Facts {
    let mut facts = Facts::new();
    facts.add("scene", &report.scene);
    facts.add("vertices", report.vertices);
    let frames = if report.interrupted {
        format!("{} of {wanted}: interrupted", report.frames)
    } else {
        report.frames.to_string()
    };
    facts.add("frames", frames);
    facts.add("time", format!("{:.2} ms per frame", report.ms_per_frame));
    if let (Some(solves), Some(residual)) = (report.sag_solves, report.sag_residual) {
        facts.add("sag", format!("{solves} solves, {residual:.1e} m/s² left"));
    }
    facts.add("largest strain", percent(report.largest_strain));
    facts.add(
        "speed",
        format!("{:.4} m/s in the last second", report.final_speed),
    );
    facts.add("wrote", report.out.display());
    if let Some(clip) = &report.clip {
        facts.add("and", clip.display());
    }
    facts
}

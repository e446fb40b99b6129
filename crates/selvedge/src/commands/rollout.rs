//! `selvedge rollout`: a trained model on a scene, beside the physics, as trajectories, a contact
//! sheet and a clip.
//!
//! Each file is written as soon as it is known. Ctrl-C writes what there is of the trajectory under
//! way and leaves out what would come after it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use selvedge_data::metrics::Comparison;
use selvedge_data::{Cloth, LoadedScene, Trajectory};
use selvedge_sim::{SaggedRest, Threads};
use serde::Serialize;

use super::compare::compare;
use crate::cli::{RolloutArgs, Wanted};
use crate::learned::{self, NamedModel};
use crate::output::{Answer, End, Facts, length, percent};
use crate::pictures::{self, Show, write_clip_of, write_sheet};
use crate::progress::Progress;
use crate::reference::{self, Run};
use crate::{exporting, interrupt, place, scenes};

#[derive(Serialize)]
struct Report {
    scene: String,
    model: String,
    vertices: usize,
    frames: usize,
    model_ms_per_frame: f64,
    truth_ms_per_frame: Option<f64>,
    largest_strain: f64,
    comparison: Option<Comparison>,
    wrote: Vec<PathBuf>,
    /// What the scene asks for and cannot have, or can hardly mean.
    warnings: Vec<String>,
    interrupted: bool,
}

/// A trajectory and the wall time of a frame `[ms]`.
struct Timed {
    trajectory: Trajectory,
    ms_per_frame: f64,
    end: End,
}

/// What is run.
struct Stage {
    loaded: LoadedScene,
    rest: SaggedRest,
    frames: usize,
}

/// Runs a model on a scene.
///
/// # Errors
/// What of the scene, the model, a solve or a file went wrong.
pub(crate) fn run(args: &RolloutArgs) -> anyhow::Result<Answer> {
    let wishes = exporting::wishes(&args.export)?;
    let model = learned::open(args.model.as_deref())?;
    let loaded = scenes::open(&args.scene)?;
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => loaded.scene.frame_count()?,
    };
    place::make_folder(&args.out)?;
    let rest = reference::rest_pose(&loaded.scene)?;
    let stage = Stage {
        loaded,
        rest,
        frames,
    };
    let mut wrote = Vec::new();
    let prediction = predict(&stage, &model)?;
    write(&prediction.trajectory, &args.out, "rollout", &mut wrote)?;
    let mut end = prediction.end;
    let mut truth = None;
    if args.truth() == Wanted::Yes && end == End::Complete {
        let run = simulate(&stage)?;
        write(&run.trajectory, &args.out, "truth", &mut wrote)?;
        end = run.end;
        truth = Some(run);
    }
    let comparison = match &truth {
        Some(truth) => Some(compare(&truth.trajectory, &prediction.trajectory)?),
        None => None,
    };
    if end == End::Complete {
        let show = Show {
            title: &stage.loaded.scene.name,
            label: pictures::MODEL,
            prediction: &prediction.trajectory,
            truth: truth.as_ref().map(|truth| &truth.trajectory),
        };
        end = draw(&show, args, &mut wrote)?;
    }
    end = exporting::fulfil(&wishes, &prediction.trajectory, end, &mut wrote)?;
    let report = Report {
        scene: stage.loaded.scene.name.clone(),
        model: model.name,
        vertices: prediction.trajectory.vertex_count(),
        frames: prediction.trajectory.frame_count(),
        model_ms_per_frame: prediction.ms_per_frame,
        truth_ms_per_frame: truth.as_ref().map(|truth| truth.ms_per_frame),
        largest_strain: reference::largest_strain(&prediction.trajectory)?,
        comparison,
        wrote,
        warnings: stage.loaded.warnings.clone(),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

fn predict(stage: &Stage, model: &NamedModel) -> anyhow::Result<Timed> {
    let scene = &stage.loaded.scene;
    let cloth = Cloth::of_scene(scene, reference::rounded(&stage.rest.positions));
    let graph = learned::graph_of_scene(scene, &cloth)?;
    let path = scene.handle_path()?;
    let progress = Progress::new("predicting", stage.frames, "frames");
    let start = &cloth.rest_positions;
    let run = learned::run(model, graph, start, &path, stage.frames, &mut || {
        progress.advance();
        interrupt::flow()
    })?;
    timed(stage, run)
}

fn simulate(stage: &Stage) -> anyhow::Result<Timed> {
    let progress = Progress::new("simulating the truth", stage.frames, "frames");
    let start = stage.rest.positions.clone();
    let run = reference::run(
        &stage.loaded.scene,
        start,
        stage.frames,
        Threads::Pool,
        &mut || {
            progress.advance();
            interrupt::flow()
        },
    )?;
    timed(stage, run)
}

fn timed(stage: &Stage, run: Run) -> anyhow::Result<Timed> {
    let (spec, scene) = (&stage.loaded.spec, &stage.loaded.scene);
    Ok(Timed {
        trajectory: reference::trajectory(spec, scene, &stage.rest.positions, run.positions)?,
        ms_per_frame: run.ms_per_frame,
        end: run.end,
    })
}

fn write(
    trajectory: &Trajectory,
    folder: &Path,
    name: &str,
    wrote: &mut Vec<PathBuf>,
) -> anyhow::Result<()> {
    let path = folder.join(name).with_extension("safetensors");
    trajectory.write(&path)?;
    wrote.push(path);
    Ok(())
}

fn draw(show: &Show<'_>, args: &RolloutArgs, wrote: &mut Vec<PathBuf>) -> anyhow::Result<End> {
    let sheet = args.out.join("sheet.png");
    write_sheet(&sheet, show).context("the contact sheet")?;
    wrote.push(sheet);
    if args.clip() == Wanted::No {
        return Ok(End::Complete);
    }
    let clip = args.out.join("clip.gif");
    let end = write_clip_of(&clip, show).context("the clip")?;
    wrote.push(clip);
    Ok(end)
}

fn text(report: &Report) -> Facts {
    let mut facts = Facts::new();
    facts.add("scene", &report.scene);
    facts.add("model", &report.model);
    facts.add("vertices", report.vertices);
    facts.add("frames", report.frames);
    facts.add(
        "model",
        format!("{:.2} ms per frame", report.model_ms_per_frame),
    );
    if let Some(ms) = report.truth_ms_per_frame {
        facts.add("physics", format!("{ms:.2} ms per frame"));
    }
    facts.add("largest strain", percent(report.largest_strain));
    if let Some(measures) = &report.comparison {
        facts.add("position RMSE", length(measures.position_rmse));
        facts.add("largest distance", length(measures.position_max));
        facts.add("edge-length RMSE", length(measures.edge_length_rmse));
    }
    if report.interrupted {
        facts.add(
            "interrupted",
            "what is written is whole; the rest is missing",
        );
    }
    for path in &report.wrote {
        facts.add("wrote", path.display());
    }
    facts
}

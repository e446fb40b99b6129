//! `selvedge run --model`: a trained model on a scene, where asked for beside the physics, as trajectories, a contact
//! sheet and a clip.
//!
//! Each file is written as soon as it is known. Ctrl-C writes what there is of the trajectory under
//! way and leaves out what would come after it. Files of an earlier rollout are removed before the
//! first one is written, so that a folder never has files of two runs.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use selvedge_cloth::Stepper;
use selvedge_data::metrics::Comparison;
use selvedge_data::{LoadedScene, SavedState, Trajectory};
use selvedge_guard::Trust;
use selvedge_lab::domain::{self, Beyond};
use selvedge_lab::folder::{self, FolderKind, ROLLOUT};
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::physics::{self, SimulationPlan, TimedRun, compare};
use selvedge_lab::rigid::RigidRest;
use selvedge_lab::start;
use selvedge_lab::watched::{self, GuardSummary};
use selvedge_model::{Departure, Model};
use selvedge_sim::{SaggedRest, Threads};
use serde::Serialize;

use crate::cli::RunArgs;
use crate::exporting::Wish;
use crate::output::{Answer, End, Facts, length, percent};
use crate::pictures::{self, Show, write_clip_of, write_sheet};
use crate::progress::{self, Progress};
use crate::{exporting, interrupt, place, scenes};

/// The files of the folder.
const TRUTH: &str = "truth.safetensors";
const SHEET: &str = "sheet.png";
const CLIP: &str = "clip.gif";
const FILES: [&str; 4] = [ROLLOUT, TRUTH, SHEET, CLIP];

/// Text where a model has no domain.
const NO_DOMAIN: &str = "unknown: the model's file does not say what it was trained on";

#[derive(Serialize)]
struct RolloutReport {
    scene: String,
    model: String,
    device: String,
    vertices: usize,
    frames: usize,
    model_ms_per_frame: f64,
    truth_ms_per_frame: Option<f64>,
    /// Substeps per frame of the physics that was compared with.
    truth_substeps: Option<u32>,
    largest_strain: f64,
    /// The guard of frames that no cloth could have.
    guard: &'static str,
    guarded: GuardSummary,
    /// The first of more than ten frames in a row with an edge over 30 % strain, and over 1.5
    /// times the ground truth's largest where that was run.
    diverged_frame: Option<usize>,
    /// Parts of the scene that the model was not trained on; none where its file does not say.
    beyond: Option<Vec<Departure>>,
    comparison: Option<Comparison>,
    /// Position RMSE of a baseline, the rest pose that follows its handles as a rigid body `[m]`.
    rigid_rmse: Option<f64>,
    wrote: Vec<PathBuf>,
    /// Files of an earlier rollout that this one does not write anew.
    removed: Vec<PathBuf>,
    /// Wishes of the scene that cannot be met, or are likely mistakes.
    warnings: Vec<String>,
    interrupted: bool,
}

/// A trajectory and the wall time of a frame `[ms]`.
struct TimedTrajectory {
    trajectory: Trajectory,
    ms_per_frame: f64,
    end: End,
}

/// The model's run, with the guard's word on every frame.
struct Prediction {
    run: TimedTrajectory,
    log: Vec<Trust>,
    guarded: GuardSummary,
}

/// A scene at rest, the frames to be run, and the parts of both that the model was not trained on.
struct Setup {
    beyond: Option<Beyond>,
    loaded: LoadedScene,
    rest: SaggedRest,
    frames: usize,
}

/// Runs a model on a scene.
pub(crate) fn run(args: &RunArgs, model: &Path) -> anyhow::Result<Answer> {
    let _claimed = folder::claim_folder(args.folder(), FolderKind::Rollout)?;
    let wishes = exporting::wishes(&args.export)?;
    if let Some(trust) = &args.trust {
        place::check_file(trust, "--trust", &["csv"])?;
    }
    let mut loaded = scenes::open(&args.scene)?;
    check_places(args, &wishes, &loaded)?;
    let model = NamedModel::open(Some(model))?;
    for warning in start::for_model(&mut loaded) {
        tracing::warn!("{}: {warning}", args.scene);
    }
    let machine = args.machine.open()?;
    let setup = setup(args, loaded, &model.model)?;
    let mut wrote = Vec::new();
    let Prediction { run, log, guarded } = predict(&setup, &model, &machine, args)?;
    let mut removed = remove_earlier(args.folder())?;
    write(&run.trajectory, args.folder().join(ROLLOUT), &mut wrote)?;
    if let Some(trust) = &args.trust {
        watched::write_trust(trust, &log, setup.beyond.as_ref())?;
        wrote.push(trust.clone());
    }
    let truth = truth(&setup, args, run.end, &mut wrote)?;
    let (comparison, rigid_rmse, true_largest) = match truth.as_ref().map(|run| &run.trajectory) {
        Some(truth) => (
            Some(compare(truth, &run.trajectory)?),
            Some(rigid_rmse(&setup, truth)?),
            physics::largest_strain(truth)?,
        ),
        None => (None, None, 0.0),
    };
    let mut end = truth.as_ref().map_or(run.end, |truth| truth.end);
    if end == End::Complete {
        let show = Show {
            title: &setup.loaded.scene.name,
            label: pictures::MODEL,
            prediction: &run.trajectory,
            truth: truth.as_ref().map(|truth| &truth.trajectory),
        };
        end = draw(&show, args, &mut wrote)?;
    }
    end = exporting::fulfil(&wishes, &run.trajectory, end, &mut wrote)?;
    removed.retain(|path| !wrote.contains(path));
    let strains: Vec<f64> = log.iter().map(|t| t.given.largest_strain).collect();
    let report = RolloutReport {
        scene: setup.loaded.scene.name.clone(),
        model: model.name,
        device: machine.name(),
        vertices: run.trajectory.vertex_count(),
        frames: run.trajectory.frame_count(),
        model_ms_per_frame: run.ms_per_frame,
        truth_ms_per_frame: truth.as_ref().map(|truth| truth.ms_per_frame),
        truth_substeps: truth.as_ref().map(|_| setup.loaded.scene.physics.substeps),
        largest_strain: physics::largest_strain(&run.trajectory)?,
        guard: args.guard.name(),
        guarded,
        diverged_frame: watched::diverged_frame(&strains, true_largest),
        beyond: setup.beyond.map(|beyond| beyond.departures),
        comparison,
        rigid_rmse,
        wrote,
        removed,
        warnings: setup.loaded.warnings.clone(),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// Position RMSE of the rest pose that follows its handles as a rigid body, against the ground truth
/// `[m]`.
fn rigid_rmse(setup: &Setup, truth: &Trajectory) -> anyhow::Result<f64> {
    let path = setup.loaded.scene.handle_path()?;
    let mut rigid = RigidRest::new(truth.cloth());
    let frames = truth.frame_count() - 1;
    let run = physics::drive(&mut rigid, &path, frames, &mut |_| interrupt::flow())?;
    let rigid = timed(setup, run)?.trajectory;
    Ok(compare(truth, &rigid)?.position_rmse)
}

/// Removes the files of an earlier rollout from the folder and returns those that were there.
/// Nothing else in it is touched.
fn remove_earlier(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut removed = Vec::new();
    for path in FILES.map(|name| folder.join(name)) {
        match fs::remove_file(&path) {
            Ok(()) => removed.push(path),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => {
                let problem = "this file of an earlier rollout could not be removed";
                return Err(error).context(format!("{}: {problem}", path.display()));
            }
        }
    }
    Ok(removed)
}

/// The rest pose of a scene, and the frames that are asked for.
fn setup(args: &RunArgs, loaded: LoadedScene, model: &Model) -> anyhow::Result<Setup> {
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => loaded.scene.frame_count()?,
    };
    let beyond = domain::of_scene(model, &loaded.scene, frames)?;
    let rest = physics::rest_pose(&loaded.scene, &mut progress::listener())?;
    Ok(Setup {
        beyond,
        loaded,
        rest,
        frames,
    })
}

/// Simulates and writes the truth where it is asked for, after a run that was not interrupted.
fn truth(
    setup: &Setup,
    args: &RunArgs,
    end: End,
    wrote: &mut Vec<PathBuf>,
) -> anyhow::Result<Option<TimedTrajectory>> {
    if !args.compare || end == End::Interrupted {
        return Ok(None);
    }
    let run = simulate(setup)?;
    write(&run.trajectory, args.folder().join(TRUTH), wrote)?;
    Ok(Some(run))
}

/// Checks that nothing is written over something else that is written, and that nothing that is
/// read is written over or removed.
fn check_places(args: &RunArgs, wishes: &[Wish], loaded: &LoadedScene) -> anyhow::Result<()> {
    let wanted = [
        (ROLLOUT, true),
        (TRUTH, args.compare),
        (SHEET, true),
        (CLIP, !args.no_clip),
    ];
    let own = wanted.into_iter().filter(|file| file.1);
    let own: Vec<PathBuf> = own.map(|(name, _)| args.folder().join(name)).collect();
    let all = FILES.map(|name| args.folder().join(name));
    let exports = exporting::outputs(wishes);
    let own = own
        .iter()
        .map(|path| ("a file of --output", path.as_path()));
    let mut outputs: Vec<_> = own.collect();
    outputs.extend(args.trust.as_deref().map(|path| ("--trust", path)));
    outputs.extend(exports.iter().map(|path| ("--export", path.as_path())));
    let mut inputs = scenes::inputs(loaded);
    inputs.extend(args.model.as_deref().map(|path| ("--model", path)));
    place::check_outputs(&outputs, &inputs)?;
    let all: Vec<_> = all
        .iter()
        .map(|path| ("a file of --output", path.as_path()))
        .collect();
    place::check_outputs(&all, &inputs)
}

fn predict(
    setup: &Setup,
    model: &NamedModel,
    machine: &Machine,
    args: &RunArgs,
) -> anyhow::Result<Prediction> {
    let scene = &setup.loaded.scene;
    let path = scene.handle_path()?;
    let (known, rest) = (Arc::new(scene.clone()), &setup.rest.positions);
    let mut guard = start::guarded(&known, rest, model, machine, args.guard.settings())?;
    let mut log = Vec::new();
    guard.stop_by(interrupt::flag().into());
    let progress = Progress::new("predicting", setup.frames, "frames");
    let run = physics::drive(&mut guard, &path, setup.frames, &mut |guard| {
        log.push(*guard.trust());
        progress.advance();
        interrupt::flow()
    })
    .with_context(|| format!("the rollout of model {}", model.name))?;
    if let Some(failure) = guard.physics_failure() {
        tracing::warn!("the guard did without its physics: {failure}");
    }
    Ok(Prediction {
        run: timed(setup, run)?,
        guarded: watched::summary(&log),
        log,
    })
}

fn simulate(setup: &Setup) -> anyhow::Result<TimedTrajectory> {
    let progress = Progress::new("simulating the truth", setup.frames, "frames");
    let plan = SimulationPlan {
        start: SavedState::at_rest(setup.rest.positions.clone()),
        frames: setup.frames,
        keeps_states: false,
        threads: Threads::Pool,
        stop: interrupt::flag(),
    };
    let (run, _) = physics::run_plan(&setup.loaded.scene, plan, &mut || {
        progress.advance();
        interrupt::flow()
    })?
    .whole()?;
    timed(setup, run)
}

fn timed(setup: &Setup, run: TimedRun) -> anyhow::Result<TimedTrajectory> {
    let LoadedScene { spec, scene, .. } = &setup.loaded;
    Ok(TimedTrajectory {
        trajectory: physics::trajectory(0, spec, scene, &setup.rest.positions, run.positions)?,
        ms_per_frame: run.ms_per_frame,
        end: run.end,
    })
}

fn write(trajectory: &Trajectory, path: PathBuf, wrote: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    trajectory.write(&path)?;
    wrote.push(path);
    Ok(())
}

fn draw(show: &Show<'_>, args: &RunArgs, wrote: &mut Vec<PathBuf>) -> anyhow::Result<End> {
    let sheet = args.folder().join(SHEET);
    write_sheet(&sheet, show).context("the contact sheet")?;
    wrote.push(sheet);
    if args.no_clip {
        return Ok(End::Complete);
    }
    let clip = args.folder().join(CLIP);
    let end = write_clip_of(&clip, show).context("the clip")?;
    wrote.push(clip);
    Ok(end)
}

fn guard_line(report: &RolloutReport) -> String {
    let GuardSummary {
        corrected,
        lost,
        largest_correction,
        ..
    } = report.guarded;
    let lost_in_words = report.guarded.lost_in_words();
    let farthest = length(largest_correction);
    match report.guard {
        "none" => format!("none ({} frames beyond bounds)", corrected + lost),
        name => {
            let contact = report.guarded.contact_in_words();
            let contact = contact.map_or_else(String::new, |words| format!("; {words}"));
            format!(
                "{name}: {corrected} frames corrected, by {farthest} at most; {lost_in_words} lost{contact}"
            )
        }
    }
}

fn text(report: &RolloutReport) -> Facts {
    let mut facts = Facts::new();
    facts.add("scene", &report.scene);
    facts.add("model", &report.model);
    facts.add("device", &report.device);
    facts.add("vertices", report.vertices);
    facts.add("frames", report.frames);
    facts.add(
        "time of the model",
        format!("{:.2} ms per frame", report.model_ms_per_frame),
    );
    if let (Some(ms), Some(substeps)) = (report.truth_ms_per_frame, report.truth_substeps) {
        let plural = if substeps == 1 { "" } else { "s" };
        facts.add(
            "physics",
            format!("{ms:.2} ms per frame, {substeps} substep{plural}"),
        );
    }
    facts.add("largest strain", percent(report.largest_strain));
    facts.add("guard", guard_line(report));
    match &report.beyond {
        Some(departures) => {
            for departure in departures {
                facts.add("out of distribution", departure);
            }
        }
        None => facts.add("out of distribution", NO_DOMAIN),
    }
    if let Some(frame) = report.diverged_frame {
        facts.add("diverges", format!("from frame {frame} on"));
    }
    if let Some(measures) = &report.comparison {
        let baseline = report.rigid_rmse.map_or_else(String::new, |rmse| {
            format!(" (rigid motion: {})", length(rmse))
        });
        facts.add("position RMSE", length(measures.position_rmse) + &baseline);
        facts.add("largest distance", length(measures.position_max));
        facts.add("edge-length RMSE", length(measures.edge_length_rmse));
    }
    if report.interrupted {
        facts.add(
            "interrupted",
            "what is written is whole; the rest is missing",
        );
    }
    facts.add_paths("wrote", &report.wrote);
    for path in &report.removed {
        facts.add(
            "removed",
            format!("{}, of an earlier rollout", path.display()),
        );
    }
    facts
}

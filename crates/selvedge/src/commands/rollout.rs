//! `selvedge run --model`: a trained model on a scene, where asked for beside the physics, as trajectories, a contact
//! sheet and a clip.
//!
//! Each file is written as soon as it is known. Ctrl-C writes what there is of the trajectory under
//! way and leaves out what would come after it. Files of an earlier rollout are removed before the
//! first one is written, so that a folder never has files of two runs.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use anyhow::Context;
use selvedge::{Network, Run, Scene};
use selvedge_cloth::Stepper;
use selvedge_data::export::check_free;
use selvedge_data::{LoadedScene, Trajectory, write_atomically};
use selvedge_guard::Trust;
use selvedge_lab::domain::{self, Beyond};
use selvedge_lab::folder::{self, FolderKind, ROLLOUT};
use selvedge_lab::physics::{self, TimedRun, compare};
use selvedge_lab::pictures::{self, Show};
use selvedge_lab::rigid::RigidRest;
use selvedge_lab::watched::{self, GuardSummary};
use serde_json::json;

use crate::cli::RunArgs;
use crate::exporting::Export;
use crate::output::{Answer, End, Facts, length, percent};
use crate::progress::{self, Progress};
use crate::{exporting, interrupt, place, scenes};

/// The files of the folder.
const TRUTH: &str = "truth.safetensors";
const SHEET: &str = "sheet.png";
const CLIP: &str = "clip.gif";
const FILES: [&str; 4] = [ROLLOUT, TRUTH, SHEET, CLIP];

/// Text where a model has no domain.
const NO_DOMAIN: &str = "unknown: the model's file does not say what it was trained on";

/// A trajectory and the wall time of a frame `[ms]`.
struct TimedTrajectory {
    trajectory: Trajectory,
    ms_per_frame: f64,
    end: End,
}

/// A model on a scene at rest, the frames to be run, and the parts of both that it was not trained on.
struct Setup {
    beyond: Option<Beyond>,
    run: Run,
    frames: usize,
}

/// Runs a model on a scene.
pub(crate) fn run(args: &RunArgs, model: &Path) -> anyhow::Result<Answer> {
    let _claimed = folder::claim_folder(args.folder(), FolderKind::Rollout)?;
    check_foreign(args.folder())?;
    let exports = exporting::exports(&args.export)?;
    if let Some(trust) = &args.trust {
        place::check_file(trust, "--trust", &["csv"])?;
    }
    let loaded = scenes::open(&args.scene)?;
    check_places(args, &exports, &loaded)?;
    let model = selvedge::Model::open(Some(model))?;
    let machine = args.machine.open()?;
    let network = Network {
        model: &model,
        machine: &machine,
        guard: args.guard,
    };
    let mut setup = setup(args, loaded.into(), network)?;
    let mut wrote = Vec::new();
    let (run, log) = predict(&mut setup, &model.name)?;
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
            rigid_rmse(&setup, truth)?,
            Some(physics::largest_strain(truth)?),
        ),
        None => (None, None, None),
    };
    let mut end = truth.as_ref().map_or(run.end, |truth| truth.end);
    if end == End::Complete {
        let show = Show {
            title: &setup.run.scene().built().name,
            label: pictures::MODEL,
            prediction: &run.trajectory,
            truth: truth.as_ref().map(|truth| &truth.trajectory),
        };
        end = draw(&show, args, &mut wrote)?;
    }
    end = exporting::write(&exports, &run.trajectory, end, &mut wrote)?;
    removed.retain(|path| !wrote.contains(path));
    let strains: Vec<f64> = log.iter().map(|t| t.given.largest_strain).collect();
    let diverged_frame = watched::diverged_frame(&strains, true_largest.unwrap_or(0.0));
    // Without a truth nobody knows how far this cloth strains.
    let (diverged_frame, suspected_frame) = match true_largest {
        Some(_) => (diverged_frame, None),
        None => (None, diverged_frame),
    };
    let largest_strain = physics::largest_strain(&run.trajectory)?;
    let (guarded, scene) = (watched::summary(&log), setup.run.scene());
    let (warnings, scene) = (
        [scene.warnings(), setup.run.start_warnings()].concat(),
        scene.built(),
    );
    let departures = setup.beyond.map(|beyond| beyond.departures);
    let mut facts = Facts::new();
    facts.tell("scene", &scene.name);
    facts.tell("model", &model.name);
    facts.tell("device", machine.name());
    facts.tell("vertices", run.trajectory.vertex_count());
    facts.tell("frames", run.trajectory.frame_count());
    let pace = format!("{:.2} ms per frame", run.ms_per_frame);
    facts.add("time of the model", pace);
    if let Some(truth) = &truth {
        let substeps = scene.physics.substeps;
        let plural = if substeps == 1 { "" } else { "s" };
        let ms = truth.ms_per_frame;
        let words = format!("{ms:.2} ms per frame, {substeps} substep{plural}");
        facts.add("time of the solver", words);
    }
    facts.tell_as("largest strain", percent(largest_strain), largest_strain);
    facts.add("guard", guard_line(args.guard.name(), &guarded));
    let doubt = guarded.doubt_in_words();
    facts.add_all("not to be trusted", &doubt);
    match &departures {
        Some(departures) => facts.add_all("out of distribution", departures),
        None => facts.add("out of distribution", NO_DOMAIN),
    }
    let from = diverged_frame.map(|frame| format!("from frame {frame} on"));
    facts.add_all("diverges", from);
    facts.add_all("may diverge", suspected_frame.map(|frame| format!("from frame {frame} on edges strain by more than 30 %: --compare says how far they do by the solver")));
    if let Some(measures) = &comparison {
        let baseline = rigid_rmse.map(|rigid| format!(" (rigid motion: {})", length(rigid)));
        let baseline = baseline.unwrap_or_default();
        facts.add("position RMSE", length(measures.position_rmse) + &baseline);
        facts.add("largest distance", length(measures.position_max));
        facts.add("edge-length RMSE", length(measures.edge_length_rmse));
    }
    if end == End::Interrupted {
        let words = "what is written is whole; the rest is missing";
        facts.add("interrupted", words);
    }
    facts.add_paths("wrote", &wrote);
    let earlier = |path: &PathBuf| format!("{}, of an earlier rollout", path.display());
    facts.add_all("removed", removed.iter().map(earlier));
    let report = json!({
        "model_ms_per_frame": run.ms_per_frame,
        "truth_ms_per_frame": truth.as_ref().map(|truth| truth.ms_per_frame),
        "truth_substeps": truth.as_ref().map(|_| scene.physics.substeps),
        "guard": args.guard.name(),
        "guarded": guarded,
        // Why the motion is not to be trusted; none where it may be.
        "doubt": doubt,
        // The first of more than ten frames in a row with an edge over 30 % strain, and over 1.5
        // times the ground truth's largest; a suspicion where that was not run.
        "diverged_frame": diverged_frame,
        "suspected_frame": suspected_frame,
        // Parts of the scene that the model was not trained on; none where its file does not say.
        "beyond": departures,
        "comparison": comparison,
        // Of a baseline, the rest pose that follows its handles as a rigid body [m]; none where a
        // handle lets go.
        "rigid_rmse": rigid_rmse,
        "wrote": wrote,
        "removed": removed,
        "warnings": warnings,
    });
    Ok(facts.answer_at(end, report))
}

/// Position RMSE of the rest pose that follows its handles as a rigid body, against the ground truth
/// `[m]`; none where a handle lets go, after which there is no such body.
fn rigid_rmse(setup: &Setup, truth: &Trajectory) -> anyhow::Result<Option<f64>> {
    let scene = setup.run.scene().built();
    if !scene.schedule.is_empty() {
        return Ok(None);
    }
    let rigid = Box::new(RigidRest::new(truth.cloth()));
    let mut rigid = Run::of_stepper(setup.run.scene(), rigid)?;
    let frames = truth.frame_count() - 1;
    let made = physics::simulate(&mut rigid, frames, false, &mut |_| interrupt::flow());
    let rigid = rigid.trajectory(made.whole()?.0.positions)?;
    Ok(Some(compare(truth, &rigid)?.position_rmse))
}

/// Checks that a folder without a rollout has no files of the names that one has: they are others.
fn check_foreign(folder: &Path) -> anyhow::Result<()> {
    if FolderKind::of(folder) != Some(FolderKind::Rollout) {
        for name in FILES {
            check_free(&folder.join(name))?;
        }
    }
    Ok(())
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

/// The model on the scene at rest, and the frames that are asked for.
fn setup(args: &RunArgs, scene: Scene, network: Network<'_>) -> anyhow::Result<Setup> {
    let built = scene.built();
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => built.frame_count()?,
    };
    let beyond = domain::of_scene(&network.model.model, built, frames)?;
    let mut run = Run::begin_model(&scene, network, &mut progress::listener())?;
    run.stop_by(interrupt::flag().into());
    for warning in run.start_warnings() {
        tracing::warn!("{}: {warning}", args.scene);
    }
    Ok(Setup {
        beyond,
        run,
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
    let progress = Progress::new("simulating the truth", setup.frames, "frames");
    let mut run = Run::new(setup.run.scene())?;
    run.stop_by(interrupt::flag().into());
    let made = physics::simulate(&mut run, setup.frames, false, &mut |_| progress.step());
    let run = timed(&run, made.whole()?.0)?;
    write(&run.trajectory, args.folder().join(TRUTH), wrote)?;
    Ok(Some(run))
}

/// Checks that nothing is written over something else that is written, and that nothing that is
/// read is written over or removed.
fn check_places(args: &RunArgs, exports: &[Export], loaded: &LoadedScene) -> anyhow::Result<()> {
    let own = |name: &str| ("a file of --output", args.folder().join(name));
    let mut outputs = vec![own(ROLLOUT), own(SHEET)];
    outputs.extend(args.compare.then(|| own(TRUTH)));
    outputs.extend((!args.no_clip).then(|| own(CLIP)));
    outputs.extend(args.trust.iter().map(|path| ("--trust", path.clone())));
    let exports = exporting::outputs(exports).into_iter();
    outputs.extend(exports.map(|path| ("--export", path)));
    let mut inputs = scenes::inputs(loaded);
    inputs.extend(args.model.as_deref().map(|path| ("--model", path)));
    place::check_outputs(&outputs, &inputs)?;
    place::check_outputs(&FILES.map(own), &inputs)
}

/// The model's run, with the guard's word on every frame.
fn predict(setup: &mut Setup, model: &str) -> anyhow::Result<(TimedTrajectory, Vec<Trust>)> {
    let mut log = Vec::new();
    let progress = Progress::new("predicting", setup.frames, "frames");
    let made = physics::simulate(&mut setup.run, setup.frames, false, &mut |now| {
        log.extend(now.trust());
        progress.step()
    });
    let what = || format!("the rollout of model {model}");
    let (made, _) = made.whole().with_context(what)?;
    Ok((timed(&setup.run, made)?, log))
}

fn timed(run: &Run, made: TimedRun) -> anyhow::Result<TimedTrajectory> {
    Ok(TimedTrajectory {
        trajectory: run.trajectory(made.positions)?,
        ms_per_frame: made.ms_per_frame,
        end: made.end,
    })
}

fn write(trajectory: &Trajectory, path: PathBuf, wrote: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    trajectory.write(&path)?;
    wrote.push(path);
    Ok(())
}

fn draw(show: &Show<'_>, args: &RunArgs, wrote: &mut Vec<PathBuf>) -> anyhow::Result<End> {
    let sheet = args.folder().join(SHEET);
    let png = pictures::sheet(show).context("the contact sheet")?;
    place::write(&sheet, &png).context("the contact sheet")?;
    wrote.push(sheet);
    if args.no_clip {
        return Ok(End::Complete);
    }
    let clip = args.folder().join(CLIP);
    let end = write_clip(&clip, show).context("the clip")?;
    wrote.push(clip);
    Ok(end)
}

/// Writes a clip (.gif) in real time; one that is interrupted ends early, but is whole.
fn write_clip(path: &Path, show: &Show<'_>) -> anyhow::Result<End> {
    let count = pictures::clip_pictures(show.prediction);
    let progress = Progress::new("drawing the clip", count, "pictures");
    let mut end = End::Complete;
    write_atomically(path, |out| {
        let result = pictures::clip(out, show, &mut || progress.step());
        if result.map_err(io::Error::other)?.is_break() {
            end = End::Interrupted;
        }
        Ok(())
    })?;
    Ok(end)
}

fn guard_line(guard: &str, summary: &GuardSummary) -> String {
    let (corrected, lost) = (summary.corrected, summary.lost);
    if guard == "none" {
        return format!("none ({} frames beyond bounds)", corrected + lost);
    }
    let (farthest, lost) = (length(summary.largest_correction), summary.lost_in_words());
    let contact = summary.contact_in_words();
    let contact = contact.map_or_else(String::new, |words| format!("; {words}"));
    format!("{guard}: {corrected} frames corrected, by {farthest} at most; {lost} lost{contact}")
}

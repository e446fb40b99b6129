//! `selvedge run` without a model: the physics on a scene, as a trajectory.

use std::path::{Path, PathBuf};

use selvedge_cloth::Scene;
use selvedge_data::{LoadedScene, SavedState, StartSpec, StateChoice, StateRun, metrics};
use selvedge_lab::physics::{self, Simulated, SimulationPlan, TimedRun};
use selvedge_lab::start;
use selvedge_sim::{DividedFrames, SubstepCounts, Threads};
use serde::Serialize;

use crate::cli::{RunArgs, StartChoice};
use crate::exporting::Wish;
use crate::failure::chain;
use crate::output::{Answer, End, Facts, percent};
use crate::progress::{self, Progress};
use crate::{exporting, interrupt, output, place, scenes};

mod touched;

use touched::Touched;

#[derive(Serialize)]
struct SimulateReport {
    scene: String,
    out: PathBuf,
    states: Option<PathBuf>,
    vertices: usize,
    /// Frames of the motion that had passed at the start.
    first_frame: usize,
    frames: usize,
    ms_per_frame: f64,
    sag_solves: Option<u32>,
    sag_residual: Option<f64>,
    largest_strain: f64,
    /// Mean speed of the vertices in the last second `[m/s]`.
    final_speed: f64,
    /// Substeps by what they came to; none with an integrator of first order.
    substeps: Option<SubstepReport>,
    /// Frames that took more substeps than the scene asks for.
    divided_frames: u64,
    /// Contact in the run; none in a scene without.
    contact: Option<Touched>,
    exported: Vec<PathBuf>,
    /// Wishes of the scene that cannot be met, or are likely mistakes.
    warnings: Vec<String>,
    interrupted: bool,
    /// The step that failed, after the frames that were written.
    failure: Option<String>,
}

/// Substeps of second order.
#[derive(Clone, Copy, Serialize)]
struct SubstepReport {
    all: u64,
    /// Those without a state one substep before.
    started_anew: u64,
    /// Those of first order.
    fell_back: u64,
}

impl SubstepReport {
    fn of(counts: SubstepCounts) -> Self {
        Self {
            all: counts.all,
            started_anew: counts.started,
            fell_back: counts.fell_back,
        }
    }
}

/// Share of substeps that fell back to first order from which a run warns.
const MANY: f64 = 0.1;

/// Simulates a scene and writes the trajectory, that of the frames before where one fails.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    check_files(args)?;
    let wishes = exporting::wishes(&args.export)?;
    let mut loaded = scenes::open(&args.scene)?;
    check_places(args, &wishes, &loaded)?;
    choose_start(&mut loaded, args.start.as_ref())?;
    let start = start::find(&loaded, &mut progress::listener())?;
    if let Some(fitted) = &start.fitted {
        let (remarks, warning) = (fitted.remarks.iter(), fitted.warning.iter());
        remarks.for_each(|remark| tracing::info!("{remark}"));
        warning.for_each(|warning| tracing::warn!("{warning}"));
    }
    let (rest, state) = (start.rest, start.state);
    let (scene, passed) = (&loaded.scene, state.frame);
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => frames_left(scene.frame_count()?, passed)?,
    };
    let (run, states, failure) = simulate(args, scene, state, frames)?;
    let rest_positions = rest
        .as_ref()
        .map_or(scene.mesh.positions(), |rest| &rest.positions);
    let spec = &loaded.spec;
    let trajectory = physics::trajectory(passed, spec, scene, rest_positions, run.positions)?;
    trajectory.write(args.file())?;
    if let (Some(states), Some(path)) = (states, &args.states) {
        states.write(path, trajectory.provenance())?;
    }
    let contact = touched::measure(scene, &trajectory, passed, run.contact, &run.yielded);
    let substeps = run.substeps.map(SubstepReport::of);
    warn_of_falls(scene, substeps);
    let mut exported = Vec::new();
    let end = exporting::fulfil(&wishes, &trajectory, run.end, &mut exported)?;
    let report = SimulateReport {
        scene: scene.name.clone(),
        out: args.file().to_owned(),
        states: args.states.clone(),
        vertices: trajectory.vertex_count(),
        first_frame: passed,
        frames: trajectory.frame_count(),
        ms_per_frame: run.ms_per_frame,
        sag_solves: rest.as_ref().map(|rest| rest.solves),
        sag_residual: rest.as_ref().map(|rest| rest.residual),
        largest_strain: physics::largest_strain(&trajectory)?,
        final_speed: metrics::final_speed(trajectory.frames(), scene.frame_rate)?,
        substeps,
        divided_frames: run.divided.frames,
        contact,
        exported,
        warnings: loaded.warnings.clone(),
        interrupted: end == End::Interrupted && failure.is_none(),
        failure: failure.as_ref().map(chain),
    };
    let answer = Answer::new(text(&report, frames + 1, run.divided), &report)?.ended(end);
    Ok(match failure {
        Some(error) => answer.failing(whats_left(&error, &report)),
        None => answer,
    })
}

/// Says why a run failed, and where the frames before are.
fn whats_left(error: &anyhow::Error, report: &SimulateReport) -> String {
    let last = report.first_frame + report.frames - 1;
    format!(
        "{}; the frames before, up to {last}, are in {}",
        chain(error),
        report.out.display()
    )
}

/// Warns of a run of second order with many substeps of first order, and says what helps.
fn warn_of_falls(scene: &Scene, substeps: Option<SubstepReport>) {
    let Some(SubstepReport { all, fell_back, .. }) = substeps else {
        return;
    };
    // What touches is of first order anyway.
    if scene.contact.is_some() || fell_back as f64 <= MANY * all as f64 {
        return;
    }
    let substeps = scene.physics.substeps;
    tracing::warn!(
        "{fell_back} of {all} substeps fell back to first order: the cloth moves so fast that a prediction strained it too much; use more substeps (physics.substeps, {substeps} now) or slower handles"
    );
}

/// Checks that the files that are asked for can be made.
fn check_files(args: &RunArgs) -> anyhow::Result<()> {
    place::check_file(args.file(), "--output", &["safetensors"])?;
    if let Some(states) = &args.states {
        place::check_file(states, "--states", &["safetensors"])?;
    }
    Ok(())
}

/// Runs the physics, with the states where they are asked for, and the step that failed after at
/// least one that did not.
fn simulate(
    args: &RunArgs,
    scene: &Scene,
    start: SavedState,
    frames: usize,
) -> anyhow::Result<(TimedRun, Option<StateRun>, Option<anyhow::Error>)> {
    let plan = SimulationPlan {
        start,
        frames,
        keeps_states: args.states.is_some(),
        threads: Threads::Pool,
        stop: interrupt::flag(),
    };
    let progress = Progress::new("simulating", frames, "frames");
    let Simulated {
        run,
        states,
        failure,
    } = physics::run_plan(scene, plan, &mut || {
        progress.advance();
        interrupt::flow()
    })?;
    match failure {
        Some(error) if run.positions.len() <= scene.mesh.positions().len() => Err(error),
        failure => Ok((run, states, failure)),
    }
}

/// Checks that nothing is written over something else that is written, or over what is read.
fn check_places(args: &RunArgs, wishes: &[Wish], loaded: &LoadedScene) -> anyhow::Result<()> {
    let exports = exporting::outputs(wishes);
    let mut outputs = vec![("--output", args.file())];
    outputs.extend(args.states.as_deref().map(|path| ("--states", path)));
    outputs.extend(exports.iter().map(|path| ("--export", path.as_path())));
    let mut inputs = scenes::inputs(loaded);
    inputs.extend(
        args.start
            .as_ref()
            .and_then(StartChoice::file)
            .map(|path| ("--start", path)),
    );
    place::check_outputs(&outputs, &inputs)
}

/// Puts what the command line says of the start in the place of what the scene says.
fn choose_start(loaded: &mut LoadedScene, start: Option<&StartChoice>) -> anyhow::Result<()> {
    let (spec, state) = match start {
        None => return Ok(()),
        Some(StartChoice::Rest) => (StartSpec::Rest, None),
        Some(StartChoice::Mesh) => (StartSpec::Mesh, None),
        Some(StartChoice::Untangle) => (StartSpec::Untangle, None),
        Some(StartChoice::Fit) => (StartSpec::Fit, None),
        Some(StartChoice::State(path, frame)) => {
            let choice = StateChoice {
                file: path.to_string_lossy().into_owned(),
                frame: *frame,
                frame_rate: Some(loaded.scene.frame_rate),
                ..StateChoice::default()
            };
            let vertices = loaded.scene.mesh.topology().vertex_count();
            let (state, spec) = SavedState::read(Path::new(""), &choice, vertices)?;
            (StartSpec::State(spec), Some(state))
        }
    };
    loaded.spec.start = spec;
    loaded.state = state;
    Ok(())
}

/// Frames of a motion of `all` after `passed`.
fn frames_left(all: usize, passed: usize) -> anyhow::Result<usize> {
    match all.checked_sub(passed) {
        Some(left) if left > 0 => Ok(left),
        _ => anyhow::bail!(
            "the motion lasts {all} frames, and {passed} of them have passed: say how many with --frames"
        ),
    }
}

fn text(report: &SimulateReport, wanted: usize, divided: DividedFrames) -> Facts {
    let mut facts = Facts::new();
    facts.add("scene", &report.scene);
    facts.add("vertices", report.vertices);
    let frames = match &report.failure {
        Some(_) => format!("{} of {wanted}: failed", report.frames),
        None if report.interrupted => format!("{} of {wanted}: interrupted", report.frames),
        None => report.frames.to_string(),
    };
    facts.add("frames", frames);
    if report.first_frame > 0 {
        facts.add("from frame", report.first_frame);
    }
    facts.add("time", format!("{:.2} ms per frame", report.ms_per_frame));
    if let (Some(solves), Some(residual)) = (report.sag_solves, report.sag_residual) {
        facts.add("sag", format!("{solves} solves, {residual:.1e} m/s² left"));
    }
    facts.add("largest strain", percent(report.largest_strain));
    facts.add(
        "speed",
        format!("{:.4} m/s in the last second", report.final_speed),
    );
    if let Some(substeps) = report.substeps {
        facts.add(
            "substeps",
            format!(
                "{}, {} started anew, {} fell back to first order",
                substeps.all, substeps.started_anew, substeps.fell_back
            ),
        );
    }
    if let Some(words) = output::divided(divided) {
        facts.add("divided", words);
    }
    if let Some(contact) = &report.contact {
        contact.add_to(&mut facts);
    }
    facts.add("wrote", report.out.display());
    if let Some(states) = &report.states {
        facts.add("states", states.display());
    }
    facts.add_paths("exported", &report.exported);
    facts
}

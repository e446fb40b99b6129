//! `selvedge run` without a model: the physics on a scene, as a trajectory.

use std::path::Path;

use selvedge::{Run, Scene};
use selvedge_cloth::Stepper;
use selvedge_data::{LoadedScene, StartSpec, StateChoice, metrics};
use selvedge_lab::physics::{self, Simulated};
use selvedge_sim::{SaggedRest, Simulator, SubstepCounts};
use serde_json::json;

use crate::cli::{RunArgs, StartChoice};
use crate::exporting::Export;
use crate::failure::chain;
use crate::output::{Answer, End, Facts, percent};
use crate::progress::{self, Progress};
use crate::{exporting, interrupt, output, place, scenes};

mod touched;

/// Share of substeps that fell back to first order from which a run warns.
const MANY: f64 = 0.1;

/// Simulates a scene and writes the trajectory, that of the frames before where one fails.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    check_files(args)?;
    let exports = exporting::exports(&args.export)?;
    let mut loaded = scenes::open(&args.scene)?;
    check_places(args, &exports, &loaded)?;
    choose_start(&mut loaded, args.start.as_ref())?;
    let scene = Scene::from(loaded);
    let mut moving = Run::begin(&scene, &mut progress::listener())?;
    let (remarks, warnings) = (moving.remarks().iter(), moving.start_warnings().iter());
    remarks.for_each(|remark| tracing::info!("{remark}"));
    warnings.for_each(|warning| tracing::warn!("{warning}"));
    let passed = moving.frame();
    let frames = match args.frames {
        Some(frames) => frames as usize,
        None => frames_left(scene.built().frame_count()?, passed)?,
    };
    let Simulated {
        run,
        states,
        failure,
    } = simulate(args, &mut moving, frames)?;
    let (rest, warned) = (moving.rest(), scene.warnings());
    let trajectory = moving.trajectory(run.positions)?;
    let scene = scene.built();
    trajectory.write(args.file())?;
    if let (Some(states), Some(path)) = (states, &args.states) {
        states.write(path, trajectory.provenance())?;
    }
    let solver = moving.solver();
    let stats = solver.map(Simulator::stats).unwrap_or_default();
    let yielded = solver.map(Simulator::yielded).unwrap_or_default();
    let is_second_order = scene.physics.integrator.order() > 1;
    let substeps = is_second_order.then_some(stats.substeps);
    let contact = touched::measure(scene, &trajectory, passed, stats.contact, yielded);
    warn_of_falls(scene, substeps);
    let mut exported = Vec::new();
    let mut end = exporting::write(&exports, &trajectory, run.end, &mut exported)?;
    let wanted = frames + 1;
    let frames = trajectory.frame_count();
    let mut facts = Facts::new();
    facts.tell("scene", &scene.name);
    facts.tell("vertices", trajectory.vertex_count());
    let made = match end {
        _ if failure.is_some() => format!("{frames} of {wanted}: failed"),
        End::Interrupted => format!("{frames} of {wanted}: interrupted"),
        End::Complete => frames.to_string(),
    };
    facts.add("frames", made);
    if passed > 0 {
        facts.add("from frame", passed);
    }
    facts.add("time", format!("{:.2} ms per frame", run.ms_per_frame));
    if let Some(SaggedRest {
        solves, residual, ..
    }) = rest
    {
        facts.add("sag", format!("{solves} solves, {residual:.1e} m/s² left"));
    }
    let largest_strain = physics::largest_strain(&trajectory)?;
    facts.tell_as("largest strain", percent(largest_strain), largest_strain);
    let final_speed = metrics::final_speed(trajectory.frames(), scene.frame_rate)?;
    facts.add("speed", format!("{final_speed:.4} m/s in the last second"));
    if let Some(SubstepCounts {
        all,
        started,
        fell_back,
    }) = substeps
    {
        let words = format!("{all}, {started} started anew, {fell_back} fell back to first order");
        facts.add("substeps", words);
    }
    facts.add_all("divided", output::divided(stats.divided));
    if let Some(contact) = &contact {
        contact.add_to(&mut facts);
    }
    facts.add("wrote", args.file().display());
    facts.add_paths("states", args.states.as_slice());
    facts.add_paths("exported", &exported);
    if failure.is_some() {
        end = End::Complete;
    }
    let report = json!({
        "out": args.file(),
        "states": args.states,
        // Frames of the motion that had passed at the start.
        "first_frame": passed,
        "frames": frames,
        "ms_per_frame": run.ms_per_frame,
        "sag_solves": rest.map(|rest| rest.solves),
        "sag_residual": rest.map(|rest| rest.residual),
        // Of the vertices on average in the last second [m/s].
        "final_speed": final_speed,
        // None with an integrator of first order.
        "substeps": substeps.map(|substeps| json!({
            "all": substeps.all,
            // Those without a state one substep before, and those of first order.
            "started_anew": substeps.started,
            "fell_back": substeps.fell_back,
        })),
        "divided_frames": stats.divided.frames,
        "contact": contact,
        "exported": exported,
        "warnings": warned,
        "failure": failure.as_ref().map(chain),
    });
    let answer = facts.answer_at(end, report);
    Ok(match failure {
        Some(error) => {
            let (why, last, out) = (chain(&error), passed + frames - 1, args.file().display());
            let problem = format!("{why}; the frames before, up to {last}, are in {out}");
            answer.failing(problem)
        }
        None => answer,
    })
}

/// Warns of a run of second order with many substeps of first order, and says what helps.
fn warn_of_falls(scene: &selvedge_cloth::Scene, substeps: Option<SubstepCounts>) {
    let Some(SubstepCounts { all, fell_back, .. }) = substeps else {
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
    place::tell_of_former(args.output.as_deref(), args.file());
    if let Some(states) = &args.states {
        place::check_file(states, "--states", &["safetensors"])?;
    }
    Ok(())
}

/// Runs the physics, with the states where they are asked for, and the step that failed after at
/// least one that did not.
fn simulate(args: &RunArgs, run: &mut Run, frames: usize) -> anyhow::Result<Simulated> {
    run.stop_by(interrupt::flag().into());
    let progress = Progress::new("simulating", frames, "frames");
    let keeps_states = args.states.is_some();
    let made = physics::simulate(run, frames, keeps_states, &mut |_| progress.step());
    match made.failure {
        Some(error) if made.run.positions.len() <= run.positions().len() => Err(error),
        _ => Ok(made),
    }
}

/// Checks that nothing is written over something else that is written, or over what is read.
fn check_places(args: &RunArgs, exports: &[Export], loaded: &LoadedScene) -> anyhow::Result<()> {
    let exports = exporting::outputs(exports);
    let mut outputs = vec![("--output", args.file())];
    outputs.extend(args.states.as_deref().map(|path| ("--states", path)));
    outputs.extend(exports.iter().map(|path| ("--export", path.as_path())));
    let mut inputs = scenes::inputs(loaded);
    let start = args.start.as_ref().and_then(StartChoice::file);
    inputs.extend(start.map(|path| ("--start", path)));
    place::check_outputs(&outputs, &inputs)
}

/// Puts what the command line says of the start in the place of what the scene says.
fn choose_start(loaded: &mut LoadedScene, start: Option<&StartChoice>) -> anyhow::Result<()> {
    let (spec, state) = match start {
        None => return Ok(()),
        Some(StartChoice::Named(start)) => (start.clone(), None),
        Some(StartChoice::State(path, frame)) => {
            let choice = StateChoice {
                file: path.to_string_lossy().into_owned(),
                frame: *frame,
                frame_rate: Some(loaded.scene.frame_rate),
                ..StateChoice::default()
            };
            let vertices = loaded.scene.mesh.topology().vertex_count();
            let (state, spec) = choice.read(Path::new(""), vertices)?;
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

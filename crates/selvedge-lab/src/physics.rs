//! Runs of the physics: the sagged rest pose of a scene, a run from there, and the trajectory that
//! a run makes.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use web_time::Instant;

use anyhow::{Context, Result, bail, ensure};
use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, HandlePath, Scene, StepError, Stepper, VertexId};
use selvedge_data::metrics::{self, Comparison};
use selvedge_data::{
    Drive, ObstacleTrack, Provenance, RecordingEnd, SavedState, SceneSpec, StateRun, Trajectory,
    record,
};
use selvedge_sim::{
    ContactCounts, DividedFrames, SaggedRest, SubstepCounts, Threads, YieldedContact,
};
use serde::Serialize;

use crate::event::{End, Goal, OnEvent, Reporter};
use crate::rest_pose;
use crate::start::{saved_state, simulator_of_run};

/// The program, as the files that it writes name it.
pub(crate) const MADE_BY: &str = concat!("selvedge ", env!("CARGO_PKG_VERSION"));

/// Strain of an edge from which a run is warned of: half as much again as fabrics reach in fast motion.
const WARNED_STRAIN: f64 = 0.5;

/// A run and its cost.
pub struct TimedRun {
    /// Positions `[m]`, `[frames * vertices]`, the start first.
    pub positions: Vec<Vec3>,
    /// The end that it came to.
    pub end: End,
    /// Wall time of a frame `[ms]`.
    pub ms_per_frame: f64,
    /// Substeps of physics of second order by what they came to; none with anything else.
    pub substeps: Option<SubstepCounts>,
    /// Frames of physics that took more substeps than the scene asks for.
    pub divided: DividedFrames,
    /// Work that contact took; all 0 without contact.
    pub contact: ContactCounts,
    /// Contact that was released because bodies left the cloth no room.
    pub yielded: Vec<YieldedContact>,
}

/// A body that was let through the cloth because it and something else left that no room.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LetThrough {
    /// Name of the obstacle.
    pub obstacle: String,
    /// Name of the obstacle against which it pressed the cloth, which may be the same; none where
    /// it met a handle, or cloth that could not yield.
    pub against: Option<String>,
    /// Vertices that were let through.
    pub vertices: usize,
    /// First and last frame.
    pub frames: [usize; 2],
    /// Vertices in each frame from the first to the last.
    pub per_frame: Vec<usize>,
}

impl std::fmt::Display for LetThrough {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            obstacle, vertices, ..
        } = self;
        let [from, to] = self.frames;
        match &self.against {
            Some(other) if other == obstacle => {
                write!(f, "obstacle {obstacle:?} passes through itself")?;
            }
            Some(other) => write!(f, "obstacles {obstacle:?} and {other:?} squeeze the cloth")?,
            None => write!(f, "obstacle {obstacle:?} presses cloth that cannot yield")?,
        }
        let plural = if *vertices == 1 { "vertex" } else { "vertices" };
        write!(
            f,
            ": {obstacle:?} was let through at {vertices} {plural}, frames {from} to {to}"
        )
    }
}

/// The bodies that were let through in a run, by the obstacles that pressed the cloth.
#[must_use]
pub fn let_through(scene: &Scene, yielded: &[YieldedContact]) -> Vec<LetThrough> {
    let name = |body: u32| {
        let number = (body as usize).checked_sub(1)?;
        scene.obstacles.get(number).map(|o| o.name().to_owned())
    };
    let mut pairs: BTreeMap<[u32; 2], Vec<&YieldedContact>> = BTreeMap::new();
    for one in yielded {
        let pair = [one.released.body, one.released.against];
        pairs.entry(pair).or_default().push(one);
    }
    let of = |([body, against], all): ([u32; 2], Vec<&YieldedContact>)| {
        let vertices = |frame: Option<usize>| {
            let now = |one: &&&YieldedContact| {
                frame.is_none_or(|f| (one.frames[0]..=one.frames[1]).contains(&f))
            };
            let numbers = all.iter().filter(now).map(|one| one.released.vertex);
            numbers.collect::<BTreeSet<_>>().len()
        };
        let from = all.iter().map(|one| one.frames[0]).min()?;
        let to = all.iter().map(|one| one.frames[1]).max()?;
        Some(LetThrough {
            obstacle: name(body)?,
            against: name(against),
            vertices: vertices(None),
            frames: [from, to],
            per_frame: (from..=to).map(|frame| vertices(Some(frame))).collect(),
        })
    };
    pairs.into_iter().filter_map(of).collect()
}

/// What to say of a run whose edges strained by more than cloth is measured for, though not so much
/// that a step failed; `positions` are those of its frames `[m]`, `[frames * vertices]`. Edges that
/// handles hold at both ends, and edges that are no longer than at the start, are left out.
fn strained(scene: &Scene, positions: &[Vec3]) -> Option<String> {
    let mesh = &scene.mesh;
    let held = scene.handles.mask(mesh.positions().len());
    let lengths = mesh.pattern().edge_lengths();
    let edges = mesh.topology().edges().iter().zip(&lengths);
    let edges: Vec<([usize; 2], f64)> = edges
        .map(|(edge, length)| (edge.vertices.map(VertexId::index), *length))
        .filter(|(ends, _)| ends.iter().any(|v| !held[*v]))
        .collect();
    let length = |frame: &[Vec3], [a, b]: [usize; 2]| f64::from(frame[a].distance(frame[b]));
    let mut frames = positions.chunks(held.len().max(1));
    let start = frames.next()?;
    let (mut most, mut worst, mut count) = (WARNED_STRAIN, None, 0);
    for (frame, now) in (1..).zip(frames) {
        let mut is_beyond = false;
        for (ends, rest) in &edges {
            let now = length(now, *ends);
            let strain = now / rest - 1.0;
            if strain > WARNED_STRAIN && now > length(start, *ends) {
                is_beyond = true;
                if strain > most {
                    (most, worst) = (strain, Some((frame, *ends)));
                }
            }
        }
        count += usize::from(is_beyond);
    }
    let (frame, [a, b]) = worst?;
    let (percent, bound) = (100.0 * most, scene.physics.max_strain);
    Some(format!(
        "in {count} frames edges are strained by more than {:.0} %, the edge from vertex {a} to {b} by {percent:.0} % in frame {frame} after the start: fabrics are not measured so far, and tear; use less wind, slower handles or handles closer together, or a lower physics.max_strain ({bound} now) to stop there",
        100.0 * WARNED_STRAIN
    ))
}

/// Finds the sagged rest pose of a scene.
pub fn rest_pose(scene: &Scene, on_event: &mut OnEvent<'_>) -> Result<SaggedRest> {
    let reporter = Reporter::new(on_event);
    let task = reporter.begin("sagging to rest", Goal::Open, "solves");
    let found = rest_pose::found(scene, &mut |now| {
        let (left, wanted) = (now.residual, now.tolerance);
        task.note(&format!("{left:.1e} m/s² left, to be {wanted:.0e}"));
        task.advance()
    });
    drop(task);
    let found = found.with_context(|| format!("the rest pose of scene {:?}", scene.name))?;
    if let Some(remark) = rest_pose::remark(&found) {
        reporter.remark(&remark);
    }
    let (rest, _) = found;
    tracing::info!(
        solves = rest.solves,
        residual = rest.residual,
        "found the rest pose"
    );
    Ok(rest)
}

/// Simulates `frames` of `scene` from `start` `[m]`, `[vertices]`, at rest, on `threads`.
/// `on_frame` hears of every frame and may stop.
pub fn run(
    scene: &Scene,
    start: Vec<DVec3>,
    frames: usize,
    threads: Threads,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<TimedRun> {
    let plan = SimulationPlan {
        start: SavedState::at_rest(start),
        frames,
        keeps_states: false,
        threads,
        stop: Arc::default(),
    };
    Ok(run_plan(scene, plan, on_frame)?.whole()?.0)
}

/// A simulation to be made.
pub struct SimulationPlan {
    /// The state at the start.
    pub start: SavedState,
    /// Steps from there.
    pub frames: usize,
    /// Keeps the states, in f64, beside the positions.
    pub keeps_states: bool,
    /// The threads; the result is the same on any number.
    pub threads: Threads,
    /// A flag that ends the run within a frame once it is set.
    pub stop: Arc<AtomicBool>,
}

/// A run as far as it came.
pub struct Simulated {
    /// The frames; those before the one that failed, if one did.
    pub run: TimedRun,
    /// Their states, where they are kept.
    pub states: Option<StateRun>,
    /// The step that failed, after which nothing was simulated.
    pub failure: Option<anyhow::Error>,
}

impl Simulated {
    /// The run and its states.
    pub fn whole(self) -> Result<(TimedRun, Option<StateRun>)> {
        match self.failure {
            Some(error) => Err(error),
            None => Ok((self.run, self.states)),
        }
    }
}

/// Simulates `scene` as `plan` says. `on_frame` hears of every frame and may stop. A step that
/// fails is in what is returned, with the frames before it.
pub fn run_plan(
    scene: &Scene,
    plan: SimulationPlan,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Simulated> {
    let what = || format!("simulating scene {:?}", scene.name);
    let mut simulator = simulator_of_run(scene, plan.start).with_context(what)?;
    simulator.set_threads(plan.threads);
    simulator.stop_by(plan.stop.into());
    let path = scene.handle_path().with_context(what)?;
    let mut states = plan.keeps_states.then(StateRun::default);
    if let Some(run) = &mut states {
        run.states.push(saved_state(&simulator));
    }
    let samples = scene.physics.substeps as usize;
    let (mut run, failure) = timed(&mut simulator, &path, samples, plan.frames, &mut |now| {
        if let Some(run) = &mut states {
            run.states.push(saved_state(now));
        }
        on_frame()
    });
    let stats = simulator.stats();
    run.substeps = (scene.physics.integrator.order() > 1).then_some(stats.substeps);
    run.divided = stats.divided;
    run.contact = stats.contact;
    run.yielded = simulator.yielded().to_vec();
    let through = let_through(scene, &run.yielded);
    let words = through.iter().map(ToString::to_string);
    for words in words.chain(strained(scene, &run.positions)) {
        tracing::warn!("{}: {words}", scene.name);
    }
    Ok(Simulated {
        run,
        states,
        failure: failure.map(|error| anyhow::Error::new(error).context(what())),
    })
}

/// Steps `stepper` for `frames` along `path`, with one target per frame, and times it. `on_frame`
/// sees it after every frame and may stop.
pub fn drive<S: Stepper>(
    stepper: &mut S,
    path: &HandlePath,
    frames: usize,
    on_frame: &mut dyn FnMut(&S) -> ControlFlow<()>,
) -> Result<TimedRun, StepError> {
    let (run, failure) = timed(stepper, path, 1, frames, on_frame);
    failure.map_or(Ok(run), Err)
}

/// A recording with its cost, and the step that failed.
fn timed<S: Stepper>(
    stepper: &mut S,
    path: &HandlePath,
    samples_per_frame: usize,
    frames: usize,
    on_frame: &mut dyn FnMut(&S) -> ControlFlow<()>,
) -> (TimedRun, Option<StepError>) {
    let vertices = stepper.positions().len();
    let drive = Drive {
        path,
        samples_per_frame,
    };
    let started = Instant::now();
    let recording = record(stepper, drive, frames, on_frame);
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
    let steps = (recording.positions.len() / vertices).saturating_sub(1);
    let (end, failure) = match recording.end {
        RecordingEnd::Complete => (End::Complete, None),
        RecordingEnd::Stopped => (End::Interrupted, None),
        RecordingEnd::Failed(error) => (End::Interrupted, Some(error)),
    };
    let run = TimedRun {
        positions: recording.positions,
        end,
        ms_per_frame: elapsed_ms / steps.max(1) as f64,
        substeps: None,
        divided: DividedFrames::default(),
        contact: ContactCounts::default(),
        yielded: Vec::new(),
    };
    (run, failure)
}

/// Returns the origin of a run of `spec`.
pub fn provenance(spec: &SceneSpec, scene: &Scene) -> Result<Provenance> {
    Ok(Provenance {
        frame_rate: scene.frame_rate,
        scene: spec.to_json().context("the resolved scene as JSON")?,
        made_by: MADE_BY.to_owned(),
    })
}

/// Makes the trajectory of a run of `spec` that begins with frame `first` of its motion, and whose
/// cloth rests at `rest` `[m]`, `[vertices]`. Obstacles stand where they are then.
pub fn trajectory(
    first: usize,
    spec: &SceneSpec,
    scene: &Scene,
    rest: &[DVec3],
    positions: Vec<Vec3>,
) -> Result<Trajectory> {
    let what = || format!("the trajectory of scene {:?}", scene.name);
    let cloth = Cloth::of_scene(scene, rounded(rest)).with_context(what)?;
    let frames = positions.len() / cloth.vertex_count().max(1);
    let track = |obstacle| ObstacleTrack::of(obstacle, scene.frame_rate, first, frames);
    let obstacles = scene.obstacles.iter().map(track).collect();
    Trajectory::new(cloth, positions, provenance(spec, scene)?)
        .and_then(|trajectory| trajectory.with_obstacles(obstacles))
        .with_context(what)
}

/// The scene that a trajectory says it was made from, of its mesh and handles. Mesh files are looked
/// for from the current folder.
pub(crate) fn scene_of(trajectory: &Trajectory) -> Result<Scene> {
    let json = &trajectory.provenance().scene;
    if json.is_null() {
        bail!("the trajectory does not say from which scene it is");
    }
    let scene = SceneSpec::from_json(json)?.build("".as_ref())?;
    let fits = scene.mesh.topology() == trajectory.topology();
    ensure!(
        fits && scene.handles == *trajectory.handles(),
        "the scene's mesh is not that of the trajectory"
    );
    Ok(scene)
}

/// Positions in f32, as files have them.
pub fn rounded(positions: &[DVec3]) -> Vec<Vec3> {
    positions.iter().map(|p| p.as_vec3()).collect()
}

/// The largest strain of an edge over all frames: (l - l₀)/l₀ against the material.
pub fn largest_strain(trajectory: &Trajectory) -> Result<f64> {
    let topology = trajectory.topology();
    let lengths = trajectory.cloth().pattern().edge_lengths();
    let strains = metrics::largest_strain(trajectory.frames(), topology, &lengths)?;
    Ok(strains.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// The measures of a trajectory `b` against `a`, which is of the same mesh and frame rate.
pub fn compare(a: &Trajectory, b: &Trajectory) -> Result<Comparison> {
    let (first, second) = (a.vertex_count(), b.vertex_count());
    ensure!(
        first == second,
        "they are of different meshes: {first} and {second} vertices"
    );
    ensure!(
        a.topology() == b.topology(),
        "they are of different meshes: as many vertices, but other faces"
    );
    let (first, second) = (a.frame_rate(), b.frame_rate());
    ensure!(
        first == second,
        "they have {first} and {second} frames per second: a frame of one is no frame of the other"
    );
    Ok(metrics::compare(a.frames(), b.frames(), a.topology())?)
}

#[cfg(test)]
mod tests {
    use selvedge_sim::ContactGauge;

    use super::*;

    /// A light knit in a storm holds to the bound of a step, but no cloth is so long.
    #[test]
    fn a_run_that_strains_the_cloth_too_far_is_warned_of() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/elsewhere");
        let run_in = |wind: f64| {
            let loaded = selvedge_data::open_scene(&format!("{folder}/wind-8.toml")).unwrap();
            let mut scene = loaded.scene;
            scene.environment.wind = DVec3::X * wind;
            let start = scene.mesh.positions().to_vec();
            let go_on = &mut || ControlFlow::Continue(());
            let run = run(&scene, start, 30, Threads::One, go_on).unwrap();
            (strained(&scene, &run.positions), run.positions)
        };
        let (words, positions) = run_in(25.0);
        assert!(!positions.is_empty());
        let words = words.expect("a warning");
        assert!(words.contains("strained by more than 50 %"), "{words}");
        assert!(words.contains("physics.max_strain (1.5 now)"), "{words}");
        assert_eq!(run_in(2.0).0, None);
    }

    /// The edge by which the cloth is led drives it against the rims of the plates, which stand
    /// still: what is pushed away from the one must not be pushed into the other.
    #[test]
    fn a_cloth_that_is_pinched_between_its_edge_and_plates_goes_on() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/contact");
        for (name, frames) in [("tablecloth-4", 17), ("tablecloth-8", 12)] {
            let loaded = selvedge_data::open_scene(&format!("{folder}/{name}.toml")).unwrap();
            let scene = loaded.scene;
            let start = scene.mesh.positions().to_vec();
            let go_on = &mut || ControlFlow::Continue(());
            let run = run(&scene, start, frames, Threads::One, go_on);
            let run = run.unwrap_or_else(|error| panic!("{name}: {error}"));
            let divided = run.divided.frames;
            assert!(divided > 0 && run.contact.projected > 0, "{name}: no pinch");
            let mut gauge = ContactGauge::of(&scene).unwrap();
            let vertices = scene.mesh.positions().len();
            for (frame, positions) in run.positions.chunks(vertices).enumerate() {
                let found = gauge.measure(frame, positions);
                assert_eq!(found.intersections, 0, "{name}, frame {frame}");
            }
        }
    }
}

//! Times the simulator on a square of gray interlock: a table row per run, for `docs/src/benchmarks.md`.
//!
//! `cargo bench -p selvedge-lab --bench simulate -- [KEY=VALUE ...]` with `case` (forward), `vertices`
//! (1024), `size` of the square's side in m (1), `frames` that count (60), those `before` them that do
//! not (30), `substeps` (4), `threads` (1), `solver` (automatic, cholesky, or the tolerance of
//! conjugate gradients in m/s), `integrator` (generalised-alpha or linearised). Cases:
//!
//! - `forward`: its two upper corners move forward, from the first move on.
//! - `swing`: the corners swing by 20 cm. `apart`: the same with contact, where nothing touches.
//! - `draped`: without handles it falls onto a ball. `crumpled`: onto the ground, from upright.
//! - `thrown`: a ball of 0.3 kg is thrown at it with `speed` in m/s (5), as the viewer does.
//!
//! `scene=FILE` instead runs so many `frames` of a scene as it is, from its own start, on `threads`.
//!
//! Wall time says what one waits, processor time what is left of it where the machine is shared. The
//! largest memory is that of the whole process, mesh generation included. The second line has the share
//! of each phase, of wall time: the spans that the simulator opens for `tracing`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

mod settings;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

use glam::DVec3;
use selvedge_cloth::bodies::{Body, plane, sphere};
use selvedge_cloth::generate::square;
use selvedge_cloth::motion::named::by_name;
use selvedge_cloth::{
    ConjugateGradients, ContactSettings, HandleTargets, Handles, Integrator, LinearSolver, Mesh,
    Obstacle, Scene, StepError, Stepper,
};
use selvedge_data::open_scene;
use selvedge_lab::physics::simulate;
use selvedge_sim::Simulator;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

/// Frames that the shipped motion stands still before its first move.
const STILL: usize = 60;
/// Depth in which a ball waits that is not thrown yet `[m]`.
const AWAY: f64 = 1e3;
/// Mass of the ball that is thrown `[kg]`.
const BALL: f64 = 0.3;

fn main() {
    let settings = settings::read([
        ("case", "forward"),
        ("vertices", "1024"),
        ("size", "1"),
        ("frames", "60"),
        ("before", "30"),
        ("speed", "5"),
        ("substeps", "4"),
        ("threads", "1"),
        ("solver", "automatic"),
        ("integrator", "generalised-alpha"),
        ("scene", ""),
    ]);
    tracing::subscriber::set_global_default(Phases).unwrap();
    match settings["scene"].as_str() {
        "" => measure(&settings),
        scene => measure_scene(scene, settings["frames"].parse().unwrap()),
    }
}

fn measure(settings: &BTreeMap<&str, String>) {
    let scene = scene(settings);
    let begin = Instant::now();
    let mut simulator = Simulator::new(&scene).unwrap();
    let set_up = begin.elapsed().as_secs_f64();
    let [frames, before] = ["frames", "before"].map(|key| settings[key].parse::<usize>().unwrap());
    let mut ball = (settings["case"] == "thrown").then(|| Ball::new(settings));
    let (mut begin, mut processor) = (Instant::now(), processor_seconds());
    let (mut iterations, mut times) = (0, Vec::new());
    for frame in 0..before + frames {
        if frame == before {
            if let Some(ball) = &ball {
                let offset = ball.place + DVec3::Y * AWAY;
                simulator.put_obstacle(0, offset).unwrap();
            }
            PHASES.lock().unwrap().seconds.clear();
            (begin, processor) = (Instant::now(), processor_seconds());
        }
        let targets = targets(settings, &scene, frame);
        let clock = Instant::now();
        match &mut ball {
            Some(ball) if frame >= before => ball.step(&mut simulator, &targets),
            _ => simulator.step(&targets).unwrap(),
        }
        iterations += simulator.solver_iterations().unwrap_or(0);
        if frame >= before {
            times.push(1e3 * clock.elapsed().as_secs_f64());
        }
    }
    let per_frame = 1e3 / frames as f64;
    let wall = begin.elapsed().as_secs_f64();
    println!(
        "| {} | {} vertices | {} m | {} substeps | {} threads | {} | {:.2} ms wall, longest {:.1}, {} above 16.7 | {:.2} ms processor | {:.1} iterations | set-up {set_up:.2} s | {:.0} MB |",
        settings["case"],
        settings["vertices"],
        settings["size"],
        settings["substeps"],
        settings["threads"],
        settings["solver"],
        wall * per_frame,
        times.iter().copied().fold(0.0, f64::max),
        times.iter().filter(|ms| **ms > 1e3 / 60.0).count(),
        (processor_seconds() - processor) * per_frame,
        f64::from(iterations) / (before + frames) as f64,
        largest_memory_mb(),
    );
    print_shares(wall);
    if scene.contact.is_some() {
        println!("{:?}", simulator.stats());
    }
}

/// What [`Phases`] has measured. One thread drives the simulator and opens all spans.
static PHASES: Mutex<Measured> = Mutex::new(Measured {
    names: Vec::new(),
    open: Vec::new(),
    since: None,
    seconds: BTreeMap::new(),
});

struct Measured {
    /// Names of the spans so far; the number of a span is its place, from 1.
    names: Vec<&'static str>,
    /// Spans within each other, the innermost last.
    open: Vec<&'static str>,
    /// When the innermost one began or went on.
    since: Option<Instant>,
    /// Time within each span, but for the spans within it `[s]`.
    seconds: BTreeMap<&'static str, f64>,
}

impl Measured {
    /// Adds the time since the last change to the innermost span.
    fn count(&mut self) {
        let now = Instant::now();
        if let (Some(name), Some(since)) = (self.open.last(), self.since) {
            *self.seconds.entry(name).or_default() += (now - since).as_secs_f64();
        }
        self.since = Some(now);
    }
}

/// Sums the time of the simulator's spans.
struct Phases;

impl Subscriber for Phases {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_span() && metadata.target().starts_with("selvedge_sim")
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        let (name, mut measured) = (span.metadata().name(), PHASES.lock().unwrap());
        let place = measured.names.iter().position(|known| *known == name);
        let place = place.unwrap_or_else(|| {
            measured.names.push(name);
            measured.names.len() - 1
        });
        Id::from_u64(place as u64 + 1)
    }

    fn enter(&self, span: &Id) {
        let mut measured = PHASES.lock().unwrap();
        measured.count();
        let name = measured.names[span.into_u64() as usize - 1];
        measured.open.push(name);
    }

    fn exit(&self, _: &Id) {
        let mut measured = PHASES.lock().unwrap();
        measured.count();
        measured.open.pop();
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &Event<'_>) {}
}

/// Runs so many frames of a scene's file, or of a shipped scene.
fn measure_scene(name: &str, frames: usize) {
    let loaded = open_scene(name).unwrap();
    let mut run = selvedge::Run::new(&loaded.into()).unwrap();
    PHASES.lock().unwrap().seconds.clear();
    let vertices = run.positions().len();
    let made = simulate(&mut run, frames, false, &mut |_| ControlFlow::Continue(()));
    let (made, _) = made.whole().unwrap();
    let ms = made.ms_per_frame;
    println!("| {name} | {vertices} vertices | {frames} frames | {ms:.2} ms |");
    print_shares(1e-3 * ms * frames as f64);
    println!("{:?}", run.solver().map(Simulator::stats));
}

/// Prints the share of each phase in the time of all frames `[s]`.
fn print_shares(wall: f64) {
    let phases = &PHASES.lock().unwrap().seconds;
    let of_phase = |(phase, seconds): (&&'static str, &f64)| (*phase, 100.0 * seconds / wall);
    let mut shares: Vec<_> = phases.iter().map(of_phase).collect();
    let known: f64 = shares.iter().map(|(_, share)| share).sum();
    shares.push(("rest", 100.0 - known));
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let shares = shares
        .iter()
        .map(|(phase, share)| format!("{phase} {share:.0} %"));
    println!("{}", shares.collect::<Vec<_>>().join(", "));
}

/// Where the handles go in the step from `frame`.
fn targets(settings: &BTreeMap<&str, String>, scene: &Scene, frame: usize) -> HandleTargets {
    let aside = match settings["case"].as_str() {
        "forward" => {
            let path = scene.handle_path().unwrap();
            let targets = path.targets(STILL + frame, scene.physics.substeps as usize);
            return targets.unwrap();
        }
        "swing" | "apart" => 0.1 * (1.0 - (0.1 * (frame + 1) as f64).cos()),
        _ => 0.0,
    };
    let start = scene.handles.select(scene.mesh.positions());
    let moved = start.iter().map(|p| *p + DVec3::X * aside);
    HandleTargets::at_frame_end(moved.collect()).unwrap()
}

/// A ball under way, slowed by the cloth.
struct Ball {
    place: DVec3,
    velocity: DVec3,
}

impl Ball {
    fn new(settings: &BTreeMap<&str, String>) -> Self {
        let speed: f64 = settings["speed"].parse().unwrap();
        Self {
            place: DVec3::new(1.0, -0.5, 0.05),
            velocity: DVec3::new(-speed, 1.2, 0.0),
        }
    }

    /// A frame in which the ball flies on, or stays where nothing lets it through.
    fn step(&mut self, simulator: &mut Simulator, targets: &HandleTargets) {
        self.velocity -= DVec3::Y * (9.8 / 60.0);
        let next = self.place + self.velocity / 60.0;
        simulator.lead_obstacle(0, next + DVec3::Y * AWAY).unwrap();
        match simulator.step(targets) {
            Ok(()) => self.place = next,
            Err(StepError::Contact { .. } | StepError::Overstretched { .. }) => {
                self.velocity = DVec3::ZERO;
                simulator
                    .lead_obstacle(0, self.place + DVec3::Y * AWAY)
                    .unwrap();
                simulator.step(targets).unwrap();
            }
            Err(error) => panic!("{error}"),
        }
        self.velocity += simulator.obstacle_impulses()[0] / BALL;
    }
}

fn scene(settings: &BTreeMap<&str, String>) -> Scene {
    let vertices = settings["vertices"].parse().unwrap();
    let sheet = square(vertices, settings["size"].parse().unwrap(), 1).unwrap();
    let mut mesh = sheet.mesh;
    let mut held = sheet.labels["upper-corners"].clone();
    let placed = |body: Body, at: DVec3| {
        let points = body.points.iter().map(|p| *p + at).collect();
        vec![Obstacle::new("body", points, body.faces).unwrap()]
    };
    let mut obstacles = Vec::new();
    match settings["case"].as_str() {
        "forward" | "swing" | "apart" => {}
        "draped" => {
            held.clear();
            mesh = lying(mesh);
            obstacles = placed(sphere(0.3, 0.05), DVec3::Y * -0.35);
        }
        "crumpled" => {
            held.clear();
            obstacles = placed(plane([18.0; 2]), DVec3::Y * -1.05);
        }
        "thrown" => {
            obstacles = placed(sphere(0.12, 0.03), DVec3::Y * -AWAY);
        }
        other => {
            panic!("case {other:?} is none of forward, swing, apart, draped, crumpled, thrown")
        }
    }
    let material = toml::from_str(selvedge_assets::MATERIALS[0].1).unwrap();
    let handles = Handles::new(&held, vertices).unwrap();
    let mut scene = Scene::of("bench", mesh, handles, material);
    scene.motion = by_name("forward").unwrap();
    scene.obstacles = obstacles;
    let touches = !matches!(settings["case"].as_str(), "forward" | "swing");
    scene.contact = touches.then(ContactSettings::default);
    set_physics(&mut scene, settings);
    scene
}

/// The mesh, which hangs, lying flat about the origin.
fn lying(mesh: Mesh) -> Mesh {
    let flat = mesh.positions().iter();
    let flat = flat.map(|p| DVec3::new(p.y + 0.5, 0.0, p.z)).collect();
    mesh.with_positions(flat).unwrap()
}

fn set_physics(scene: &mut Scene, settings: &BTreeMap<&str, String>) {
    scene.physics.substeps = settings["substeps"].parse().unwrap();
    scene.physics.solver = match settings["solver"].as_str() {
        "automatic" => LinearSolver::Automatic,
        "cholesky" => LinearSolver::Cholesky,
        tolerance => LinearSolver::ConjugateGradients(ConjugateGradients {
            tolerance: tolerance.parse().unwrap(),
            max_iterations: 10_000,
        }),
    };
    scene.physics.integrator = match settings["integrator"].as_str() {
        "linearised" => Integrator::Linearised,
        "generalised-alpha" => Integrator::GeneralisedAlpha(Default::default()),
        other => panic!("{other:?} is none of generalised-alpha, linearised"),
    };
}

/// Processor time of all threads of this process so far `[s]`, where Linux tells it.
fn processor_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return f64::NAN;
    };
    let nanoseconds = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse().ok()
    };
    tasks.flatten().filter_map(nanoseconds).sum::<f64>() * 1e-9
}

/// Largest memory of this process so far `[MB]`, where Linux tells it.
fn largest_memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |kilobytes| kilobytes / 1e3)
}

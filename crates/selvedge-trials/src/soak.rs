//! Long runs: steppers over very many steps, and the viewer under many pages with random hands. The
//! memory of a process must not grow once it has begun.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use std::{fs, thread};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use selvedge_cloth::{HandleTargets, Scene, Stepper};
use selvedge_data::open_scene;
use selvedge_guard::{Correction, GuardSettings};
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::{physics, start};
use selvedge_sim::{Simulator, Threads};

use crate::fuzz::{SCENE, TRAINING};
use crate::is_wanted;
use crate::program::Program;
use crate::viewer::{self, SILENCE, Shared, Viewer};

/// Looks at the memory of a run.
const LOOKS: usize = 12;
/// Growth of memory that is no leak: allocators keep what they had `[kB]`.
const MOST_GROWTH: u64 = 4 << 10;

/// Memory over time `[kB]`.
struct Curve(Vec<u64>);

impl Curve {
    fn push(&mut self, process: &str) -> Result<()> {
        let status = fs::read_to_string(format!("/proc/{process}/status"))
            .context("the memory of a process, which only Linux tells")?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let number = line.and_then(|rest| rest.split_whitespace().next()?.parse().ok());
        self.0.push(number.context("no VmRSS")?);
        Ok(())
    }

    /// Returns true unless it grew over its last two thirds.
    fn is_level(&self) -> bool {
        let early = self.0.get(self.0.len() / 3);
        let (Some(early), Some(last)) = (early, self.0.last()) else {
            return false;
        };
        *last <= early + MOST_GROWTH
    }

    fn text(&self) -> String {
        let megabytes = |kilobytes: &u64| format!("{:.1}", *kilobytes as f64 / 1024.0);
        self.0.iter().map(megabytes).collect::<Vec<_>>().join(" ")
    }
}

/// Runs what is called so, or all; returns false where memory grew.
pub(crate) fn run(
    steps: u64,
    span: Duration,
    pages: u32,
    only: &[String],
    seed: u64,
) -> Result<bool> {
    let folder = tempfile::tempdir().context("a folder to work in")?;
    let folder = folder.path();
    fs::write(folder.join("push.toml"), SCENE)?;
    fs::write(folder.join("moment.toml"), TRAINING)?;
    let program = Program::find()?;
    let mut holds = true;
    println!("| run | how long | seconds | memory, MB | held |");
    println!("|---|---|---|---|---|");
    let mut say = |name: &str, long: String, started: Instant, curve: &Curve| {
        let (seconds, level) = (started.elapsed().as_secs_f64(), curve.is_level());
        let held = if level { "level" } else { "it grew" };
        println!(
            "| {name} | {long} | {seconds:.0} | {} | {held} |",
            curve.text()
        );
        holds &= level;
    };
    for name in ["physics", "model", "guard"] {
        if is_wanted(name, only) {
            let started = Instant::now();
            let curve = stepper(name, &program, folder, steps)?;
            say(name, format!("{steps} steps"), started, &curve);
        }
    }
    if is_wanted("viewer", only) {
        let started = Instant::now();
        let curve = viewer(&program, folder, span, pages, seed)?;
        let long = format!("{} s of simulated time, {pages} pages", span.as_secs());
        say("viewer", long, started, &curve);
    }
    Ok(holds)
}

/// Steps one stepper with its handles on a circle.
fn stepper(name: &str, program: &Program, folder: &Path, steps: u64) -> Result<Curve> {
    let path = folder.join("push.toml");
    let loaded = open_scene(&path.to_string_lossy())?;
    let scene = &loaded.scene;
    let rest = physics::rest_pose(scene, &mut |_| std::ops::ControlFlow::Continue(()))?;
    let start = rest.positions;
    let mut stepper: Box<dyn Stepper> = match name {
        "physics" => {
            let still = vec![DVec3::ZERO; start.len()];
            let mut simulator = Simulator::with_state(scene, start.clone(), still)?;
            simulator.set_threads(Threads::One);
            Box::new(simulator)
        }
        _ => learned(name, program, folder, scene, &start)?,
    };
    walk(scene, &mut *stepper, &start, steps)
}

/// A model that has barely learned, which is only watched; or the shipped one under its guard.
fn learned(
    name: &str,
    program: &Program,
    folder: &Path,
    scene: &Scene,
    rest: &[DVec3],
) -> Result<Box<dyn Stepper>> {
    let (file, correction) = match name {
        "guard" => ("paper".into(), Correction::Limit),
        _ => {
            program.run(folder, "data generate tiny -o tiny")?;
            program.run(folder, "train moment.toml --data tiny -o run")?;
            (folder.join("run/model.safetensors"), Correction::None)
        }
    };
    let model = NamedModel::open(Some(&file))?;
    let settings = GuardSettings::with(correction);
    let scene = Arc::new(scene.clone());
    let guarded = start::guarded(&scene, rest, &model, &Machine::Cpu, settings)?;
    Ok(Box::new(guarded))
}

fn walk(scene: &Scene, stepper: &mut dyn Stepper, start: &[DVec3], steps: u64) -> Result<Curve> {
    let held = scene.handles.select(start);
    let mut curve = Curve(Vec::new());
    let mut failures = 0_u64;
    for step in 0..steps {
        let angle = 0.05 * step as f64;
        let shift = DVec3::new(angle.cos() - 1.0, 0.0, angle.sin()) * 0.1;
        let targets = HandleTargets::at_frame_end(held.iter().map(|p| *p + shift).collect())?;
        // A model that has barely learned may run away: what is looked at is memory.
        failures += u64::from(stepper.step(&targets).is_err());
        if step % (steps / LOOKS as u64).max(1) == 0 {
            curve.push("self")?;
        }
    }
    if failures > 0 {
        println!("  {failures} steps were refused, as not finite");
    }
    let finite = stepper.positions().iter().all(|p| p.is_finite());
    ensure!(finite, "a position is not finite");
    Ok(curve)
}

/// The memory of the viewer with so many pages until its cloth has moved for `span`.
fn viewer(
    program: &Program,
    folder: &Path,
    span: Duration,
    pages: u32,
    seed: u64,
) -> Result<Curve> {
    let mut viewer = Viewer::start(program, folder)?;
    let (address, process) = (viewer.address, viewer.process());
    let shared = Shared::default();
    let mut curve = Curve(Vec::new());
    thread::scope(|scope| -> Result<()> {
        let shared = &shared;
        let hands: Vec<_> = (0..pages)
            .map(|number| scope.spawn(move || viewer::page(address, number, seed, shared)))
            .collect();
        let watched = watch(&process, span, shared, &mut curve);
        shared.stop.store(true, Ordering::SeqCst);
        for hand in hands {
            match hand.join() {
                Ok(outcome) => outcome?,
                Err(_) => bail!("a page panicked"),
            }
        }
        watched
    })?;
    ensure!(viewer.is_alive()?, "the viewer ended early");
    Ok(curve)
}

/// Looks at the memory of the viewer until its time has come to `span`.
fn watch(process: &str, span: Duration, shared: &Shared, curve: &mut Curve) -> Result<()> {
    let mut heard = (0, Instant::now());
    for look in 0..LOOKS {
        let due = span.mul_f64((look + 1) as f64 / LOOKS as f64);
        loop {
            let time = shared.now.load(Ordering::SeqCst);
            if time != heard.0 {
                heard = (time, Instant::now());
            }
            if f64::from(time) >= 100.0 * due.as_secs_f64() {
                break;
            }
            ensure!(heard.1.elapsed() < SILENCE, "the viewer stands still");
            ensure!(!shared.stop.load(Ordering::SeqCst), "a page gave up");
            thread::sleep(Duration::from_millis(20));
        }
        curve.push(process)?;
    }
    Ok(())
}

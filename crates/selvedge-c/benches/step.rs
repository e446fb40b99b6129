//! The price of a step through the functions for C, at the 400 vertices of the scene `default`: a
//! line per stepper, for `docs/src/guides/c.md`.
//!
//! `cargo bench -p selvedge-c --bench step -- [REPEATS]`. Two steppers go through the same motion
//! from the same start, ten frames in turn: one by the functions of `selvedge.h`, called as C calls
//! them, pointers and all, with its positions read after every frame; the other by the library that
//! stands behind them. Their positions are the same, to the bit. Of each ten frames the shortest
//! time of all repeats counts, so that other work of the machine does not. Processor time, on one
//! thread.
#![allow(
    unsafe_code,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "calls what is exported to C; a measuring program that prints its result"
)]

use std::ffi::{CString, c_long};
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::ptr;
use std::sync::Arc;

use glam::DVec3;
use selvedge_c::models::selvedge_model_open;
use selvedge_c::process::selvedge_set_threads;
use selvedge_c::scenes::selvedge_scene_open;
use selvedge_c::status::SelvedgeStatus;
use selvedge_c::steppers::{
    selvedge_positions, selvedge_step, selvedge_stepper_free, selvedge_stepper_model,
    selvedge_stepper_physics,
};
use selvedge_cloth::{HandleTargets, Stepper};
use selvedge_data::{SavedState, open_scene};
use selvedge_guard::GuardSettings;
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::start;
use selvedge_lab::state_log::simulator_of_run;
use selvedge_sim::Threads;

const SCENE: &str = "default";
const MODEL: &str = "paper";
const WINDOWS: usize = 8;
const FRAMES: usize = 10;

fn main() {
    let mut words = std::env::args().skip(1).filter(|a| a != "--bench");
    let repeats: usize = words.next().map_or(8, |word| word.parse().unwrap());
    assert_eq!(selvedge_set_threads(1), SelvedgeStatus::Ok);
    let mut loaded = open_scene(SCENE).unwrap();
    let model = NamedModel::open(Some(Path::new(MODEL))).unwrap();
    start::for_model(&mut loaded);
    let rest = start::find(&loaded, &mut |_| ControlFlow::Continue(())).unwrap();
    let rest = rest.state.positions;
    let scene = Arc::new(loaded.scene);
    println!(
        "{} vertices, {WINDOWS} times {FRAMES} frames, {repeats} repeats, processor time on one thread",
        rest.len()
    );
    let physics = || {
        let state = SavedState::at_rest(rest.clone());
        let mut simulator = simulator_of_run(&scene, state).unwrap();
        simulator.set_threads(Threads::Pool);
        simulator
    };
    let path = scene.handle_path().unwrap();
    let course = |samples: usize| Course {
        samples,
        handles: scene.handles.len(),
        frames: (0..WINDOWS * FRAMES)
            .map(|frame| path.targets(frame, samples).unwrap())
            .collect(),
    };
    let substeps = scene.physics.substeps as usize;
    report(
        "physics",
        repeats,
        || (physics(), open(None)),
        &course(substeps),
    );
    let guarded = || {
        let settings = GuardSettings::default();
        start::guarded(&scene, &rest, &model, &Machine::Cpu, settings).unwrap()
    };
    report(
        "model, guarded",
        repeats,
        || (guarded(), open(Some(MODEL))),
        &course(1),
    );
}

/// Targets of frames.
struct Course {
    samples: usize,
    handles: usize,
    frames: Vec<HandleTargets>,
}

impl Course {
    /// Targets of a frame as C has them.
    fn numbers(&self, targets: &HandleTargets) -> Vec<f64> {
        let samples = (1..=self.samples).map(|k| k as f64 / self.samples as f64);
        let of = |fraction| (0..self.handles).map(move |h| targets.at(h, fraction, DVec3::ZERO));
        samples.flat_map(of).flat_map(|p| p.to_array()).collect()
    }
}

/// A stepper by the functions for C: of the physics, or of a model, by its name.
fn open(model: Option<&str>) -> u64 {
    let name = CString::new(SCENE).unwrap();
    let (mut scene, mut opened, mut stepper) = (0, 0, 0);
    // SAFETY: texts end in zeros, places can be written, and no listener is given.
    let status = unsafe {
        assert_eq!(
            selvedge_scene_open(name.as_ptr(), &raw mut scene),
            SelvedgeStatus::Ok
        );
        match model {
            None => selvedge_stepper_physics(scene, ptr::null(), &raw mut stepper),
            Some(name) => {
                let name = CString::new(name).unwrap();
                assert_eq!(
                    selvedge_model_open(name.as_ptr(), &raw mut opened),
                    SelvedgeStatus::Ok
                );
                selvedge_stepper_model(scene, opened, 0, ptr::null(), &raw mut stepper)
            }
        }
    };
    assert_eq!(status, SelvedgeStatus::Ok);
    stepper
}

/// Measures steppers that `open` makes, one by the library and one by the functions for C.
fn report<S: Stepper>(name: &str, repeats: usize, open: impl Fn() -> (S, u64), course: &Course) {
    let mut least = [[f64::INFINITY; 2]; WINDOWS];
    for _ in 0..repeats {
        let (mut ours, theirs) = open();
        for (least, frames) in least.iter_mut().zip(course.frames.chunks(FRAMES)) {
            let numbers: Vec<Vec<f64>> = frames.iter().map(|t| course.numbers(t)).collect();
            let rust = timed(|| {
                for targets in frames {
                    ours.step(targets).unwrap();
                    black_box(ours.positions());
                }
            });
            let mut found = (ptr::null(), 0);
            let c = timed(|| {
                for numbers in &numbers {
                    found = black_box(step(theirs, numbers, course));
                }
            });
            // SAFETY: no call has changed the stepper since it lent them.
            let found = unsafe { std::slice::from_raw_parts(found.0, 3 * found.1) };
            let expected: Vec<f32> = ours.positions().iter().flat_map(|p| p.to_array()).collect();
            assert!(
                found == expected,
                "{name}: other positions by the functions for C"
            );
            *least = [least[0].min(rust), least[1].min(c)];
        }
        assert_eq!(selvedge_stepper_free(theirs), SelvedgeStatus::Ok);
    }
    let of =
        |who: usize| least.iter().map(|w| w[who]).sum::<f64>() * 1e3 / (WINDOWS * FRAMES) as f64;
    let [rust, c] = [of(0), of(1)];
    println!(
        "{name:16} Rust {rust:.3} ms, C {c:.3} ms per frame: {:+.1} %",
        100.0 * (c / rust - 1.0)
    );
}

/// Moves a cloth by one frame and has its positions lent: where they are, and how many.
fn step(stepper: u64, targets: &[f64], course: &Course) -> (*const f32, usize) {
    let (mut positions, mut count) = (ptr::null(), 0);
    let (samples, handles) = (course.samples, course.handles);
    // SAFETY: the targets have so many numbers, and places can be written.
    let status = unsafe {
        let moved = selvedge_step(stepper, targets.as_ptr(), samples, handles, ptr::null());
        assert_eq!(moved, SelvedgeStatus::Ok);
        selvedge_positions(stepper, &raw mut positions, &raw mut count)
    };
    assert_eq!(status, SelvedgeStatus::Ok);
    (positions, count)
}

unsafe extern "C" {
    /// C's: the processor time of the process so far [1e-6 s].
    safe fn clock() -> c_long;
}

/// The processor time of `work`, of all threads `[s]`.
fn timed(work: impl FnOnce()) -> f64 {
    let before = clock();
    work();
    (clock() - before) as f64 * 1e-6
}

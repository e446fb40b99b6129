//! Frames of the shipped models allocate nothing once they have begun, on any thread, alone and
//! under a guard. The physics has such a test of its own.
//!
//! The counter is of the whole process, so this program has one test. Frames are taken on a thread
//! of the pool: from outside, the queue of the pool grows by a block every few dozen calls.
#![allow(unsafe_code, reason = "a counting allocator is an unsafe trait")]
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot be set up fails there"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use selvedge::machine::Machine;
use selvedge::start;
use selvedge_cloth::{Cloth, HandleTargets, Scene, Stepper};
use selvedge_data::open_scene;
use selvedge_guard::Correction;
use selvedge_lab::physics;
use selvedge_model::{ClothGraph, LearnedStepper};

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Frames of a round, of which one without an allocation is looked for.
const ROUND: usize = 8;

/// Steps with the handles on a circle, until a round allocates nothing or many have: on a busy
/// machine the second thread takes its first partition frames later, and has its own queue then.
fn quiet_round(scene: &Scene, stepper: &mut dyn Stepper, start: &[DVec3]) -> Vec<usize> {
    let held = scene.handles.select(start);
    let targets: Vec<HandleTargets> = (0..10 * ROUND)
        .map(|frame| {
            let angle = 0.05 * frame as f64;
            let shift = DVec3::new(angle.cos() - 1.0, 0.0, angle.sin()) * 0.1;
            HandleTargets::at_frame_end(held.iter().map(|p| *p + shift).collect()).unwrap()
        })
        .collect();
    let mut counts = Vec::with_capacity(10);
    for round in targets.chunks(ROUND) {
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for target in round {
            stepper.step(target).unwrap();
        }
        counts.push(ALLOCATIONS.load(Ordering::Relaxed) - before);
        if counts.last() == Some(&0) {
            break;
        }
    }
    counts
}

#[test]
fn frames_after_the_first_allocate_nothing() {
    let loaded = open_scene("default").unwrap();
    let scene = &loaded.scene;
    let rest = physics::rest_pose(scene, &mut |_| ControlFlow::Continue(())).unwrap();
    let cloth = Cloth::of_scene(scene, physics::rounded(&rest.positions)).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    let pool = pool.unwrap();
    // The second one is recurrent.
    let recurrent = "../../assets/models/paper-1024.safetensors";
    let recurrent = Path::new(env!("CARGO_MANIFEST_DIR")).join(recurrent);
    let models = [Path::new("paper"), &recurrent];
    let cases = models.map(|model| [(model, false), (model, true)]);
    for (name, is_guarded) in cases.into_iter().flatten() {
        let model = selvedge::Model::open(Some(name)).unwrap();
        let mut stepper: Box<dyn Stepper + Send> = if is_guarded {
            let (known, settings) = (Arc::new(scene.clone()), Correction::default());
            let rest = &rest.positions;
            Box::new(start::guarded(&known, rest, &model, &Machine::Cpu, settings).unwrap())
        } else {
            let graph = ClothGraph::new(&cloth, scene.environment, scene.frame_rate);
            let rest = cloth.rest_positions();
            Box::new(LearnedStepper::new(model.model, graph.unwrap(), &[rest]).unwrap())
        };
        let counts = pool.install(|| quiet_round(scene, &mut *stepper, &rest.positions));
        assert_eq!(counts.last(), Some(&0), "{name:?} {is_guarded}: {counts:?}");
    }
}

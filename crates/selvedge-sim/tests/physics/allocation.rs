//! Frames after the first allocate nothing.
//!
//! The counter is per thread, so that the other tests of this program do not count.
#![allow(unsafe_code, reason = "a counting allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Integrator, Stepper};
use selvedge_sim::{Simulator, Threads};

use crate::scenes::{hanging, moved};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
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

#[test]
fn later_frames_do_not_allocate() {
    for integrator in [Integrator::default(), Integrator::Linearised] {
        let mut scene = hanging(12);
        scene.physics.integrator = integrator;
        let targets: Vec<HandleTargets> = (1..30)
            .map(|frame| moved(&scene, DVec3::X * 1e-3 * f64::from(frame)))
            .collect();
        let mut simulator = Simulator::new(&scene).unwrap();
        simulator.set_threads(Threads::One);
        let mut counts = targets.iter().map(|targets| {
            let before = ALLOCATIONS.with(Cell::get);
            simulator.step(targets).unwrap();
            ALLOCATIONS.with(Cell::get) - before
        });
        counts.next();
        let rest: Vec<usize> = counts.collect();
        assert_eq!(rest, vec![0; rest.len()], "{integrator:?}");
    }
}

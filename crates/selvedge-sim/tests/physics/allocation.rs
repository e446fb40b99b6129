//! Solves after the first allocate nothing.
//!
//! The counter is per thread, so that the other tests of this program do not count.
#![allow(unsafe_code, reason = "a counting allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use selvedge_sim::Simulator;

use crate::scenes::hanging;

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
fn later_substeps_do_not_allocate() {
    let scene = hanging(12);
    let targets = scene.handles.select(scene.mesh.positions());
    let mut simulator = Simulator::new(&scene).unwrap();
    simulator.substep(1.0 / 240.0, &targets).unwrap();
    let before = ALLOCATIONS.with(Cell::get);
    for _ in 0..3 {
        simulator.substep(1.0 / 240.0, &targets).unwrap();
    }
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
}

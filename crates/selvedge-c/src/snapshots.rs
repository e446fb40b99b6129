//! Snapshots of steppers: taken, gone back to, freed.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

use selvedge::StepError;

use crate::border::{call, keep};
use crate::cloth::{SNAPSHOTS, STEPPERS, with};
use crate::fault::Fault;
use crate::registry::lock;
use crate::status::SelvedgeStatus;
use crate::steppers::SelvedgeStepper;

/// Handle of a snapshot, a state of a stepper in memory; 0 is none.
pub type SelvedgeSnapshot = u64;

/// Takes a snapshot of a stepper as it is now.
///
/// # Safety
/// `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_snapshot(
    stepper: SelvedgeStepper,
    out: *mut SelvedgeSnapshot,
) -> SelvedgeStatus {
    let make = || {
        let kept = STEPPERS.get(stepper)?;
        let run = lock(&kept.cloth)?;
        let frame = run.frame();
        let snapshot = run.snapshot().ok_or(StepError::Snapshot { frame });
        snapshot.map_err(Fault::step)
    };
    // SAFETY: as for this function.
    unsafe { keep(&SNAPSHOTS, out, make) }
}

/// Takes a stepper back to a snapshot of it, or of another stepper of the same scene by the same
/// mover: the frames that follow have the bytes of those that followed then. It may be gone back to
/// any number of times. Any other snapshot is an error, and the stepper stays as it was.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_stepper_restore(
    stepper: SelvedgeStepper,
    snapshot: SelvedgeSnapshot,
) -> SelvedgeStatus {
    with(stepper, |run| {
        let snapshot = SNAPSHOTS.get(snapshot)?;
        run.restore(&snapshot).map_err(Fault::step)
    })
}

/// Takes a stepper back to where it began.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_stepper_reset(stepper: SelvedgeStepper) -> SelvedgeStatus {
    with(stepper, |run| run.reset().map_err(Fault::step))
}

/// Frees a snapshot.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_snapshot_free(snapshot: SelvedgeSnapshot) -> SelvedgeStatus {
    call(|| SNAPSHOTS.free(snapshot))
}

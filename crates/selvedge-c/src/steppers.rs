//! Steppers: made, stepped, read, freed.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

mod read;

use std::sync::atomic::Ordering;

use glam::DVec3;
use selvedge::machine::Machine;
use selvedge::{HandleTargets, Network, Rigid, Run, Stepper};

use crate::border::{call, keep, put_all, values};
use crate::cloth::{KeptCloth, MODELS, SCENES, STEPPERS, not_begun, with};
use crate::fault::Fault;
use crate::listener::{Progress, SelvedgeListener};
use crate::models::SelvedgeModel;
use crate::scenes::SelvedgeScene;
use crate::status::SelvedgeStatus;
use crate::trust;

pub use read::*;

/// Handle of a stepper, a cloth that moves one frame at a time; 0 is none.
pub type SelvedgeStepper = u64;

/// Makes a stepper of the physics of a scene, where the scene starts: what `selvedge run`
/// runs. A rest pose is searched for first, which may take a while; it is kept for the other
/// steppers of the scene.
///
/// # Safety
/// `listener` is null or a listener that lives during the call; `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_physics(
    scene: SelvedgeScene,
    listener: *const SelvedgeListener,
    out: *mut SelvedgeStepper,
) -> SelvedgeStatus {
    let make = || {
        // SAFETY: as for this function.
        let mut progress = unsafe { Progress::of(listener) };
        let begun = Run::begin(&*SCENES.get(scene)?, &mut |event| progress.tell(event));
        begun.map(KeptCloth::from).map_err(not_begun)
    };
    // SAFETY: likewise.
    unsafe { keep(&STEPPERS, out, make) }
}

/// Makes a stepper of a model on a scene, from the rest pose of the scene on: what
/// `selvedge run --model` runs. `guard` is a `SelvedgeGuard`; 0 is that of the command line.
///
/// # Safety
/// `listener` is null or a listener that lives during the call; `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_model(
    scene: SelvedgeScene,
    model: SelvedgeModel,
    guard: i32,
    listener: *const SelvedgeListener,
    out: *mut SelvedgeStepper,
) -> SelvedgeStatus {
    let make = || {
        // SAFETY: as for this function.
        let mut progress = unsafe { Progress::of(listener) };
        let guard = trust::settings(guard)?;
        let (scene, model) = (SCENES.get(scene)?, MODELS.get(model)?);
        let network = Network {
            model: &model,
            machine: &Machine::Cpu,
            guard,
        };
        let begun = Run::begin_model(&scene, network, &mut |event| progress.tell(event));
        begun.map(KeptCloth::from).map_err(not_begun)
    };
    // SAFETY: likewise.
    unsafe { keep(&STEPPERS, out, make) }
}

/// Moves the cloth by one frame, its handles to `targets` `[m]`, `[samples][handles][3]`: where
/// they are at equally spaced times of the frame, the last at its end. One sample is enough;
/// handles move evenly between samples. `released`, `[handles]` or null, is not 0 for handles that
/// do not hold the cloth during this frame, which physics can follow, and networks without a rest
/// pose that their handles carry along.
///
/// A step that fails leaves the cloth as it was before it.
///
/// # Safety
/// `targets` has `samples * handles * 3` numbers, `released` is null or has `handles` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_step(
    stepper: SelvedgeStepper,
    targets: *const f64,
    samples: usize,
    handles: usize,
    released: *const u8,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        check_handles(cloth, handles)?;
        let count = numbers_of(samples, handles)?;
        // SAFETY: as for this function.
        let numbers = unsafe { values(targets, count, "targets") }?;
        let positions = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
        let mut given = HandleTargets::sampled(positions, handles).map_err(Fault::targets)?;
        if !released.is_null() {
            // SAFETY: likewise.
            let free = unsafe { values(released, handles, "released") }?;
            let free = free.into_iter().map(|byte| byte != 0).collect();
            given = given.releasing(free).map_err(Fault::targets)?;
        }
        cloth.step_to(&given).map_err(Fault::step)
    })
}

/// Moves the cloth by one frame, its handles as the motion of the scene has them: what the command
/// line does. Past the end of the motion the handles stay where they are.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_step_along(stepper: SelvedgeStepper) -> SelvedgeStatus {
    with(stepper, |cloth| cloth.step().map_err(Fault::step))
}

/// Leads the body of this number in the scene, from 0, in the next frame away from its own path, by
/// the rigid motion of the 4×4 matrix, by columns. It stays there until it is led on. The number of no
/// body is `SELVEDGE_STATUS_ARGUMENT`, and so is every number without a solver.
///
/// # Safety
/// `matrix` has 16 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_lead_body(
    stepper: SelvedgeStepper,
    body: usize,
    matrix: *const f64,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        // SAFETY: as for this function.
        let away = unsafe { rigid(matrix) }?;
        cloth.lead_obstacle(body, away).map_err(Fault::step)
    })
}

/// Sets the cloth elsewhere between two frames, as a character that appears in another place, by the
/// rigid motion of the 4×4 matrix, by columns; the `count` `bodies` of these numbers go along. The
/// cloth swings on as it did. Where it would meet a body, or is moved by a model, it stays.
///
/// # Safety
/// `matrix` has 16 numbers, `bodies` has `count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_teleport(
    stepper: SelvedgeStepper,
    matrix: *const f64,
    bodies: *const usize,
    count: usize,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        // SAFETY: as for this function.
        let to = unsafe { rigid(matrix) }?;
        // SAFETY: likewise.
        let along = unsafe { values(bodies, count, "bodies") }?;
        cloth.teleport(to, &along).map_err(Fault::step)
    })
}

/// Writes the targets of the next step as the motion of the scene has them, in the form that
/// `selvedge_step` takes: `targets` `[m]`, `[samples][handles][3]`, and `released`, `[handles]` or
/// null. With the `samples` of `SelvedgeCounts`, they move the cloth as the command line does.
///
/// # Safety
/// `targets` has room for `samples * handles * 3` numbers, `released` is null or has room for
/// `handles` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_motion_targets(
    stepper: SelvedgeStepper,
    targets: *mut f64,
    samples: usize,
    handles: usize,
    released: *mut u8,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        check_handles(cloth, handles)?;
        let count = numbers_of(samples, handles)?;
        let given = cloth.next_targets(samples).map_err(Fault::step)?;
        let mut numbers = Vec::with_capacity(count);
        for sample in 1..=samples {
            let fraction = sample as f64 / samples as f64;
            for handle in 0..handles {
                numbers.extend(given.at(handle, fraction, DVec3::ZERO).to_array());
            }
        }
        // SAFETY: as for this function.
        unsafe { put_all(targets, "targets", numbers.into_iter()) }?;
        if released.is_null() {
            return Ok(());
        }
        let free = (0..handles).map(|handle| u8::from(!given.holds(handle)));
        // SAFETY: likewise.
        unsafe { put_all(released, "released", free) }
    })
}

/// Lets the steps of this stepper end with `SELVEDGE_STATUS_STOPPED`, the one under way too, within
/// a frame where a frame takes long; with `wanted` 0, lets them go on again. It does not wait for
/// the step that another thread has under way.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_stepper_stop(stepper: SelvedgeStepper, wanted: i32) -> SelvedgeStatus {
    call(|| {
        let kept = STEPPERS.get(stepper)?;
        kept.stop.store(wanted != 0, Ordering::Relaxed);
        Ok(())
    })
}

/// Frees a stepper. Positions that were borrowed from it are no longer to be read.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_stepper_free(stepper: SelvedgeStepper) -> SelvedgeStatus {
    call(|| STEPPERS.free(stepper))
}

/// The rigid motion of a matrix, by columns.
///
/// # Safety
/// `matrix` has 16 numbers.
unsafe fn rigid(matrix: *const f64) -> Result<Rigid, Fault> {
    // SAFETY: as for this function.
    let columns = unsafe { values(matrix, 16, "matrix") }?;
    Rigid::try_from(&columns[..]).map_err(Fault::targets)
}

fn check_handles(cloth: &Run, found: usize) -> Result<(), Fault> {
    match cloth.handles().len() {
        wanted if wanted == found => Ok(()),
        wanted => Err(Fault::count("handles", "handles", wanted, found)),
    }
}

/// Samples of a frame beyond which a number is a mistake.
const MOST_SAMPLES: usize = 1 << 20;

/// Numbers in an array of targets.
fn numbers_of(samples: usize, handles: usize) -> Result<usize, Fault> {
    let is_within = (1..=MOST_SAMPLES).contains(&samples);
    let count = samples.checked_mul(handles).and_then(|n| n.checked_mul(3));
    count.filter(|_| is_within).ok_or_else(|| {
        let text = format!("samples: expected 1 to {MOST_SAMPLES} times, found {samples}");
        Fault::argument(text)
    })
}

#[cfg(test)]
mod tests;

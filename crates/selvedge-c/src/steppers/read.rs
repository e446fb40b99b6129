//! What can be read of a stepper: counts, positions, faces, handles, trust, warnings.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

use std::ffi::c_char;

use selvedge::{Run, Stepper};

use crate::border::{put, put_all, put_text};
use crate::cloth::with;
use crate::fault::Fault;
use crate::status::SelvedgeStatus;
use crate::steppers::SelvedgeStepper;
use crate::trust::SelvedgeTrust;

/// Counts of a stepper.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelvedgeCounts {
    /// Vertices of the cloth.
    pub vertices: u64,
    /// Faces of the cloth, triangles.
    pub faces: u64,
    /// Handles, the vertices that are led.
    pub handles: u64,
    /// Targets per frame with which the command line drives such a stepper: one per substep of the
    /// physics, one for a model.
    pub samples: u64,
    /// Frames that the motion of the scene lasts.
    pub motion_frames: u64,
    /// Frames since the start; a scene that starts in a saved state begins with its frame.
    pub frame: u64,
    /// Frames per second.
    pub frame_rate: f64,
}

/// Writes the counts of a stepper.
///
/// # Safety
/// `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_counts(
    stepper: SelvedgeStepper,
    out: *mut SelvedgeCounts,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        let scene = cloth.scene().built();
        let frames = scene.frame_count();
        let frames = frames.map_err(|error| Fault::of(SelvedgeStatus::Start, error))?;
        let counts = SelvedgeCounts {
            vertices: cloth.positions().len() as u64,
            faces: cloth.topology().faces().len() as u64,
            handles: cloth.handles().len() as u64,
            samples: cloth.samples() as u64,
            motion_frames: frames as u64,
            frame: cloth.frame() as u64,
            frame_rate: scene.frame_rate,
        };
        // SAFETY: as for this function.
        unsafe { put(out, "out", counts) }
    })
}

/// Lends the positions `[m]`, `[vertices][3]`, without a copy: `out` gets their address, `vertices`
/// how many there are. They may be read until the next call that moves this stepper (a step,
/// a teleport, a way back) or frees it, from whichever thread; whoever cannot rule that out copies them.
///
/// # Safety
/// `out` and `vertices` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_positions(
    stepper: SelvedgeStepper,
    out: *mut *const f32,
    vertices: *mut usize,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        let positions = cloth.positions();
        // SAFETY: as for this function.
        unsafe { put(vertices, "vertices", positions.len()) }?;
        // SAFETY: likewise. A position is three f32 in a row.
        unsafe { put(out, "out", positions.as_ptr().cast::<f32>()) }
    })
}

/// Copies the positions `[m]` to `out`, `[vertices][3]`.
///
/// # Safety
/// `out` has room for `3 * vertices` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_copy_positions(
    stepper: SelvedgeStepper,
    out: *mut f32,
    vertices: usize,
) -> SelvedgeStatus {
    // SAFETY: as for this function.
    unsafe {
        copy(stepper, out, ("vertices", vertices), |cloth| {
            cloth.positions().iter().map(|p| p.to_array()).collect()
        })
    }
}

/// Copies the positions `[m]` to `out`, `[vertices][3]`: those of the state of the physics, which
/// has more digits than frames have, and those of a model as they are.
///
/// # Safety
/// `out` has room for `3 * vertices` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_copy_positions_f64(
    stepper: SelvedgeStepper,
    out: *mut f64,
    vertices: usize,
) -> SelvedgeStatus {
    // SAFETY: as for this function.
    unsafe {
        copy(stepper, out, ("vertices", vertices), |cloth| {
            cloth.positions_f64().iter().map(|p| p.to_array()).collect()
        })
    }
}

/// Copies what each body of the scene received from the cloth in the last frame to `out`, `[bodies][6]`:
/// momentum `[N s]`, and angular momentum about the origin `[N m s]`; times the frame rate, force and torque.
/// Of a model, and of a scene without contact, there are none.
///
/// # Safety
/// `out` has room for `6 * bodies` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_copy_impulses(
    stepper: SelvedgeStepper,
    out: *mut f64,
    bodies: usize,
) -> SelvedgeStatus {
    // SAFETY: as for this function.
    unsafe {
        copy(stepper, out, ("bodies", bodies), |cloth| {
            let impulses = cloth.impulses().iter();
            impulses
                .map(|one| [one.linear, one.angular].map(|v| v.to_array()))
                .collect()
        })
    }
}

/// Copies the faces to `out`, `[faces][3]`: numbers of their vertices, counterclockwise where they
/// are seen from the front.
///
/// # Safety
/// `out` has room for `3 * faces` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_copy_faces(
    stepper: SelvedgeStepper,
    out: *mut u32,
    faces: usize,
) -> SelvedgeStatus {
    // SAFETY: as for this function.
    unsafe {
        copy(stepper, out, ("faces", faces), |cloth| {
            cloth.topology().face_indices()
        })
    }
}

/// Copies the vertices of the handles to `out`, `[handles]`, in the order in which a step takes
/// their targets.
///
/// # Safety
/// `out` has room for `handles` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_copy_handles(
    stepper: SelvedgeStepper,
    out: *mut u32,
    handles: usize,
) -> SelvedgeStatus {
    // SAFETY: as for this function.
    unsafe {
        copy(stepper, out, ("handles", handles), |cloth| {
            let vertices = cloth.handles().vertices().iter();
            vertices.map(|vertex| vertex.0).collect()
        })
    }
}

/// Writes the guard's word on the newest frame of a model.
///
/// # Safety
/// `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_trust(
    stepper: SelvedgeStepper,
    out: *mut SelvedgeTrust,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        let Some(trust) = cloth.trust() else {
            let text = "the physics has no guard: ask a stepper of a model for its trust";
            return Err(Fault::argument(text));
        };
        // SAFETY: as for this function.
        unsafe { put(out, "out", SelvedgeTrust::from(trust)) }
    })
}

/// Writes what is to be known of a stepper so far, a line each: the warnings of its scene, what of
/// the scene a model does not do, what goes beyond the model's training, edges that strain by more
/// than 50 %, and bodies that were let through the cloth. `text`, `room` and
/// `needed` are those of `selvedge_scene_warnings`.
///
/// # Safety
/// `text` is null or has `room` bytes; `needed` is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_stepper_warnings(
    stepper: SelvedgeStepper,
    text: *mut c_char,
    room: usize,
    needed: *mut usize,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        // SAFETY: as for this function.
        unsafe { put_text(&cloth.warnings().join("\n"), text, room, needed) }
    })
}

/// Copies an entry for each of so many, which are named, from a cloth that has as many: `T` is the
/// numbers `N` of an entry, in a row.
///
/// # Safety
/// `out` has room for the numbers.
unsafe fn copy<T, N>(
    stepper: SelvedgeStepper,
    out: *mut N,
    (unit, count): (&str, usize),
    read: impl FnOnce(&Run) -> Vec<T>,
) -> SelvedgeStatus {
    with(stepper, |cloth| {
        let all = read(cloth);
        if all.len() != count {
            return Err(Fault::count(unit, unit, all.len(), count));
        }
        // SAFETY: as for this function, and the count is the cloth's.
        unsafe { put_all(out.cast::<T>(), "out", all.into_iter()) }
    })
}

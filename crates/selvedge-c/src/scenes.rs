//! Scenes: opened, warned of, freed.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

use std::ffi::c_char;

use selvedge::Scene;

use crate::border::{call, keep, put_text, text};
use crate::cloth::SCENES;
use crate::fault::Fault;
use crate::status::SelvedgeStatus;

/// Handle of a scene; 0 is none.
pub type SelvedgeScene = u64;

/// Opens a scene by the path of its file or by the name of a shipped one ("default").
///
/// # Safety
/// `path_or_name` is a text that ends with a zero byte; `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_scene_open(
    path_or_name: *const c_char,
    out: *mut SelvedgeScene,
) -> SelvedgeStatus {
    let make = || {
        // SAFETY: as for this function.
        let name = unsafe { text(path_or_name, "path_or_name") }?;
        Scene::named(name).map_err(|error| Fault::of(SelvedgeStatus::Open, error))
    };
    // SAFETY: likewise.
    unsafe { keep(&SCENES, out, make) }
}

/// Writes what the scene asks for and cannot have, or hardly means, a line each.
///
/// `needed` gets the bytes that the text takes with its zero byte; `text` is filled where it has
/// room for so many, and may be null to ask for their number only.
///
/// # Safety
/// `text` is null or has `room` bytes; `needed` is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_scene_warnings(
    scene: SelvedgeScene,
    text: *mut c_char,
    room: usize,
    needed: *mut usize,
) -> SelvedgeStatus {
    call(|| {
        let kept = SCENES.get(scene)?;
        let lines = kept.warnings().join("\n");
        // SAFETY: as for this function.
        unsafe { put_text(&lines, text, room, needed) }
    })
}

/// Frees a scene. Steppers that were made of it go on.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_scene_free(scene: SelvedgeScene) -> SelvedgeStatus {
    call(|| SCENES.free(scene))
}

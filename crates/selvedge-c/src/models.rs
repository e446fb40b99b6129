//! Models: opened and freed.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

use std::ffi::c_char;
use std::path::Path;

use crate::border::{call, keep, text};
use crate::cloth::MODELS;
use crate::fault::Fault;
use crate::status::SelvedgeStatus;

/// Handle of a model; 0 is none.
pub type SelvedgeModel = u64;

/// Opens a model by the path of its file or by the name of a shipped one ("paper");
/// null opens the one that the command line takes.
///
/// # Safety
/// `path_or_name` is null or a text that ends with a zero byte; `out` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_model_open(
    path_or_name: *const c_char,
    out: *mut SelvedgeModel,
) -> SelvedgeStatus {
    let make = || {
        let name = if path_or_name.is_null() {
            None
        } else {
            // SAFETY: as for this function.
            Some(unsafe { text(path_or_name, "path_or_name") }?)
        };
        let model = selvedge::Model::open(name.map(Path::new));
        model.map_err(|error| Fault::of(SelvedgeStatus::Open, error))
    };
    // SAFETY: likewise.
    unsafe { keep(&MODELS, out, make) }
}

/// Frees a model. Steppers that were made of it go on.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_model_free(model: SelvedgeModel) -> SelvedgeStatus {
    call(|| MODELS.free(model))
}

//! Selvedge inside a page, as WebAssembly: the session of the viewer for a worker ([`Session`]), and
//! one cloth that a program moves ([`Cloth`]). Nothing here touches files or threads.

mod cloth;
mod session;

pub use cloth::Cloth;
pub use session::Session;

use std::error::Error;

use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn console_error(text: &str);
}

/// A panic stops the module; the console then says where.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| console_error(&panic.to_string())));
}

/// An error with its causes.
fn js_error(error: impl Into<Box<dyn Error + Send + Sync>>) -> JsError {
    JsError::new(&selvedge::cause::chain(&*error.into()))
}

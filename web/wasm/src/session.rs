//! The session of the viewer, driven by a worker.

use selvedge::machine::Machine;
use selvedge_live::{EmbeddedSession, Mover, Opening};
use selvedge_workshop::SceneWorkshop;
use wasm_bindgen::prelude::*;

use crate::js_error;

/// A session for one page. Its messages are those of the viewer's socket.
#[wasm_bindgen]
pub struct Session(EmbeddedSession);

#[wasm_bindgen]
impl Session {
    /// A session that begins with the shipped scene of this name, moved by `model`, by `physics` or
    /// by `both`.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, mover: &str) -> Result<Session, JsError> {
        let mover = match mover {
            "model" => Mover::Model,
            "physics" => Mover::Physics,
            "both" => Mover::Both,
            _ => return Err(JsError::new("a cloth is moved by model, physics or both")),
        };
        let workshop = SceneWorkshop::new(scene, &[], Machine::Cpu).map_err(js_error)?;
        let opening = Opening {
            order: workshop.first_order(),
            mover,
            replay: None,
        };
        Ok(Self(EmbeddedSession::new(
            Box::new(workshop),
            opening,
            None,
        )))
    }

    /// Takes a message of the page.
    pub fn receive(&mut self, message: &[u8]) -> Result<(), JsError> {
        self.0.receive(message).map_err(js_error)
    }

    /// Lets time go on, or stand still, with whether somebody watches.
    pub fn watch(&mut self, is_watched: bool) {
        self.0.watch(is_watched);
    }

    /// Does what is due, and calls `post` with each message to the page, as a `Uint8Array`. Returns
    /// the time until something is due `[ms]`.
    pub fn turn(&mut self, post: &js_sys::Function) -> f64 {
        let wait = self.0.turn(&mut |message| {
            let bytes = js_sys::Uint8Array::from(message);
            // What a page makes of its messages is its own affair.
            let _ = post.call1(&JsValue::NULL, &bytes);
        });
        1e3 * wait.as_secs_f64()
    }
}

//! What goes over the socket, both ways: binary messages, little-endian, of which each begins with
//! `[version u8, kind u8, 0 u16]`, so that everything after it is aligned to four bytes.
//!
//! From the session to the page:
//!
//! | kind | | then |
//! |---|---|---|
//! | 1 | hello | JSON ([`Hello`]): who the page is, and what can be chosen |
//! | 2 | cloth | `generation, vertices, faces` u32; `[faces, 3]` u32; material coordinates `[vertices, 2]` f32 `[m]` |
//! | 3 | state | JSON ([`crate::State`]) |
//! | 4 | frame | `generation, number` u32; `time` f32 `[s]`; `client, drag` u32 (the last drag that this frame follows); `handles, tracks, vertices` u32; `[handles]` of (vertex u32, goal `[3]` f32 `[m]`); positions `[tracks, vertices, 3]` f32 `[m]` |
//!
//! From the page to the session:
//!
//! | kind | | then |
//! |---|---|---|
//! | 16 | ready | `number` u32: this frame was taken up; a page that falls behind is sent fewer |
//! | 17 | drag | `drag, count` u32; `[count]` of (vertex u32, goal `[3]` f32 `[m]`): a vertex that is no handle becomes one |
//! | 18 | keys | direction `[3]` f32 in the world and turn f32 (counter-clockwise from above), each in [-1, 1]: all handles |
//! | 19 | command | JSON ([`Command`]) |
//!
//! Anything else, of another length or with a number that is not finite, is refused with a reason.

mod receive;
mod send;

pub use receive::{ClientMessage, Command, Drag, Push, WireError, decode};
pub use send::{FrameParts, Hello, cloth, frame, json};

/// The version of these messages; a page of another one is told to reload.
pub const VERSION: u8 = 1;

/// The name of the sub-protocol that a page asks for, with [`VERSION`] in it.
pub const SUBPROTOCOL: &str = "selvedge.v1";

/// No message to the session is longer `[bytes]`.
pub const LONGEST: usize = 16 * 1024;

/// Handles that one drag may move.
pub const MOST_DRAGGED: usize = 256;

/// The kinds of messages, as their second byte has them.
pub mod kind {
    /// To the page: who it is, and what can be chosen.
    pub const HELLO: u8 = 1;
    /// To the page: what does not change from frame to frame.
    pub const CLOTH: u8 = 2;
    /// To the page: how things are.
    pub const STATE: u8 = 3;
    /// To the page: where everything is.
    pub const FRAME: u8 = 4;
    /// From the page: a frame was taken up.
    pub const READY: u8 = 16;
    /// From the page: goals of handles.
    pub const DRAG: u8 = 17;
    /// From the page: keys that are held down.
    pub const KEYS: u8 = 18;
    /// From the page: anything else.
    pub const COMMAND: u8 = 19;
}

#[cfg(test)]
mod tests;

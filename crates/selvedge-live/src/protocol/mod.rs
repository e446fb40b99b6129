//! The messages of the socket, both ways: binary and little-endian. Each begins with
//! `[version u8, kind u8, 0 u16]`, so that everything after it is aligned to four bytes.
//!
//! From the session to the page:
//!
//! | kind | name | body |
//! |---|---|---|
//! | 1 | hello | JSON ([`Hello`]): the number of the page, and the catalogue |
//! | 2 | cloth | see below |
//! | 3 | state | JSON ([`crate::State`]) |
//! | 4 | frame | see below |
//! | 5 | file | `length` u32, the name of so many bytes, and the contents: a recording to save |
//!
//! A **cloth** has `generation, vertices, faces, points` u32, the faces `[faces, 3]` u32, their
//! corners among the points of the pattern `[faces, 3]` u32, and these points `[points, 2]` f32
//! `[m]`. Then `bodies` u32, and of each body its `kind` ([`crate::BodyKind`]), `points, faces`
//! u32 and the faces `[faces, 3]` u32 among its own points.
//!
//! A **frame** has `generation, number` u32, `time` f32 `[s]`, `client, drag` u32 (the last drag
//! that this frame follows), `handles, tracks, vertices, points, gaps` u32, `[handles]` of (vertex
//! u32, goal `[3]` f32 `[m]`), the positions `[tracks, vertices, 3]` f32 `[m]`, the points of all
//! bodies `[points, 3]` f32 `[m]`, and the gaps `[gaps]` f32 `[m]`: those of each track's vertices,
//! or none.
//!
//! From the page to the session:
//!
//! | kind | name | body |
//! |---|---|---|
//! | 16 | ready | `number` u32: this frame was taken up |
//! | 17 | drag | `drag, count` u32; `[count]` of (vertex u32, goal `[3]` f32 `[m]`) |
//! | 18 | keys | direction `[3]` f32 in the world and turn f32, each in [-1, 1] |
//! | 19 | command | JSON ([`Command`]) |
//!
//! A page that falls behind with **ready** is sent fewer frames. A vertex that a **drag** moves
//! becomes a handle. **Keys** move all handles; their turn is counter-clockwise from above.
//!
//! Anything else, of another length or with a number that is not finite, is refused with a reason.

mod receive;
mod send;

pub use receive::{ClientMessage, Command, Drag, Push, WireError, decode};
pub use send::{FrameParts, Hello, cloth, file, frame, hello, json};

/// The version of these messages; a page of another version is told to reload.
pub const VERSION: u8 = 3;

/// The name of the sub-protocol that a page asks for, with [`VERSION`] in it.
pub const SUBPROTOCOL: &str = "selvedge.v3";

/// No message to the session is longer `[bytes]`.
pub const LONGEST: usize = 16 * 1024;

/// Handles that one drag may move.
pub const MOST_DRAGGED: usize = 256;

/// The kinds of messages, as their second byte has them.
pub mod kind {
    /// To the page: its number, and the catalogue.
    pub const HELLO: u8 = 1;
    /// To the page: the constant part of a cloth.
    pub const CLOTH: u8 = 2;
    /// To the page: the state of the session.
    pub const STATE: u8 = 3;
    /// To the page: the positions of a frame.
    pub const FRAME: u8 = 4;
    /// To the page: a file to save.
    pub const FILE: u8 = 5;
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

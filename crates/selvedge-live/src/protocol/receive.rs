//! Messages from a page, read without trusting them.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{LONGEST, MOST_DRAGGED, VERSION, kind};
use crate::mover::Mover;
use crate::order::Order;

/// A message from a page.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientMessage {
    /// The page has taken up the frame of this number.
    Ready(u32),
    /// Handles have other goals.
    Drag(Drag),
    /// Keys are held down, or let go where all is zero.
    Keys(Push),
    /// Anything else.
    Command(Command),
}

/// Goals of handles, as a pointer moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Drag {
    /// The number of the drag, counted by the page; the first frame that follows the drag has it.
    pub number: u32,
    /// Vertices and their goals `[m]`.
    pub goals: Vec<(u32, DVec3)>,
}

/// A push of all handles together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Direction in the world, each part in [-1, 1].
    pub direction: DVec3,
    /// Turn about the vertical, counter-clockwise from above, in [-1, 1].
    pub turn: f64,
}

/// A request by a button or a choice. Those without fields have braces: serde would let others pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Time stops.
    Pause {},
    /// Time goes on.
    Resume {},
    /// One frame, and time stops.
    Step {},
    /// Back to the start: the rest pose, the handles of the scene.
    Reset {},
    /// Another cloth.
    Order {
        /// The cloth.
        order: Order,
    },
    /// Another mover.
    Mover {
        /// The mover.
        mover: Mover,
    },
    /// Another wind.
    Wind {
        /// Its velocity `[m/s]`.
        wind: [f64; 3],
    },
    /// Other limits of the hands.
    Limits {
        /// The greatest speed of a handle `[m/s]`.
        speed: f64,
        /// The greatest acceleration `[m/s²]`.
        acceleration: f64,
    },
    /// These vertices are held from now on.
    Hold {
        /// Their numbers.
        vertices: Vec<u32>,
    },
    /// These handles are no longer held.
    LetGo {
        /// The numbers of their vertices.
        vertices: Vec<u32>,
    },
    /// The handles follow a named motion, or `scene`, that of the scene, from its start.
    Motion {
        /// Its name.
        name: String,
    },
    /// The motion ends at its present place.
    StopMotion {},
    /// Every frame from now on is kept.
    Record {},
    /// The kept frames are written.
    StopRecording {},
    /// The last recording is played.
    Replay {},
    /// Back from a recording to the cloth that moves.
    Live {},
    /// The recording goes on from this frame.
    Seek {
        /// Counted from 0.
        frame: usize,
    },
    /// Another rate of time.
    Rate {
        /// 1 is real time.
        rate: f64,
    },
    /// A body is led, within the limits of the hands.
    Body {
        /// Its number.
        number: usize,
        /// The place for the middle of its points `[m]`.
        middle: [f64; 3],
    },
    /// The ball is thrown.
    Throw {
        /// Its middle at first `[m]`.
        from: [f64; 3],
        /// Its velocity at first `[m/s]`.
        velocity: [f64; 3],
    },
    /// All handles are let go.
    Drop {},
    /// Frames have the gaps of the vertices, or no longer.
    Gaps {
        /// True for those that have.
        shown: bool,
    },
}

/// The reason why a message is refused.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct WireError(String);

/// The refusal of a message of `kind` that has another length than it should `[bytes]`.
fn length(kind: u8, expected: usize, found: usize) -> WireError {
    WireError(format!(
        "a message of kind {kind} has {expected} bytes, found {found}"
    ))
}

/// Nobody pulls a cloth farther from the origin `[m]`.
const FARTHEST: f32 = 1e3;

/// Reads a message from a page.
pub fn decode(bytes: &[u8]) -> Result<ClientMessage, WireError> {
    let found = bytes.len();
    let refuse = |reason: String| Err(WireError(reason));
    if found > LONGEST {
        return refuse(format!(
            "the message has {found} bytes, {LONGEST} are the most"
        ));
    }
    let Some((&[version, kind, a, b], body)) = bytes.split_first_chunk::<4>() else {
        return refuse(format!(
            "the message has {found} bytes, its header alone has 4"
        ));
    };
    if version != VERSION {
        return refuse(format!(
            "the message is of version {version}, this program speaks version {VERSION}: reload the page"
        ));
    }
    if [a, b] != [0, 0] {
        return refuse("the bytes 2 and 3 of a message are 0".to_owned());
    }
    match kind {
        kind::READY => {
            let [number] = words(kind, body)?;
            Ok(ClientMessage::Ready(number))
        }
        kind::DRAG => Ok(ClientMessage::Drag(drag(body)?)),
        kind::KEYS => {
            let [x, y, z, turn] = words(kind, body)?;
            let part = |word| number(kind, word, 1.0);
            Ok(ClientMessage::Keys(Push {
                direction: DVec3::new(part(x)?, part(y)?, part(z)?),
                turn: part(turn)?,
            }))
        }
        kind::COMMAND => serde_json::from_slice(body)
            .map(ClientMessage::Command)
            .map_err(|error| WireError(format!("the command cannot be understood: {error}"))),
        found => refuse(format!("there is no message of kind {found} from a page")),
    }
}

fn drag(body: &[u8]) -> Result<Drag, WireError> {
    let kind = kind::DRAG;
    let length = |expected| length(kind, expected, body.len() + 4);
    let (words, rest) = body.as_chunks::<4>();
    let [drag, count, goals @ ..] = words else {
        return Err(length(12));
    };
    let found = u32::from_le_bytes(*count);
    if !(1..=MOST_DRAGGED as u32).contains(&found) {
        let reason = format!("a drag moves 1 to {MOST_DRAGGED} handles, found {found}");
        return Err(WireError(reason));
    }
    if !rest.is_empty() || goals.len() != 4 * found as usize {
        return Err(length(12 + 16 * found as usize));
    }
    let goals = goals.as_chunks::<4>().0.iter().map(|[vertex, x, y, z]| {
        let part = |word: &[u8; 4]| number(kind, u32::from_le_bytes(*word), FARTHEST);
        let goal = DVec3::new(part(x)?, part(y)?, part(z)?);
        Ok((u32::from_le_bytes(*vertex), goal))
    });
    Ok(Drag {
        number: u32::from_le_bytes(*drag),
        goals: goals.collect::<Result<_, WireError>>()?,
    })
}

/// A body of exactly `N` words.
fn words<const N: usize>(kind: u8, body: &[u8]) -> Result<[u32; N], WireError> {
    let (words, rest) = body.as_chunks::<4>();
    match <&[[u8; 4]; N]>::try_from(words) {
        Ok(words) if rest.is_empty() => Ok(words.map(u32::from_le_bytes)),
        _ => Err(length(kind, 4 + 4 * N, body.len() + 4)),
    }
}

/// The f32 in a word, finite and at most `bound` in size.
fn number(kind: u8, word: u32, bound: f32) -> Result<f64, WireError> {
    let found = f32::from_bits(word);
    if found.abs() <= bound {
        Ok(f64::from(found))
    } else {
        Err(WireError(format!(
            "a number in a message of kind {kind} is {found}, it must be finite and within {bound}"
        )))
    }
}

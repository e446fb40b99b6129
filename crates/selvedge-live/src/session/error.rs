//! The reasons why a session does not do what it was asked, as pages are told them.

use selvedge_cloth::{HandleError, MotionError};
use thiserror::Error;

use crate::mover::LiveError;

/// The reason why a request was not met; everything goes on as before.
#[derive(Debug, Error)]
pub(crate) enum SessionError {
    #[error("there is no cloth yet")]
    NoCloth,
    #[error("nothing has been recorded yet")]
    NoRecording,
    #[error("a recording is being played: go back to the cloth first")]
    Playing,
    #[error("a recording is under way: end it before the next")]
    Recording,
    #[error("time cannot go {rate} times as fast: {slowest} to {fastest} times are possible")]
    Rate {
        rate: f64,
        slowest: f64,
        fastest: f64,
    },
    #[error("the wind is at most {most} m/s")]
    Wind { most: f64 },
    #[error("{most} handles are the most")]
    TooManyHandles { most: usize },
    #[error("there is no such body here")]
    NoBody,
    #[error("there is no ball here: it comes with contact (tick \"touches\")")]
    NoBall,
    #[error("the ball is thrown at no more than {fastest} m/s, and within {farthest} m")]
    Throw { fastest: f64, farthest: f64 },
    #[error("bodies stay within {farthest} m")]
    FarBody { farthest: f64 },
    #[error("a learned model does not see bodies: let the physics move the cloth")]
    ModelBlind,
    #[error("there is no motion {name:?}")]
    UnknownMotion { name: String },
    #[error(transparent)]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Motion(#[from] MotionError),
    #[error(transparent)]
    Live(#[from] LiveError),
}

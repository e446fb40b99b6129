//! How things are, as pages are told a few times per second.

use serde::Serialize;

use crate::hand::HandLimits;
use crate::mover::{Mover, MoverKind};
use crate::order::Order;

/// How things are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct State {
    /// Of the cloth that is shown.
    pub generation: u32,
    /// What the cloth on the table was ordered as.
    pub order: Order,
    /// Who moves it.
    pub mover: Mover,
    /// What is shown.
    pub show: Show,
    /// Whether time goes on.
    pub running: bool,
    /// Frames per second of the scene or of the recording.
    pub frame_rate: f64,
    /// How fast time is to go; 1 is real time.
    pub rate: f64,
    /// How fast it went over the last second, in parts of [`Self::rate`]; under 1 where a step takes too long.
    pub kept: f64,
    /// One per cloth that is shown.
    pub tracks: Vec<TrackState>,
    /// What hands may do.
    pub limits: HandLimits,
    /// Velocity of the wind `[m/s]`.
    pub wind: [f64; 3],
    /// The motion that the handles follow, if they follow one.
    pub motion: Option<MotionState>,
    /// What is being kept, if something is.
    pub recording: Option<RecordingState>,
    /// Files of the last recording.
    pub recorded: Vec<String>,
    /// Whether there is a recording to replay.
    pub can_replay: bool,
    /// Whether there is a cloth that moves, beside a recording.
    pub can_live: bool,
    /// What is being made ready.
    pub busy: Option<String>,
    /// The last thing that people should know.
    pub notice: Option<Notice>,
    /// Pages that watch.
    pub viewers: usize,
}

/// What is shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Show {
    /// Nothing yet.
    Nothing,
    /// A cloth that moves.
    Live,
    /// A recording.
    Recording {
        /// What it is called.
        name: String,
        /// The frame that is shown, from 0.
        frame: usize,
        /// How many there are.
        frames: usize,
    },
}

/// One cloth that is shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackState {
    /// What it is called.
    pub name: String,
    /// Who moves it; nobody, if it is a recording.
    pub kind: Option<MoverKind>,
    /// Wall time of a step, smoothed `[ms]`.
    pub step_ms: f64,
    /// The largest strain of an edge now, (l - l₀)/l₀ against the material.
    pub strain: f64,
    /// Why it moves no more.
    pub stopped: Option<String>,
}

/// A motion that is being followed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MotionState {
    /// Its name.
    pub name: String,
    /// Frames of it that have passed.
    pub frame: usize,
    /// How many it has.
    pub frames: usize,
}

/// A recording under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct RecordingState {
    /// Frames so far.
    pub frames: usize,
    /// Frames at most.
    pub most: usize,
}

/// Something that people should know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Notice {
    /// Counts them, so that a page shows each once.
    pub number: u32,
    /// How bad it is.
    pub level: Level,
    /// What it is.
    pub text: String,
}

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Not at all.
    Good,
    /// Something was not done.
    Bad,
}

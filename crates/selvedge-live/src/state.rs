//! The state of a session, as pages are told a few times per second.

use serde::Serialize;

use crate::hand::HandLimits;
use crate::mover::{Mover, MoverKind};
use crate::order::Order;

/// The state of a session.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct State {
    /// The generation of the shown cloth.
    pub generation: u32,
    /// The order of the cloth on the table.
    pub order: Order,
    /// The mover of the cloth.
    pub mover: Mover,
    /// The kind of the shown cloth.
    pub show: Show,
    /// True while time goes on.
    pub running: bool,
    /// Frames per second of the scene or of the recording.
    pub frame_rate: f64,
    /// The wanted rate of time; 1 is real time.
    pub rate: f64,
    /// The rate of the last second in parts of [`Self::rate`]; under 1 where a step takes too long.
    pub kept: f64,
    /// The state of each shown cloth.
    pub tracks: Vec<TrackState>,
    /// The limits of the hands.
    pub limits: HandLimits,
    /// Velocity of the wind `[m/s]`.
    pub wind: [f64; 3],
    /// The motion that the handles follow, if they follow one.
    pub motion: Option<MotionState>,
    /// The recording under way.
    pub recording: Option<RecordingState>,
    /// Files of the last recording.
    pub recorded: Vec<String>,
    /// True where the cloth on the table touches what is beside it.
    pub touches: bool,
    /// True where frames have the gaps of the vertices.
    pub gaps: bool,
    /// True where there is a recording to replay.
    pub can_replay: bool,
    /// True while a recording is played: the page may go back to the cloth.
    pub can_live: bool,
    /// The progress of a cloth that is being made ready.
    pub busy: Option<String>,
    /// The reason why what the mover shows now is doubtful, while it is.
    pub remark: Option<String>,
    /// The last thing that people should know.
    pub notice: Option<Notice>,
    /// Pages that watch.
    pub viewers: usize,
}

/// The kind of the shown cloth.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Show {
    /// Nothing yet.
    Nothing,
    /// A cloth that moves.
    Live,
    /// A recording.
    Recording {
        /// Its name.
        name: String,
        /// The frame that is shown, from 0.
        frame: usize,
        /// Frames in all.
        frames: usize,
    },
}

/// One cloth that is shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackState {
    /// Its name.
    pub name: String,
    /// Its mover; none for a recording.
    pub kind: Option<MoverKind>,
    /// Wall time of a step, smoothed `[ms]`.
    pub step_ms: f64,
    /// The largest strain of an edge now, (l - l₀)/l₀ against the material.
    pub strain: f64,
    /// Drape coefficient and folds now, where this is a drape test.
    pub drape: Option<(f64, usize)>,
    /// What has moved it in the place of its mover within the last half second.
    pub stand_in: Option<&'static str>,
    /// The reason why it moves no more.
    pub stopped: Option<String>,
}

/// A motion that is being followed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MotionState {
    /// Its name.
    pub name: String,
    /// Frames of it that have passed.
    pub frame: usize,
    /// Frames in all.
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
    /// Its number, so that a page shows each notice once.
    pub number: u32,
    /// Its level.
    pub level: Level,
    /// Its text.
    pub text: String,
}

/// The level of a notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Something was done.
    Good,
    /// Something was not done.
    Bad,
}

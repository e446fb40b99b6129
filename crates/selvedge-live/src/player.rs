//! Recordings that are played: one or more trajectories of one cloth, with one time line.

use std::sync::Arc;

use glam::Vec3;
use selvedge_data::Trajectory;

use crate::stage::StrainGauge;
use crate::state::{Show, Track};

/// A recording with the name of who made it.
#[derive(Clone, Debug)]
pub struct NamedTrack {
    /// What it is called.
    pub name: String,
    /// Its frames.
    pub trajectory: Arc<Trajectory>,
}

/// Recordings side by side.
#[derive(Clone, Debug)]
pub struct Tape {
    name: String,
    tracks: Vec<NamedTrack>,
}

/// Recordings that cannot be played side by side.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum TapeError {
    /// There is none.
    #[error("there is no recording to play")]
    Empty,
    /// Not of one cloth.
    #[error("{first} and {other} are not of one mesh: recordings side by side have the same faces")]
    Cloth {
        /// The name of one.
        first: String,
        /// The name of the other.
        other: String,
    },
}

impl Tape {
    /// Puts recordings of one cloth side by side.
    ///
    /// # Errors
    /// [`TapeError`] when there is none, or they are of several meshes.
    pub fn new(name: impl Into<String>, tracks: Vec<NamedTrack>) -> Result<Self, TapeError> {
        let first = tracks.first().ok_or(TapeError::Empty)?;
        let topology = first.trajectory.topology();
        if let Some(other) = tracks.iter().find(|t| t.trajectory.topology() != topology) {
            return Err(TapeError::Cloth {
                first: first.name.clone(),
                other: other.name.clone(),
            });
        }
        Ok(Self {
            name: name.into(),
            tracks,
        })
    }

    /// The first of them, whose handles and rate are shown.
    #[must_use]
    pub fn first(&self) -> &Trajectory {
        &self.tracks[0].trajectory
    }

    /// Frames that all of them have.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        let counts = self.tracks.iter().map(|t| t.trajectory.frame_count());
        counts.min().unwrap_or(0)
    }
}

/// A tape that is being played.
pub(crate) struct Player {
    tape: Tape,
    frame: usize,
    gauge: StrainGauge,
}

impl Player {
    pub(crate) fn new(tape: Tape) -> Self {
        Self {
            gauge: StrainGauge::new(tape.first().cloth()),
            tape,
            frame: 0,
        }
    }

    pub(crate) fn tape(&self) -> &Tape {
        &self.tape
    }

    /// One frame on, and from the end to the start.
    pub(crate) fn advance(&mut self) {
        self.frame = (self.frame + 1) % self.tape.frame_count();
    }

    /// Goes to `frame`, or to the last.
    pub(crate) fn seek(&mut self, frame: usize) {
        self.frame = frame.min(self.tape.frame_count() - 1);
    }

    pub(crate) fn frame(&self) -> usize {
        self.frame
    }

    /// Positions now `[m]`, `[tracks][vertices]`.
    pub(crate) fn positions(&self) -> Vec<&[Vec3]> {
        let tracks = self.tape.tracks.iter();
        tracks
            .map(|track| track.trajectory.frame(self.frame))
            .collect()
    }

    pub(crate) fn show(&self) -> Show {
        Show::Recording {
            name: self.tape.name.clone(),
            frame: self.frame,
            frames: self.tape.frame_count(),
        }
    }

    pub(crate) fn tracks(&self) -> Vec<Track> {
        let track = |track: &NamedTrack| Track {
            name: track.name.clone(),
            kind: None,
            step_ms: 0.0,
            strain: self.gauge.largest(track.trajectory.frame(self.frame)),
            stopped: None,
        };
        self.tape.tracks.iter().map(track).collect()
    }
}

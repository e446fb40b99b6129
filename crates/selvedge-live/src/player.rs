//! Tapes, and the player of one: one or more recordings of one cloth, with one time line.

use std::sync::Arc;

use glam::Vec3;
use selvedge_data::Trajectory;

use crate::state::{Show, TrackState};
use crate::strain_gauge::StrainGauge;

/// A recording with the name of who made it.
#[derive(Clone, Debug)]
pub struct NamedTrack {
    /// The name of its maker.
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
    /// No recording.
    #[error("there is no recording to play")]
    Empty,
    /// Recordings of several cloths.
    #[error("{first} and {other} are not of one mesh: recordings side by side have the same faces")]
    Cloth {
        /// The name of one.
        first: String,
        /// The name of the other.
        other: String,
    },
    /// Recordings with several clocks, or of cloths cut otherwise.
    #[error(
        "{other} has {found} {what}, but {first} has {expected}: recordings side by side must match, play them one by one"
    )]
    Differ {
        /// The name of one.
        first: String,
        /// The name of the other.
        other: String,
        /// The quantity in which they differ.
        what: String,
        /// The value of the first.
        expected: String,
        /// The value of the other.
        found: String,
    },
}

impl Tape {
    /// Puts recordings of one cloth side by side.
    pub fn new(name: impl Into<String>, tracks: Vec<NamedTrack>) -> Result<Self, TapeError> {
        let first = tracks.first().ok_or(TapeError::Empty)?;
        for other in &tracks {
            check_match(first, other)?;
        }
        Ok(Self {
            name: name.into(),
            tracks,
        })
    }

    /// The first recording, whose handles and rate are shown.
    pub fn first(&self) -> &Trajectory {
        &self.tracks[0].trajectory
    }

    /// Frames of the shortest recording.
    pub fn frame_count(&self) -> usize {
        let counts = self.tracks.iter().map(|t| t.trajectory.frame_count());
        counts.min().unwrap_or(0)
    }
}

/// Checks that two recordings are of one cloth and have one clock.
fn check_match(first: &NamedTrack, other: &NamedTrack) -> Result<(), TapeError> {
    let names = || [first, other].map(|track| track.name.clone());
    let differ = |what: String, [expected, found]: [String; 2]| {
        let [first, other] = names();
        Err(TapeError::Differ {
            first,
            other,
            what,
            expected,
            found,
        })
    };
    let (one, two) = (&*first.trajectory, &*other.trajectory);
    if one.topology() != two.topology() {
        let [first, other] = names();
        return Err(TapeError::Cloth { first, other });
    }
    let rates = [one, two].map(Trajectory::frame_rate);
    if rates[0] != rates[1] {
        let what = "frames per second".to_owned();
        return differ(what, rates.map(|rate| rate.to_string()));
    }
    let [cut, cut_too] = [one, two].map(|track| track.cloth().pattern());
    let seams = [cut, cut_too].map(|cut| cut.points().len());
    if cut.corners() != cut_too.corners() {
        let what = "points of the pattern, sewn otherwise".to_owned();
        return differ(what, seams.map(|points| points.to_string()));
    }
    for (point, (p, q)) in cut.points().iter().zip(cut_too.points()).enumerate() {
        if p != q {
            let vertex = cut.vertices()[point];
            let what = format!("as material coordinates of vertex {vertex}");
            return differ(what, [p, q].map(ToString::to_string));
        }
    }
    Ok(())
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

    /// Goes to the next frame, and from the end to the start.
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

    /// Points of all bodies in the frame that is shown `[m]`.
    pub(crate) fn body_points(&self) -> Vec<Vec3> {
        let tracks = self.tape.first().obstacles().iter();
        tracks
            .flat_map(|track| track.frame(self.frame()).into_owned())
            .collect()
    }

    pub(crate) fn show(&self) -> Show {
        Show::Recording {
            name: self.tape.name.clone(),
            frame: self.frame,
            frames: self.tape.frame_count(),
        }
    }

    pub(crate) fn tracks(&self) -> Vec<TrackState> {
        let track = |track: &NamedTrack| TrackState {
            name: track.name.clone(),
            kind: None,
            step_ms: 0.0,
            strain: self.gauge.largest(track.trajectory.frame(self.frame)),
            stand_in: None,
            stopped: None,
        };
        self.tape.tracks.iter().map(track).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::{CORNERS, cloth};
    use glam::Vec2;
    use selvedge_cloth::Cloth;
    use selvedge_data::Provenance;
    use serde_json::Value;

    fn track(name: &str, cloth: Cloth, frame_rate: f64) -> NamedTrack {
        let provenance = Provenance {
            frame_rate,
            scene: Value::Null,
            made_by: "test".to_owned(),
        };
        let trajectory = Trajectory::new(cloth, CORNERS.to_vec(), provenance).unwrap();
        NamedTrack {
            name: name.to_owned(),
            trajectory: Arc::new(trajectory),
        }
    }

    #[test]
    fn recordings_side_by_side_are_of_one_cloth_and_one_clock() {
        let beside = |other: NamedTrack| Tape::new("both", vec![track("a", cloth(), 60.0), other]);
        let tape = beside(track("b", cloth(), 60.0)).unwrap();
        assert_eq!(tape.tracks.len(), 2);
        let text = |other: NamedTrack| beside(other).unwrap_err().to_string();
        let message = text(track("b", cloth(), 30.0));
        assert!(
            message.starts_with("b has 30 frames per second, but a has 60"),
            "{message}"
        );
        let mut arrays = cloth().arrays().clone();
        arrays.material_coordinates[2] = Vec2::new(0.25, -1.0);
        let (topology, handles) = (cloth().topology().clone(), cloth().handles().clone());
        let cut = Cloth::new(topology, handles, arrays).unwrap();
        let message = text(track("b", cut, 60.0));
        let told = "b has [0.25, -1] as material coordinates of vertex 2, but a has [0, -1]";
        assert!(message.starts_with(told), "{message}");
    }
}

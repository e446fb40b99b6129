//! Tapes, and the player of one: one or more recordings of one cloth, with one time line.

use std::sync::Arc;

use glam::Vec3;
use selvedge_data::Trajectory;

use crate::mover::LiveError;
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
pub struct Replay {
    name: String,
    tracks: Vec<NamedTrack>,
}

impl Replay {
    /// Puts recordings of one cloth side by side.
    pub fn new(name: impl Into<String>, tracks: Vec<NamedTrack>) -> Result<Self, LiveError> {
        let none = || LiveError::new("there is no recording to play");
        let first = tracks.first().ok_or_else(none)?;
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
fn check_match(first: &NamedTrack, other: &NamedTrack) -> Result<(), LiveError> {
    let (one, two) = (&*first.trajectory, &*other.trajectory);
    let [cut, cut_too] = [one, two].map(|track| track.cloth().pattern());
    let differences = [
        ("faces", one.topology() != two.topology()),
        ("frames per second", one.frame_rate() != two.frame_rate()),
        ("seams", cut.corners() != cut_too.corners()),
        ("material coordinates", cut.points() != cut_too.points()),
    ];
    let Some((what, _)) = differences.into_iter().find(|(_, differ)| *differ) else {
        return Ok(());
    };
    Err(LiveError::new(format!(
        "{} and {} have different {what}: recordings side by side must match, play them one by one",
        first.name, other.name
    )))
}

/// A replay that is being played.
pub(crate) struct Player {
    replay: Replay,
    frame: usize,
    gauge: StrainGauge,
}

impl Player {
    pub(crate) fn new(replay: Replay) -> Self {
        Self {
            gauge: StrainGauge::new(replay.first().cloth()),
            replay,
            frame: 0,
        }
    }

    pub(crate) fn replay(&self) -> &Replay {
        &self.replay
    }

    /// Goes to the next frame, and from the end to the start.
    pub(crate) fn advance(&mut self) {
        self.frame = (self.frame + 1) % self.replay.frame_count();
    }

    /// Goes to `frame`, or to the last.
    pub(crate) fn seek(&mut self, frame: usize) {
        self.frame = frame.min(self.replay.frame_count() - 1);
    }

    pub(crate) fn frame(&self) -> usize {
        self.frame
    }

    /// Positions now `[m]`, `[tracks][vertices]`.
    pub(crate) fn positions(&self) -> Vec<&[Vec3]> {
        let tracks = self.replay.tracks.iter();
        tracks
            .map(|track| track.trajectory.frame(self.frame))
            .collect()
    }

    /// Points of all bodies in the frame that is shown `[m]`.
    pub(crate) fn body_points(&self) -> Vec<Vec3> {
        let tracks = self.replay.first().obstacles().iter();
        tracks
            .flat_map(|track| track.frame(self.frame()).into_owned())
            .collect()
    }

    pub(crate) fn show(&self) -> Show {
        Show::Recording {
            name: self.replay.name.clone(),
            frame: self.frame,
            frames: self.replay.frame_count(),
        }
    }

    pub(crate) fn tracks(&self) -> Vec<TrackState> {
        let track = |track: &NamedTrack| TrackState {
            name: track.name.clone(),
            kind: None,
            step_ms: 0.0,
            strain: self.gauge.largest(track.trajectory.frame(self.frame)),
            drape: self.gauge.drape(track.trajectory.frame(self.frame)),
            stand_in: None,
            stopped: None,
        };
        self.replay.tracks.iter().map(track).collect()
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
        let beside =
            |other: NamedTrack| Replay::new("both", vec![track("a", cloth(), 60.0), other]);
        let replay = beside(track("b", cloth(), 60.0)).unwrap();
        assert_eq!(replay.tracks.len(), 2);
        let mut arrays = cloth().arrays().clone();
        arrays.material_coordinates[2] = Vec2::new(0.25, -1.0);
        let (topology, handles) = (cloth().topology().clone(), cloth().handles().clone());
        let cut = Cloth::new(topology, handles, arrays).unwrap();
        for (other, what) in [
            (track("b", cloth(), 30.0), "frames per second"),
            (track("b", cut, 60.0), "material coordinates"),
        ] {
            let text = beside(other).unwrap_err().to_string();
            let expected = format!("a and b have different {what}:");
            assert!(text.starts_with(&expected), "{text}");
        }
    }
}

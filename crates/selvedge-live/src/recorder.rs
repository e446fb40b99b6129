//! Recording what is shown: frames are kept in memory, up to a bound, and written as trajectories.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_data::Trajectory;

use crate::order::{Hold, MoverKind};
use crate::player::{NamedTrack, Tape};
use crate::stage::Stage;
use crate::state::RecordingState;

/// A recording ends by itself here `[bytes]`.
const MOST_BYTES: usize = 512 << 20;

/// Where the handles were is written into the header of its file, as text, and no reader takes a header
/// of more than 100,000,000 bytes; what else stands there has room beside this `[bytes]`.
const MOST_HEADER_BYTES: usize = 90_000_000;
/// A place of a handle there: three numbers of at most 24 characters, their brackets and commas `[bytes]`.
const PLACE_BYTES: usize = 80;

/// A recording under way.
pub(crate) struct Recorder {
    hold: Hold,
    tracks: Vec<(MoverKind, String, Vec<Vec3>)>,
    frames: usize,
    most: usize,
}

impl Recorder {
    /// Begins with the frame that is shown.
    pub(crate) fn new(stage: &Stage) -> Self {
        let positions = stage.positions();
        let of_frame: usize = positions.iter().map(|track| size_of_val(*track)).sum();
        let tracks = stage.tracks().into_iter().zip(stage.mover().kinds());
        let mut recorder = Self {
            hold: stage.hold().clone(),
            tracks: tracks
                .map(|(track, kind)| (*kind, track.name, Vec::new()))
                .collect(),
            frames: 0,
            most: most_frames(of_frame, stage.hold().handles.len()),
        };
        recorder.keep(stage);
        recorder
    }

    /// Keeps the frame that is shown.
    pub(crate) fn keep(&mut self, stage: &Stage) {
        for ((_, _, kept), now) in self.tracks.iter_mut().zip(stage.positions()) {
            kept.extend_from_slice(now);
        }
        self.frames += 1;
    }

    pub(crate) fn is_full(&self) -> bool {
        self.frames >= self.most
    }

    pub(crate) fn state(&self) -> RecordingState {
        RecordingState {
            frames: self.frames,
            most: self.most,
        }
    }

    /// What was kept, as trajectories of the cloth of `stage`.
    pub(crate) fn finish(self, stage: &Stage) -> Result<Vec<(MoverKind, NamedTrack)>, String> {
        let bench = stage.bench();
        let cloth = bench.cloth().clone();
        let cloth = cloth
            .with_handles(self.hold.handles.clone())
            .map_err(|error| format!("the recording: {error}"))?;
        let vertices = cloth.vertex_count();
        let mut finished = Vec::new();
        for (kind, name, positions) in self.tracks {
            let handles = positions.chunks_exact(vertices);
            let handles = handles.map(|frame| selected(&self.hold, frame)).collect();
            let provenance = bench.provenance(&self.hold, handles)?;
            let trajectory = Trajectory::new(cloth.clone(), positions, provenance)
                .map_err(|error| format!("the recording: {error}"))?;
            let trajectory = Arc::new(trajectory);
            finished.push((kind, NamedTrack { name, trajectory }));
        }
        Ok(finished)
    }
}

/// Frames of so many bytes, with so many handles, that can be kept and read again.
fn most_frames(of_frame: usize, handles: usize) -> usize {
    let kept = MOST_BYTES / of_frame.max(1);
    let readable = MOST_HEADER_BYTES / (PLACE_BYTES * handles.max(1));
    kept.min(readable).max(1)
}

fn selected(hold: &Hold, frame: &[Vec3]) -> Vec<DVec3> {
    let positions = hold.handles.select(frame);
    positions.iter().map(|p| p.as_dvec3()).collect()
}

/// Writes the tracks of a recording into `folder`, under the first number that is free. Gives the tape
/// and the files.
pub(crate) fn write(
    tracks: Vec<(MoverKind, NamedTrack)>,
    folder: &Path,
) -> Result<(Tape, Vec<PathBuf>), String> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("{}: the folder cannot be made: {error}", folder.display()))?;
    let path = |number: u32, kind: &MoverKind| {
        let kind = match kind {
            MoverKind::Model => "model",
            MoverKind::Physics => "physics",
        };
        folder.join(format!("recording-{number}-{kind}.safetensors"))
    };
    let is_free = |number: &u32| {
        let kinds = [MoverKind::Model, MoverKind::Physics];
        kinds.iter().all(|kind| !path(*number, kind).exists())
    };
    let number = (1..=u32::MAX).find(is_free).unwrap_or(u32::MAX);
    let mut files = Vec::new();
    for (kind, track) in &tracks {
        let file = path(number, kind);
        let written = track.trajectory.write(&file);
        written.map_err(|error| format!("{}: {error}", file.display()))?;
        files.push(file);
    }
    let tracks = tracks.into_iter().map(|(_, track)| track).collect();
    let tape = Tape::new(format!("recording {number}"), tracks);
    Ok((tape.map_err(|error| error.to_string())?, files))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_ends_before_its_header_is_too_long_to_be_read() {
        // No f32 has more digits as an f64, nor a longer exponent.
        let place = Vec3::splat(-f32::MIN_POSITIVE).as_dvec3();
        for handles in [1, 2, 256] {
            let most = most_frames(1, handles);
            // A hundredth of it; the rest is as long.
            let frames = vec![vec![place; handles]; most / 100];
            let text = serde_json::to_string(&frames).unwrap();
            assert!(100 * text.len() <= MOST_HEADER_BYTES, "{handles} handles");
        }
        // Without handles, and with few, memory is the bound.
        assert_eq!(most_frames(MOST_BYTES / 7, 0), 7);
        assert_eq!(most_frames(MOST_BYTES / 7, 2), 7);
    }
}

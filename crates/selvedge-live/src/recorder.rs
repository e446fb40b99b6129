//! Recordings: frames of the shown cloth are kept in memory, up to a bound, and written as
//! trajectories.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_data::export;
use selvedge_data::{ObstacleTrack, Trajectory};

use crate::body::{Body, BodyKind};
use crate::live_cloth::LiveCloth;
use crate::mover::{Influences, MoverKind, Reason};
use crate::player::{NamedTrack, Replay};
use crate::state::RecordingState;

/// A recording ends by itself here `[bytes]`.
const MOST_BYTES: usize = 512 << 20;

/// The places of the handles in the header of a file, at most `[bytes]`. They stand there as text,
/// and no reader takes a header of more than 100,000,000 bytes; the rest of the header has room
/// beside this.
const MOST_HEADER_BYTES: usize = 90_000_000;
/// One such place: three numbers of at most 24 characters, with brackets and commas `[bytes]`.
const PLACE_BYTES: usize = 80;

/// A recording under way.
pub(crate) struct Recorder {
    influences: Influences,
    tracks: Vec<KeptTrack>,
    /// Points of all bodies, `[frames][points of all bodies]` `[m]`.
    bodies: Vec<Vec<Vec3>>,
    /// Frames at most.
    most: usize,
}

/// The kept frames of one mover.
struct KeptTrack {
    kind: MoverKind,
    name: String,
    /// `[frames * vertices]` `[m]`.
    positions: Vec<Vec3>,
}

/// The place for recordings.
pub(crate) enum Destination {
    /// A folder: trajectories, under the first number that is free.
    Folder(PathBuf),
    /// The page, which saves them where it saves downloads: .glb files.
    Page {
        /// Recordings so far.
        number: u32,
        /// Files that the page has not got yet: their names and contents.
        files: Vec<(String, Vec<u8>)>,
    },
}

/// A recording that is written.
pub(crate) struct WrittenRecording {
    pub(crate) replay: Replay,
    pub(crate) files: Vec<PathBuf>,
}

impl Recorder {
    /// Begins with the frame that is shown.
    pub(crate) fn new(live: &LiveCloth) -> Self {
        let positions = live.positions();
        let of_cloths: usize = positions.iter().map(|track| size_of_val(*track)).sum();
        let of_frame = of_cloths + size_of_val(&live.body_points()[..]);
        let tracks = live.tracks().into_iter().zip(live.mover().kinds());
        let mut recorder = Self {
            influences: live.influences().clone(),
            tracks: tracks
                .map(|(track, &kind)| KeptTrack {
                    kind,
                    name: track.name,
                    positions: Vec::new(),
                })
                .collect(),
            bodies: Vec::new(),
            most: most_frames(of_frame, live.influences().handles.len()),
        };
        recorder.keep(live);
        recorder
    }

    /// Keeps the frame that is shown.
    pub(crate) fn keep(&mut self, live: &LiveCloth) {
        for (track, now) in self.tracks.iter_mut().zip(live.positions()) {
            track.positions.extend_from_slice(now);
        }
        self.bodies.push(live.body_points());
    }

    pub(crate) fn is_full(&self) -> bool {
        self.bodies.len() >= self.most
    }

    pub(crate) fn state(&self) -> RecordingState {
        RecordingState {
            frames: self.bodies.len(),
            most: self.most,
        }
    }

    /// Returns the kept frames as trajectories of `live`, one per mover.
    pub(crate) fn finish(self, live: &LiveCloth) -> Result<Vec<(MoverKind, NamedTrack)>, Reason> {
        let ready = live.ready();
        let cloth = (*ready.cloth).clone();
        let cloth = cloth.with_handles(self.influences.handles.clone());
        let cloth = cloth.map_err(|error| of_recording(&error))?;
        let vertices = cloth.vertex_count();
        let bodies = bodies(&ready.bodies, &self.bodies);
        let mut finished = Vec::new();
        for track in self.tracks {
            let frames = track.positions.chunks_exact(vertices);
            let places = |frame: &[Vec3]| -> Vec<DVec3> {
                let handles = self.influences.handles.of(frame);
                handles.map(|p| p.as_dvec3()).collect()
            };
            let handles = frames.map(places).collect();
            let provenance = ready.movers.provenance(&self.influences, handles)?;
            let trajectory = Trajectory::new(cloth.clone(), track.positions, provenance)
                .and_then(|trajectory| trajectory.with_obstacles(bodies.clone()))
                .map_err(|error| of_recording(&error))?;
            let named = NamedTrack {
                name: track.name,
                trajectory: Arc::new(trajectory),
            };
            finished.push((track.kind, named));
        }
        Ok(finished)
    }
}

/// The tracks of bodies whose points, of one after the other, are at `frames` `[m]`. None where the
/// cloth that leads does not see them, and none of a ball that was not thrown.
fn bodies(bodies: &[Body], frames: &[Vec<Vec3>]) -> Vec<ObstacleTrack> {
    if frames.iter().any(Vec::is_empty) {
        return Vec::new();
    }
    let ends = bodies.iter().scan(0, |end, body| {
        let first = *end;
        *end += body.points;
        Some(first..*end)
    });
    let tracks = bodies.iter().zip(ends);
    tracks
        .map(|(body, range)| {
            let points = frames.iter().map(|frame| frame[range.clone()].to_vec());
            let (name, faces) = (body.name.clone(), body.faces.clone());
            let track = ObstacleTrack::of_frames(name, faces, points.collect());
            (body.kind, track)
        })
        .filter(|(kind, track)| *kind != BodyKind::Ball || !track.is_still())
        .map(|(_, track)| track)
        .collect()
}

/// Frames of so many bytes, with so many handles, that can be kept and read again.
fn most_frames(of_frame: usize, handles: usize) -> usize {
    let kept = MOST_BYTES / of_frame.max(1);
    let readable = MOST_HEADER_BYTES / (PLACE_BYTES * handles.max(1));
    kept.min(readable).max(1)
}

impl Destination {
    /// Writes the tracks of a recording.
    pub(crate) fn write(
        &mut self,
        tracks: Vec<(MoverKind, NamedTrack)>,
    ) -> Result<WrittenRecording, Reason> {
        let number = self.next_number()?;
        let mut written = Vec::new();
        for (kind, track) in &tracks {
            written.push(match self {
                Self::Folder(folder) => {
                    let file = folder.join(name(number, *kind, "safetensors"));
                    let outcome = track.trajectory.write(&file);
                    outcome.map_err(|cause| format!("{}: {cause}", file.display()))?;
                    file
                }
                Self::Page { files, .. } => {
                    let contents = export::glb(&track.trajectory);
                    let contents = contents.map_err(|error| of_recording(&error))?;
                    let file = name(number, *kind, "glb");
                    files.push((file.clone(), contents));
                    file.into()
                }
            });
        }
        let tracks = tracks.into_iter().map(|(_, track)| track).collect();
        Ok(WrittenRecording {
            replay: Replay::new(format!("recording {number}"), tracks)?,
            files: written,
        })
    }

    /// The number of the next recording; in a folder, which is made where it is missing, the first
    /// that is free.
    fn next_number(&mut self) -> Result<u32, Reason> {
        let folder = match self {
            Self::Folder(folder) => folder,
            Self::Page { number, .. } => {
                *number += 1;
                return Ok(*number);
            }
        };
        std::fs::create_dir_all(&*folder).map_err(|cause| {
            let folder = folder.display();
            format!("{folder}: the folder cannot be made: {cause}")
        })?;
        let is_free = |number: &u32| {
            let kinds = [MoverKind::Model, MoverKind::Physics];
            let mut names = kinds
                .map(|kind| name(*number, kind, "safetensors"))
                .into_iter();
            names.all(|name| !folder.join(name).exists())
        };
        Ok((1..=u32::MAX).find(is_free).unwrap_or(u32::MAX))
    }
}

/// The reason why there is no recording.
fn of_recording(error: &dyn std::error::Error) -> Reason {
    format!("the recording: {error}").into()
}

fn name(number: u32, kind: MoverKind, ending: &str) -> String {
    let kind = match kind {
        MoverKind::Model => "model",
        MoverKind::Physics => "physics",
    };
    format!("recording-{number}-{kind}.{ending}")
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

//! Bodies: the obstacles of a cloth as a page draws them and a hand leads them.

use selvedge_data::Trajectory;

/// A body beside the cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name, for people.
    pub name: String,
    /// Its part on a page.
    pub kind: BodyKind,
    /// Number of its points.
    pub points: usize,
    /// Corners of its faces, numbered among its own points.
    pub faces: Vec<[u32; 3]>,
}

/// Part of a body on a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// A body that is drawn and may be led.
    Thing = 0,
    /// The ground: drawn as the floor of the room, and not led.
    Floor = 1,
    /// The ball that can be thrown.
    Ball = 2,
}

impl Body {
    /// The bodies of a recording.
    pub(crate) fn of_recording(trajectory: &Trajectory) -> Vec<Self> {
        let tracks = trajectory.obstacles().iter();
        tracks
            .map(|track| Self {
                name: track.name().to_owned(),
                kind: kind_of(track.faces(), &track.frame(0)),
                points: track.point_count(),
                faces: track.faces().to_vec(),
            })
            .collect()
    }
}

/// The kind of a body of these faces and points `[m]`: a level plane of two faces is the floor.
pub fn kind_of(faces: &[[u32; 3]], points: &[glam::Vec3]) -> BodyKind {
    let heights = points.iter().map(|p| p.y);
    let low = heights.clone().fold(f32::INFINITY, f32::min);
    let high = heights.fold(f32::NEG_INFINITY, f32::max);
    if faces.len() == 2 && high - low < 1e-4 { BodyKind::Floor } else { BodyKind::Thing }
}

//! Readers of bodies and of their points over time. Every file is read whole and checked.

mod sequence;

use std::path::Path;

use glam::DVec3;
use selvedge_assets::BODIES;
use selvedge_cloth::bodies::Body;

use super::error::Problem;
use crate::formats::hash::hash;
use crate::formats::input::read_file;
use crate::formats::npz::NpzPoints;
use crate::formats::obj::parse_obj_polygons;
use crate::formats::pc2;
use crate::formats::polygons::triangles_in_space;
use crate::formats::retired::retired;
use crate::rig::{RigFormat, read_body};

pub(super) use self::sequence::Sequence;

/// The bytes of the shipped body of this name.
pub(super) fn shipped(name: &str) -> Option<&'static [u8]> {
    BODIES.iter().find(|body| body.0 == name).map(|b| b.1)
}

/// The kinds of files that have points of bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Obj,
    /// With nodes and meshes.
    Rig(RigFormat),
    Pc2,
    Npz,
}

impl Kind {
    /// The kind of the file of this name.
    pub(super) fn of(path: &str) -> Option<Self> {
        if shipped(path).is_some() {
            return Some(Self::Rig(RigFormat::Glb));
        }
        let ending = Path::new(path).extension()?.to_str()?;
        match ending.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "pc2" => Some(Self::Pc2),
            "npz" => Some(Self::Npz),
            other => RigFormat::of(other).map(Self::Rig),
        }
    }
}

/// The bytes of a file or of a shipped body, for `field`.
pub(super) fn bytes_of(field: &'static str, path: &str, folder: &Path) -> Result<Vec<u8>, Problem> {
    if let Some(bytes) = shipped(path) {
        return Ok(bytes.to_vec());
    }
    read_file(&folder.join(path)).map_err(|error| {
        let names: Vec<&str> = BODIES.iter().map(|body| body.0).collect();
        let problem = match Kind::of(path) {
            Some(_) => format!("{path} could not be read: {error}"),
            None => format!(
                "{path} is neither a shipped body ({}) nor a file that can be read: {error}",
                names.join(", ")
            ),
        };
        Problem::Field(field, problem)
    })
}

/// The bytes of a file, which must have this hash.
pub(super) fn unchanged(
    field: &'static str,
    path: &str,
    expected: &str,
    folder: &Path,
) -> Result<Vec<u8>, Problem> {
    let bytes = bytes_of(field, path, folder)?;
    let found = hash(&bytes);
    if found == expected {
        return Ok(bytes);
    }
    Err(Problem::Changed {
        field,
        path: path.to_owned(),
        expected: expected.to_owned(),
        found,
    })
}

/// The mesh in the bytes of the file at `path`, as it stands at the start.
pub(super) fn mesh(path: &str, bytes: &[u8]) -> Result<Body, Problem> {
    let wrong = |problem: String| Problem::Field("mesh", format!("{path}: {problem}"));
    let (points, polygons) = match Kind::of(path) {
        Some(Kind::Obj) => {
            let read = parse_obj_polygons(bytes).map_err(|error| wrong(error.to_string()))?;
            let corners = |p: &crate::formats::polygons::Polygon| {
                p.corners.iter().map(|corner| corner.vertex).collect()
            };
            let polygons: Vec<Vec<u32>> = read.polygons.iter().map(corners).collect();
            (read.positions, polygons)
        }
        Some(Kind::Rig(format)) => {
            let body = read_body(bytes, format, None, true);
            let body = body.map_err(|error| wrong(error.to_string()))?;
            let faces = body.faces().map_err(|error| wrong(error.to_string()))?;
            (body.positions(0.0), faces)
        }
        _ => {
            let known = "must end in .obj, .glb, .usda, .usdc or .usdz";
            return Err(wrong(retired(Path::new(path)).unwrap_or(known).to_owned()));
        }
    };
    let mut faces = Vec::with_capacity(2 * polygons.len());
    for (number, corners) in polygons.iter().enumerate() {
        let beyond = corners.iter().find(|&&c| c as usize >= points.len());
        if let Some(beyond) = beyond {
            let problem = format!("face {number} names point {beyond} of {}", points.len());
            return Err(wrong(problem));
        }
        let places: Vec<DVec3> = corners.iter().map(|&c| points[c as usize]).collect();
        let triangles = triangles_in_space(&places).ok_or_else(|| {
            wrong(format!(
                "face {number}, of {} corners, crosses itself or has no area: cut it into triangles",
                corners.len()
            ))
        })?;
        faces.extend(triangles.iter().map(|t| t.map(|k| corners[k])));
    }
    Ok(Body { points, faces })
}

/// Points over time, as a file of any kind but .obj has them.
pub(super) struct Moving<'a> {
    /// Path of the file, for messages and for its kind.
    pub(super) path: &'a str,
    pub(super) bytes: &'a [u8],
    /// Name of the animation, of a .glb that has several.
    pub(super) animation: Option<&'a str>,
    /// Seconds after the first key at which the motion begins.
    pub(super) from: f64,
    /// Frames per second of what has no times of its own; of the scene for what has.
    pub(super) rate: f64,
}

/// Frames per second, and the points in every frame.
pub(crate) type Frames = (f64, Vec<Vec<DVec3>>);

/// The points in a file of any kind but .obj, and their frames per second: `rate` for what has
/// times of its own or says none.
///
/// # Errors
/// The defect, as a sentence.
pub(crate) fn moving_points(path: &str, bytes: &[u8], rate: f64) -> Result<Frames, String> {
    let moving = Moving {
        path,
        bytes,
        animation: None,
        from: 0.0,
        rate,
    };
    moving.frames().map_err(|problem| match problem {
        Problem::Field(_, text) => {
            let own = text
                .strip_prefix(path)
                .and_then(|rest| rest.strip_prefix(": "));
            own.unwrap_or(&text).to_owned()
        }
        Problem::Changed { .. } => "was changed while it was read".to_owned(),
    })
}

impl Moving<'_> {
    /// The points in every frame.
    pub(super) fn frames(&self) -> Result<Frames, Problem> {
        let wrong = |problem: String| Problem::Field("motion", format!("{}: {problem}", self.path));
        let kind = Kind::of(self.path);
        if self.animation.is_some() && kind != Some(Kind::Rig(RigFormat::Glb)) {
            return Err(wrong("only a .glb has animations with names".to_owned()));
        }
        let (rate, mut frames) = match kind {
            Some(Kind::Rig(format)) => {
                let body = read_body(self.bytes, format, self.animation, false);
                let body = body.map_err(|error| wrong(error.to_string()))?;
                if body.span().is_none() {
                    let problem = "nothing in it moves: leave motion out, or animate it";
                    return Err(wrong(problem.to_owned()));
                }
                let frames = body.frames(self.rate, self.from);
                return Ok((self.rate, frames.map_err(|error| wrong(error.to_string()))?));
            }
            Some(Kind::Pc2) => {
                let cache = pc2::parse(self.bytes).map_err(wrong)?;
                (self.rate / cache.every, cache.frames)
            }
            Some(Kind::Npz) => {
                let read = NpzPoints::read(self.bytes);
                let read = read.map_err(|error| wrong(error.to_string()))?;
                (read.frame_rate.unwrap_or(self.rate), read.frames)
            }
            Some(Kind::Obj) | None => {
                let known = "must end in .obj (with {frame} in its name), .pc2, .npz, .usda, .usdc, .usdz or .glb";
                return Err(wrong(
                    retired(Path::new(self.path)).unwrap_or(known).to_owned(),
                ));
            }
        };
        let skipped = (self.from * rate).round() as usize;
        if skipped >= frames.len() {
            let problem = format!(
                "from is after its end, at {:.3} s",
                frames.len().saturating_sub(1) as f64 / rate
            );
            return Err(wrong(problem));
        }
        frames.drain(..skipped);
        Ok((rate, frames))
    }
}

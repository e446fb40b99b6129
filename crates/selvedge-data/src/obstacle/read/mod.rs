//! Readers of bodies and of their points over time. Every file is read whole and checked.

use std::fmt::Display;
use std::path::Path;

use glam::DVec3;
use selvedge_assets::BODIES;
use selvedge_cloth::bodies::Body;

use crate::formats::input::{check_hash, ending_of, hash, read_file};
use crate::formats::npz::NpzPoints;
use crate::formats::obj::parse_obj_polygons;
use crate::formats::pc2;
use crate::formats::polygons::triangles_of_body;
use crate::rig::{Rig, RigError, RigFormat, Wanted};

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
        match ending_of(Path::new(path)).as_str() {
            "obj" => Some(Self::Obj),
            "pc2" => Some(Self::Pc2),
            "npz" => Some(Self::Npz),
            other => RigFormat::of(other).map(Self::Rig),
        }
    }
}

/// The bytes of a file or of a shipped body, for `field`.
pub(super) fn bytes_of(field: &str, path: &str, folder: &Path) -> Result<Vec<u8>, String> {
    if let Some(bytes) = shipped(path) {
        return Ok(bytes.to_vec());
    }
    read_file(&folder.join(path)).map_err(|error| {
        let names: Vec<&str> = BODIES.iter().map(|body| body.0).collect();
        match Kind::of(path) {
            Some(_) => format!("{field}: {path} could not be read: {error}"),
            None => format!(
                "{field}: {path} is neither a shipped body ({}) nor a file that can be read: {error}",
                names.join(", ")
            ),
        }
    })
}

/// The bytes of a file, which must have this hash.
pub(super) fn unchanged(
    field: &str,
    path: &str,
    expected: &str,
    folder: &Path,
) -> Result<Vec<u8>, String> {
    let bytes = bytes_of(field, path, folder)?;
    let checked = check_hash(path, expected, &hash(&bytes));
    checked.map_err(|problem| format!("{field}: {problem}"))?;
    Ok(bytes)
}

/// The mesh in the bytes of the file at `path`, as it stands at the start; what is left out is said
/// in `warnings`.
pub(super) fn mesh(path: &str, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Body, String> {
    let wrong = |problem: &dyn Display| format!("mesh: {path}: {problem}");
    let (points, polygons) = match Kind::of(path) {
        Some(Kind::Obj) => {
            let read = parse_obj_polygons(bytes).map_err(|error| wrong(&error))?;
            (read.positions, read.polygons)
        }
        Some(Kind::Rig(format)) => {
            let rig = Rig::parse(bytes, format, Wanted::Still).map_err(|error| wrong(&error))?;
            let read = rig.polygons().map_err(|error| wrong(&error))?;
            let left = read.warnings.into_iter();
            warnings.extend(left.map(|left| format!("{path}: {left}")));
            (rig.positions(0.0), read.polygons)
        }
        _ => {
            let known = "must end in .obj, .glb, .usda, .usdc, .usdz or .usd: export the mesh as one of them";
            return Err(wrong(&known));
        }
    };
    let mut faces = Vec::with_capacity(2 * polygons.len());
    for polygon in &polygons {
        let corners: Vec<u32> = polygon.vertices().collect();
        let places: Vec<DVec3> = corners.iter().map(|&c| points[c as usize]).collect();
        let triangles = triangles_of_body(&places);
        faces.extend(triangles.iter().map(|t| t.map(|k| corners[k])));
    }
    Ok(Body::of(points, faces))
}

/// A warning where the file at `path`, of which the scene takes no motion, has one. A shipped body
/// is known to.
pub(super) fn own_motion(path: &str, bytes: &[u8]) -> Option<String> {
    let Some(Kind::Rig(format)) = Kind::of(path).filter(|_| shipped(path).is_none()) else {
        return None;
    };
    let (moves, key) = match Rig::parse(bytes, format, Wanted::Motion(None)) {
        Ok(rig) => {
            let [first, last] = rig.span_of_meshes()?;
            let moves = format!("moves from {first:.3} s to {last:.3} s");
            (moves, format!("motion = {path:?}"))
        }
        Err(RigError::Animations { known }) => (
            format!("has the animations [{known}]"),
            "motion = { animation = \"…\" }".to_owned(),
        ),
        // What is wrong with the body is said where it is read.
        Err(_) => return None,
    };
    Some(format!(
        "{path}: it {moves}, but the obstacle stands still: {key} plays it"
    ))
}

/// Frames per second, and the points in every frame.
pub(super) type Frames = (f64, Vec<Vec<DVec3>>);

/// The points in a file of any kind but .obj, from `from` `[s]` after its start on, and their
/// frames per second: `rate` for what has times of its own or says none. Of a .glb with several
/// animations one is named.
pub(super) fn moving_points(
    path: &str,
    bytes: &[u8],
    animation: Option<&str>,
    from: f64,
    rate: f64,
) -> Result<Frames, String> {
    let kind = Kind::of(path);
    if animation.is_some() && kind != Some(Kind::Rig(RigFormat::Glb)) {
        return Err("only a .glb has animations with names".to_owned());
    }
    let (rate, mut frames) = match kind {
        Some(Kind::Rig(format)) => {
            let rig = Rig::parse(bytes, format, Wanted::Motion(animation));
            let rig = rig.map_err(|error| error.to_string())?;
            return Ok((rate, rig_frames(&rig, from, rate)?));
        }
        Some(Kind::Pc2) => {
            let cache = pc2::parse(bytes)?;
            (rate / cache.every, cache.frames)
        }
        Some(Kind::Npz) => {
            let read = NpzPoints::read(bytes).map_err(|error| error.to_string())?;
            (read.frame_rate.unwrap_or(rate), read.frames)
        }
        Some(Kind::Obj) | None => {
            let known = "must end in .pc2, .npz, .usda, .usdc, .usdz, .usd or .glb";
            return Err(known.to_owned());
        }
    };
    let skipped = (from * rate).round() as usize;
    if skipped >= frames.len() {
        let end = frames.len().saturating_sub(1) as f64 / rate;
        return Err(format!("from is after its end, at {end:.3} s"));
    }
    Ok((rate, frames.split_off(skipped)))
}

/// The points of a rig's meshes from `from` `[s]` after its start on, `rate` frames a second.
fn rig_frames(rig: &Rig, from: f64, rate: f64) -> Result<Vec<Vec<DVec3>>, String> {
    if rig.span_of_meshes().is_none() {
        let problem = ["nothing in it moves: leave motion out, or animate it".to_owned()];
        return Err([&problem, &rig.warnings[..]].concat().join("; "));
    }
    rig.frames(rate, from).map_err(|error| error.to_string())
}

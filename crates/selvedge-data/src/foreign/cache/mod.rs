//! Caches of other programs, a file per trajectory: .usda, .usdc, .usdz and .glb have the
//! mesh and its points over time; .pc2 and .npz have the points, and the mesh is the .obj of
//! the same name beside them.
//!
//! A file has one cloth: the mesh that is named, its only one, or the one called `sheet`, as our
//! exports call it. Faces are cut into triangles as they are in the first frame. Texture
//! coordinates are the material coordinates `[m]`, one per vertex. Frames are taken at the rate
//! that is asked for, linearly between those of the file.

mod handles;

use std::path::Path;

use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::assemble::{TrajectoryParts, Weight, hanging};
use super::options::{ImportOptions, RestSource, describe_file};
use crate::UpAxis;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::read_file;
use crate::formats::obj::{parse_obj_polygons, read_obj, read_obj_positions};
use crate::formats::polygons::{Polygons, triangles_in_space};
use crate::obstacle::moving_points;
use crate::rig::RigFormat;
use crate::rig::mesh::polygons;

/// Endings of caches that are read.
const WITH_MESH: [&str; 5] = ["usda", "usdc", "usdz", "usd", "glb"];
const POINTS_ONLY: [&str; 2] = ["pc2", "npz"];

/// The cloth among several meshes.
const SHEET: &str = "sheet";

/// Largest difference of texture coordinates of a vertex that are taken for one `[m]`.
const SAME: f64 = 1e-6;

fn ending_of(path: &Path) -> &str {
    path.extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default()
}

/// True for a file that is a cache.
pub(super) fn is_cache(path: &Path) -> bool {
    let ending = ending_of(path);
    WITH_MESH.contains(&ending) || POINTS_ONLY.contains(&ending)
}

impl ImportOptions {
    /// Checks what must be positive.
    pub(super) fn check(&self) -> Result<(), String> {
        let numbers = [("density", self.density), ("frame_rate", self.frame_rate)];
        let bad = numbers.iter().find(|(_, n)| !(n.is_finite() && *n > 0.0));
        match bad {
            None => Ok(()),
            Some((option, found)) => Err(format!(
                "{option} must be finite and positive, found {found}"
            )),
        }
    }

    /// The resolved options.
    pub(super) fn describe(&self) -> Result<Value, FileError<Problem>> {
        let mut import = json!({
            "format": "cache",
            "density": self.density,
            "frame_rate": self.frame_rate,
            "handles": self.handles.describe(),
            "rest": self.rest.describe()?,
            "up": self.up,
        });
        if let Some(object) = &self.object {
            import["object"] = json!(object);
        }
        if let Some(flat) = &self.flat {
            import["flat"] = describe_file(flat)?;
        }
        Ok(import)
    }

    pub(super) fn read(&self, path: &Path) -> Result<TrajectoryParts, FileError<Problem>> {
        let layout = |problem: String| FileError::new(path, problem);
        let bytes = read_file(path).map_err(FileError::unread(path))?;
        let format = RigFormat::of(ending_of(path));
        let mesh = mesh_of(path, &bytes, format)?;
        let name = path.to_string_lossy();
        let (rate, frames) =
            moving_points(&name, &bytes, None, 0.0, self.frame_rate).map_err(layout)?;
        let points = mesh.positions.len();
        if let Some(found) = frames.iter().map(Vec::len).find(|&found| found != points) {
            return Err(layout(format!(
                "has frames of {found} points, and a mesh of {points}"
            )));
        }
        let span = cloth_of(&mesh, self.object.as_deref()).map_err(layout)?;
        // USD and glTF say which axis is up.
        let up = match format {
            Some(RigFormat::Usd | RigFormat::Glb) => UpAxis::Y,
            _ => self.up,
        };
        let faces = triangles(&mesh, span).map_err(layout)?;
        let held = handles::held(&self.handles, &bytes, format, span);
        let handles = held.map_err(layout)?;
        let own = |frame: &Vec<DVec3>| {
            let own = frame[span[0]..span[1]].iter();
            own.map(|&p| up.to_ours(p)).collect()
        };
        let frames = at_rate(&frames, rate, self.frame_rate);
        let frames: Vec<Vec<DVec3>> = frames.iter().map(own).collect();
        let material = self.material(&mesh, span).map_err(layout)?;
        Ok(TrajectoryParts {
            made_by: "imported from a cache".to_owned(),
            faces,
            rest: self.rest(path, &material, &frames)?,
            material,
            positions: frames.concat(),
            handles,
            weight: Weight::Density(self.density),
            frame_rate: self.frame_rate,
        })
    }

    /// The rest pose of the cloth in the file at `path`.
    fn rest(
        &self,
        path: &Path,
        material: &[DVec2],
        frames: &[Vec<DVec3>],
    ) -> Result<Vec<DVec3>, FileError<Problem>> {
        let rest = match &self.rest {
            RestSource::Flat => hanging(material),
            RestSource::FirstFrame => frames.first().cloned().unwrap_or_default(),
            RestSource::Obj(file) => {
                read_obj_positions(file).map_err(|error| FileError::new(file, error))?
            }
        };
        if rest.len() == material.len() {
            return Ok(rest);
        }
        Err(FileError::new(
            path,
            other_count("the rest pose", rest.len(), material.len()),
        ))
    }

    /// Material coordinates of the cloth: of the flat mesh, or the texture coordinates.
    fn material(&self, mesh: &Polygons, span: [usize; 2]) -> Result<Vec<DVec2>, String> {
        let [start, end] = span;
        if let Some(flat) = &self.flat {
            let sheet = read_obj(flat).map_err(|error| error.to_string())?;
            let material = sheet.mesh.material_coordinates().to_vec();
            if material.len() == end - start {
                return Ok(material);
            }
            return Err(other_count("the flat mesh", material.len(), end - start));
        }
        let mut material: Vec<Option<DVec2>> = vec![None; end - start];
        for corner in mesh.polygons.iter().flat_map(|polygon| &polygon.corners) {
            let Some(own) = (corner.vertex as usize).checked_sub(start) else {
                continue;
            };
            let (Some(known), Some(texture)) = (material.get_mut(own), corner.texture) else {
                continue;
            };
            let found = mesh.texture[texture];
            if known.is_some_and(|known| known.distance(found) > SAME) {
                return Err(format!(
                    "has a seam at vertex {own}, where it has two texture coordinates: name a flat mesh of the same vertices (option `flat`)"
                ));
            }
            *known = Some(found);
        }
        match material.into_iter().collect::<Option<Vec<DVec2>>>() {
            Some(material) => Ok(material),
            None => Err(
                "has no texture coordinates, which are the flat, unstrained cloth in metres: name a flat mesh of the same vertices (option `flat`)"
                    .to_owned(),
            ),
        }
    }
}

fn other_count(what: &str, found: usize, expected: usize) -> String {
    format!("{what} is for {found} vertices, but there are {expected}")
}

/// The meshes of a file, or of the .obj beside it.
fn mesh_of(
    path: &Path,
    bytes: &[u8],
    format: Option<RigFormat>,
) -> Result<Polygons, FileError<Problem>> {
    if let Some(format) = format {
        return polygons(bytes, format).map_err(|error| FileError::new(path, error));
    }
    let beside = path.with_extension("obj");
    let text = read_file(&beside).map_err(FileError::unread(&beside))?;
    parse_obj_polygons(&text).map_err(|error| FileError::new(&beside, error))
}

/// The vertices of the cloth, from one to before another: of the mesh called `object`, or else of
/// the only one, or of the one called [`SHEET`].
fn cloth_of(mesh: &Polygons, object: Option<&str>) -> Result<[usize; 2], String> {
    if object.is_none() && mesh.parts.len() <= 1 {
        return Ok([0, mesh.positions.len()]);
    }
    let found = mesh
        .labels
        .get(object.unwrap_or(SHEET))
        .and_then(|vertices| {
            let (first, last) = (*vertices.first()? as usize, *vertices.last()? as usize);
            (last + 1 - first == vertices.len()).then_some([first, last + 1])
        });
    found.ok_or_else(|| {
        let names: Vec<&str> = mesh.labels.keys().map(String::as_str).take(20).collect();
        let names = names.join(", ");
        match object {
            Some(object) => format!("has no mesh called {object:?}, but [{names}]"),
            None => format!(
                "has {} meshes, [{names}]: name the one that is the cloth (option `object`)",
                mesh.parts.len()
            ),
        }
    })
}

/// The faces of the cloth as triangles, by its own vertices.
fn triangles(mesh: &Polygons, span: [usize; 2]) -> Result<Vec<[u32; 3]>, String> {
    let [start, end] = span;
    let mut faces = Vec::new();
    for (number, polygon) in mesh.polygons.iter().enumerate() {
        let corners: Vec<usize> = polygon.corners.iter().map(|c| c.vertex as usize).collect();
        if !corners.iter().all(|corner| (start..end).contains(corner)) {
            continue;
        }
        let places: Vec<DVec3> = corners.iter().map(|&c| mesh.positions[c]).collect();
        let cut = triangles_in_space(&places).ok_or_else(|| {
            format!("face {number} crosses itself or has no area: cut it into triangles")
        })?;
        let own = |k: usize| (corners[k] - start) as u32;
        faces.extend(cut.into_iter().map(|triangle| triangle.map(own)));
    }
    Ok(faces)
}

/// Frames at another rate, linearly between those that there are, from the first to the last.
fn at_rate(frames: &[Vec<DVec3>], from: f64, to: f64) -> Vec<Vec<DVec3>> {
    // Rates of files in single precision.
    if (from / to - 1.0).abs() < 1e-4 || frames.is_empty() {
        return frames.to_vec();
    }
    let last = frames.len() - 1;
    let count = (last as f64 / from * to + 1e-6).floor() as usize;
    let frame = |number: usize| {
        let place = number as f64 / to * from;
        let before = (place.floor() as usize).min(last);
        let after = (before + 1).min(last);
        let part = place - before as f64;
        let pairs = frames[before].iter().zip(&frames[after]);
        pairs.map(|(a, b)| a.lerp(*b, part)).collect()
    };
    (0..=count).map(frame).collect()
}

#[cfg(test)]
mod tests;

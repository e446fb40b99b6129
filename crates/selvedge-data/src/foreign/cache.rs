//! Caches of other programs, a file per trajectory: .usda, .usdc, .usdz and .glb have the
//! mesh and its points over time; .pc2 and .npz have the points, and the mesh is the .obj of
//! the same name beside them.
//!
//! A file has one cloth: the mesh that is named, its only one, or the one called `sheet`, as our
//! exports call it. Faces are cut into triangles as they are in the first frame. Texture
//! coordinates are the material coordinates `[m]`, one per vertex. Frames are taken at the rate
//! that is asked for, linearly between those of the file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::parts::{TrajectoryParts, Weight, hanging};
use super::{FlatSource, HandleSource, ImportOptions, RestSource};
use crate::UpAxis;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{ending_of, read_file};
use crate::formats::obj::parse_obj_polygons;
use crate::formats::polygons::{MeshOptions, Polygons, assemble, triangles_in_space};
use crate::obstacle::{moving_points, rig_frames};
use crate::rig::{Rig, RigFormat, Wanted, points_at};

/// The cloth among several meshes.
const SHEET: &str = "sheet";

/// What helps where a cache has no flat coordinates.
const REMEDY: &str = "name a flat mesh of the same vertices (option `flat`), or for a garment take each face as the rest pose has it (`flat` shape)";

/// Largest difference of texture coordinates of a vertex that are taken for one `[m]`.
const SAME: f64 = 1e-6;

/// Roundings of the largest coordinate by which a vertex may stray from a node that it goes with:
/// nodes turn by numbers in single precision, too.
const ROUNDINGS: f64 = 16.0;

/// True for a file that is a cache.
pub(super) fn is_cache(path: &Path) -> bool {
    let ending = ending_of(path);
    RigFormat::of(&ending).is_some() || ["pc2", "npz"].contains(&ending.as_str())
}

/// The mesh of a cache, in the file of its name.
fn mesh_beside(path: &Path) -> PathBuf {
    let names = ["obj", "OBJ"].map(|ending| path.with_extension(ending));
    let found = names.iter().find(|path| path.exists());
    found.unwrap_or(&names[0]).clone()
}

fn read_obj(path: &Path) -> Result<Polygons, FileError<Problem>> {
    let bytes = read_file(path).map_err(FileError::unread(path))?;
    parse_obj_polygons(&bytes).map_err(|error| FileError::new(path, error))
}

/// The meshes of a file, and their points in every frame.
struct Cache {
    mesh: Polygons,
    frames: Vec<Vec<DVec3>>,
    /// The nodes around them, where the file has some; it then says which axis is up.
    rig: Option<Rig>,
}

impl Cache {
    fn read(path: &Path, frame_rate: f64) -> Result<Self, FileError<Problem>> {
        let wrong = |problem: String| FileError::new(path, problem);
        let bytes = read_file(path).map_err(FileError::unread(path))?;
        if let Some(format) = RigFormat::of(&ending_of(path)) {
            let rig = Rig::parse(&bytes, format, Wanted::Motion(None));
            let rig = rig.map_err(|error| FileError::new(path, error))?;
            let mesh = rig
                .polygons()
                .map_err(|error| FileError::new(path, error))?;
            let frames = rig_frames(&rig, 0.0, frame_rate).map_err(wrong)?;
            let rig = Some(rig);
            return Ok(Self { mesh, frames, rig });
        }
        let mesh = read_obj(&mesh_beside(path))?;
        let name = path.to_string_lossy();
        let points = moving_points(&name, &bytes, None, 0.0, frame_rate);
        let (rate, frames) = points.map_err(wrong)?;
        let count = mesh.positions.len();
        if let Some(found) = frames.iter().map(Vec::len).find(|&found| found != count) {
            let problem = format!("has frames of {found} points, and a mesh of {count}");
            return Err(wrong(problem));
        }
        Ok(Self {
            mesh,
            frames: at_rate(frames, rate, frame_rate),
            rig: None,
        })
    }

    /// The vertices of the cloth: of the mesh called `object`, or else of the only one, or of the
    /// one called [`SHEET`].
    fn cloth(&self, object: Option<&str>) -> Result<Range<usize>, String> {
        let mesh = &self.mesh;
        if object.is_none() && mesh.parts.len() <= 1 {
            return Ok(0..mesh.positions.len());
        }
        let found = mesh.labels.get(object.unwrap_or(SHEET));
        let found = found.and_then(|vertices| {
            let (first, last) = (*vertices.first()? as usize, *vertices.last()? as usize);
            (last + 1 - first == vertices.len()).then_some(first..last + 1)
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
    fn triangles(&self, cloth: &Range<usize>) -> Result<Vec<[u32; 3]>, String> {
        let mut faces = Vec::new();
        for (number, polygon) in self.mesh.polygons.iter().enumerate() {
            let corners: Vec<usize> = polygon.vertices().map(|v| v as usize).collect();
            if !corners.iter().all(|corner| cloth.contains(corner)) {
                continue;
            }
            let cut = triangles_in_space(&self.mesh.places(polygon)).ok_or_else(|| {
                format!("face {number} crosses itself or has no area: cut it into triangles")
            })?;
            let own = |k: usize| (corners[k] - cloth.start) as u32;
            faces.extend(cut.into_iter().map(|triangle| triangle.map(own)));
        }
        Ok(faces)
    }

    /// Material coordinates of the cloth: its texture coordinates.
    fn texture(&self, cloth: &Range<usize>) -> Result<Vec<DVec2>, String> {
        let mut material: Vec<Option<DVec2>> = vec![None; cloth.len()];
        for corner in self.mesh.polygons.iter().flat_map(|p| &p.corners) {
            let own = (corner.vertex as usize).checked_sub(cloth.start);
            let known = own.and_then(|own| material.get_mut(own));
            let (Some(known), Some(texture)) = (known, corner.texture) else {
                continue;
            };
            let found = self.mesh.texture[texture];
            if known.is_some_and(|known| known.distance(found) > SAME) {
                return Err(format!(
                    "has a seam at vertex {}, where it has two texture coordinates: {REMEDY}",
                    corner.vertex as usize - cloth.start
                ));
            }
            *known = Some(found);
        }
        material.into_iter().collect::<Option<_>>().ok_or_else(|| {
            format!("has no texture coordinates, which are the flat, unstrained cloth in metres: {REMEDY}")
        })
    }

    /// The held vertices of the cloth.
    fn handles(&self, source: &HandleSource, cloth: &Range<usize>) -> Result<Vec<u32>, String> {
        match (source, &self.rig) {
            (HandleSource::Vertices(numbers), _) => Ok(numbers.clone()),
            (HandleSource::Nodes(names), Some(rig)) => with_nodes(names, rig, cloth),
            (HandleSource::Nodes(_), None) => Err(
                "is a cache of points, without nodes to name: number the held vertices (`handles` 0,30)"
                    .to_owned(),
            ),
        }
    }
}

impl ImportOptions {
    pub(super) fn read(&self, path: &Path) -> Result<TrajectoryParts, FileError<Problem>> {
        let wrong = |problem: String| FileError::new(path, problem);
        let cache = Cache::read(path, self.frame_rate)?;
        let cloth = cache.cloth(self.object.as_deref()).map_err(wrong)?;
        let up = match cache.rig {
            Some(_) => UpAxis::Y,
            None => self.up,
        };
        let faces = cache.triangles(&cloth).map_err(wrong)?;
        let handles = cache.handles(&self.handles, &cloth).map_err(wrong)?;
        let frames = cache.frames.iter();
        let own = frames.flat_map(|frame| frame[cloth.clone()].iter().map(|&p| up.to_ours(p)));
        let positions: Vec<DVec3> = own.collect();
        let material = match &self.flat {
            None => Some(cache.texture(&cloth).map_err(wrong)?),
            Some(FlatSource::Obj(flat)) => {
                let read = assemble(read_obj(flat)?, MeshOptions::default());
                let read = read.map_err(|error| FileError::new(flat, error))?;
                if read.is_own_shape {
                    let problem = "is not flat, and has no texture coordinates: take each face as the rest pose has it (`flat` shape)";
                    return Err(FileError::new(flat, problem.to_owned()));
                }
                Some(read.sheet.mesh.material_coordinates().to_vec())
            }
            Some(FlatSource::Shape) => None,
        };
        let rest = match &self.rest {
            RestSource::Flat => hanging(material.as_deref().unwrap_or_default()),
            RestSource::FirstFrame => positions.get(..cloth.len()).unwrap_or_default().to_vec(),
            RestSource::Obj(file) => read_obj(file)?.positions,
        };
        let expected = cloth.len();
        let flat = material.as_ref().map_or(expected, Vec::len);
        for (what, found) in [("flat mesh", flat), ("rest pose", rest.len())] {
            if found != expected {
                return Err(wrong(format!(
                    "the {what} is for {found} vertices, but there are {expected}"
                )));
            }
        }
        Ok(TrajectoryParts {
            made_by: "imported from a cache".to_owned(),
            faces,
            rest,
            material,
            positions,
            handles,
            weight: Weight::Density(self.density),
            frame_rate: self.frame_rate,
        })
    }
}

/// The vertices of the cloth that go with nodes of these names: node by node, each time the nearest
/// first. Frames are compared as the file has them: between two frames, where points go straight,
/// what turns is not rigid.
fn with_nodes(names: &[String], rig: &Rig, cloth: &Range<usize>) -> Result<Vec<u32>, String> {
    let keys = rig.keys_at(cloth.start);
    let own = |time: &f64| rig.positions(*time)[cloth.clone()].to_vec();
    let frames: Vec<Vec<DVec3>> = keys.iter().map(own).collect();
    let (Some(first), Some(&start)) = (frames.first(), keys.first()) else {
        return Err("has a cloth that does not move".to_owned());
    };
    let coordinates = frames.iter().flatten().map(|p| p.abs().max_element());
    let largest = coordinates.fold(0.0, f64::max);
    let tolerance = ROUNDINGS * f64::from(f32::EPSILON) * largest;
    let mut handles: Vec<u32> = Vec::new();
    for name in names {
        let node = rig.find(name).map_err(|error| error.to_string())?;
        let placements: Vec<_> = keys.iter().map(|&time| rig.placement(node, time)).collect();
        let to_node = rig.placement(node, start).inverse();
        // How far a vertex is from where the node would take it, at most.
        let strays = |place: &DVec3, vertex: usize| {
            let place = to_node.transform_point3(*place);
            let pairs = placements.iter().zip(&frames);
            let apart = pairs
                .map(|(to_world, frame)| to_world.transform_point3(place).distance(frame[vertex]));
            apart.fold(0.0, f64::max)
        };
        let strays = first.iter().zip(0..).map(|(p, vertex)| strays(p, vertex));
        let strays: Vec<f64> = strays.collect();
        let mut with: Vec<usize> = (0..first.len())
            .filter(|&vertex| strays[vertex] <= tolerance)
            .collect();
        if with.is_empty() {
            let nearest = (0..first.len()).min_by(|&a, &b| strays[a].total_cmp(&strays[b]));
            let nearest = nearest.unwrap_or_default();
            return Err(format!(
                "has no vertex that goes with the node {name:?} to {tolerance:.1e} m: vertex {nearest} comes nearest, and strays by {:.1e} m",
                strays.get(nearest).copied().unwrap_or(f64::NAN)
            ));
        }
        let origin = rig.placement(node, start).transform_point3(DVec3::ZERO);
        with.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|vertex| first[vertex].distance(origin));
            a.total_cmp(&b)
        });
        for vertex in with {
            if !handles.contains(&(vertex as u32)) {
                handles.push(vertex as u32);
            }
        }
    }
    Ok(handles)
}

/// Frames at another rate, linearly between those that there are, from the first to the last.
fn at_rate(frames: Vec<Vec<DVec3>>, from: f64, to: f64) -> Vec<Vec<DVec3>> {
    // Rates of files in single precision.
    if (from / to - 1.0).abs() < 1e-4 || frames.is_empty() {
        return frames;
    }
    let last = frames.len() - 1;
    let count = (last as f64 / from * to + 1e-6).floor() as usize;
    let frame = |number: usize| points_at(&frames, number as f64 / to * from);
    (0..=count).map(frame).collect()
}

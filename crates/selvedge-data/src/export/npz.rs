//! NumPy's archive of arrays (.npz), not packed: all that a trajectory has but its scene, and back.
//!
//! | array | type, shape | |
//! |---|---|---|
//! | `positions` | f4 `[frames, vertices, 3]` | m |
//! | `normals` | f4 `[frames, vertices, 3]` | where they are wanted |
//! | `faces` | i4 `[faces, 3]` | counter-clockwise |
//! | `rest_positions` | f4 `[vertices, 3]` | m |
//! | `material_coordinates` | f4 `[points, 2]` | m; without seams one per vertex |
//! | `pattern_faces` | i4 `[faces, 3]` | points of the corners, where the cloth is sewn |
//! | `vertex_mass`, `face_area` | f4 `[vertices]`, `[faces]` | kg, m² |
//! | `handles` | i4 `[handles]` | |
//! | `fps` | f8 `[1]` | of these frames |
//! | `up_axis` | i4 `[1]` | 1: y, 2: z |
//! | `obstacle_NAME` | f4 `[frames, points, 3]` | m; of one frame where it is still |
//! | `obstacle_NAME_faces` | i4 `[faces, 3]` | |
//!
//! The archive has no 64-bit extension: at most 4 GiB.

use std::io::{self, Write};
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use selvedge_cloth::{
    Cloth, ClothArrays, ClothError, HandleError, Handles, RecordedMotion, Topology, TopologyError,
};
use serde_json::Value;
use thiserror::Error;

use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse, check_size};
use super::take::Take;
use crate::UpAxis;
use crate::formats::atomic::write_atomically;
use crate::formats::npy::{Array, NpyError};
use crate::formats::npz::{EntryOut, Npz, NpzError, archive_bytes, write_archive};
use crate::trajectory::{Provenance, Trajectory, TrajectoryError};

/// An archive that is no trajectory, or no motion of handles.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum NpzTrajectoryError {
    #[error("could not be read: {0}")]
    Read(#[from] io::Error),
    #[error(transparent)]
    Archive(#[from] NpzError),
    #[error("has no array {name:?}; it has [{known}]")]
    Missing { name: &'static str, known: String },
    #[error("array {name}: {source}")]
    Array {
        name: &'static str,
        #[source]
        source: NpyError,
    },
    #[error("array {name}: expected {expected}, found {found}")]
    Value {
        name: &'static str,
        expected: String,
        found: String,
    },
    #[error(transparent)]
    Topology(#[from] TopologyError),
    #[error(transparent)]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Cloth(#[from] ClothError),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

/// Writes the archive.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    let obstacles: Vec<_> = take.obstacles().into_iter().map(titled).collect();
    let entries = entries(take, &obstacles);
    check_size(".npz", archive_bytes(&entries), take.every())?;
    Ok(write_archive_of(&entries, path, pulse)?)
}

fn write_archive_of(
    entries: &[EntryOut<'_>],
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), crate::WriteError> {
    write_atomically(path, |out| {
        write_archive(entries, out, &mut |name| match name {
            "positions" => pulse.beat(),
            _ => Ok(()),
        })?;
        out.flush()
    })
}

fn entries<'a>(take: &'a Take<'_>, obstacles: &'a [TitledObstacle<'_>]) -> Vec<EntryOut<'a>> {
    let by_frame = |name, of: Box<dyn Fn(usize) -> Vec<u8> + 'a>| EntryOut {
        name,
        kind: "<f4",
        shape: vec![take.len(), take.trajectory().vertex_count(), 3],
        chunks: take.len(),
        chunk: of,
    };
    let positions = by_frame("positions", Box::new(|k| floats3(&take.positions(k))));
    let mut entries = vec![positions];
    if take.has_normals() {
        let normals = move |k| floats3(&take.normals_at(&take.positions(k)));
        entries.push(by_frame("normals", Box::new(normals)));
    }
    entries.extend(unchanging(take));
    for obstacle in obstacles {
        let frames = obstacle.frame_count(take);
        entries.push(EntryOut {
            name: &obstacle.title,
            kind: "<f4",
            shape: vec![frames, obstacle.point_count(), 3],
            chunks: frames,
            chunk: Box::new(move |k| floats3(&obstacle.positions(take, k))),
        });
        entries.push(EntryOut {
            name: &obstacle.faces_title,
            kind: "<i4",
            shape: vec![obstacle.faces().len(), 3],
            chunks: 1,
            chunk: Box::new(move |_| integers(obstacle.faces().as_flattened())),
        });
    }
    entries
}

/// An obstacle with the names of its arrays.
struct TitledObstacle<'a> {
    own: TakenObstacle<'a>,
    title: String,
    faces_title: String,
}

impl<'a> std::ops::Deref for TitledObstacle<'a> {
    type Target = TakenObstacle<'a>;

    fn deref(&self) -> &TakenObstacle<'a> {
        &self.own
    }
}

fn titled(own: TakenObstacle<'_>) -> TitledObstacle<'_> {
    TitledObstacle {
        title: format!("obstacle_{}", own.name),
        faces_title: format!("obstacle_{}_faces", own.name),
        own,
    }
}

/// Arrays that do not change over time.
fn unchanging(take: &Take<'_>) -> Vec<EntryOut<'static>> {
    let cloth = take.trajectory().cloth();
    let (vertices, faces) = (cloth.vertex_mass().len(), cloth.face_area().len());
    let entry = |name, kind, shape: &[usize], bytes: Vec<u8>| EntryOut {
        name,
        kind,
        shape: shape.to_vec(),
        chunks: 1,
        chunk: Box::new(move |_| bytes.clone()),
    };
    let corners = cloth.topology().face_indices();
    let rest = floats3(&take.rest_positions());
    let material = floats(
        cloth
            .material_coordinates()
            .iter()
            .flat_map(|c| c.to_array()),
    );
    let mass = floats(cloth.vertex_mass().iter().copied());
    let area = floats(cloth.face_area().iter().copied());
    let handles: Vec<u32> = cloth.handles().vertices().iter().map(|v| v.0).collect();
    let fps = take.trajectory().frame_rate() / take.every() as f64;
    let up = match take.up() {
        UpAxis::Y => 1,
        UpAxis::Z => 2,
    };
    let points = cloth.material_coordinates().len();
    let mut entries = vec![
        entry(
            "faces",
            "<i4",
            &[faces, 3],
            integers(corners.as_flattened()),
        ),
        entry("rest_positions", "<f4", &[vertices, 3], rest),
        entry("material_coordinates", "<f4", &[points, 2], material),
        entry("vertex_mass", "<f4", &[vertices], mass),
        entry("face_area", "<f4", &[faces], area),
        entry("handles", "<i4", &[handles.len()], integers(&handles)),
        entry("fps", "<f8", &[1], fps.to_le_bytes().to_vec()),
        entry("up_axis", "<i4", &[1], integers(&[up])),
    ];
    if cloth.pattern().is_sewn() {
        let corners = integers(cloth.pattern().corners().as_flattened());
        entries.push(entry("pattern_faces", "<i4", &[faces, 3], corners));
    }
    entries
}

fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

fn floats3(values: &[Vec3]) -> Vec<u8> {
    floats(values.iter().flat_map(|p| p.to_array()))
}

fn integers(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

impl Trajectory {
    /// Reads a trajectory from the bytes of an exported archive; it has no scene.
    ///
    /// # Errors
    /// [`NpzTrajectoryError`] names the array that is missing or wrong.
    pub fn from_npz(bytes: &[u8]) -> Result<Self, NpzTrajectoryError> {
        let archive = Arrays(Npz::open(bytes)?);
        let (positions, shape) = archive.points("positions")?;
        let vertices = shape[1];
        let faces = triples(&archive.numbers("faces", &[None, Some(3)])?);
        let is_sewn = archive.has("pattern_faces");
        let rest = archive.floats("rest_positions", &[Some(vertices), Some(3)])?;
        let up = archive.up()?;
        let coordinates = archive.floats(
            "material_coordinates",
            &[(!is_sewn).then_some(vertices), Some(2)],
        )?;
        let single = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
        let fps = archive.floats("fps", &[Some(1)])?;
        let arrays = ClothArrays {
            rest_positions: points(&rest).map(|p| up.to_ours(p).as_vec3()).collect(),
            material_coordinates: coordinates
                .chunks_exact(2)
                .map(|c| Vec2::new(c[0] as f32, c[1] as f32))
                .collect(),
            vertex_mass: single(archive.floats("vertex_mass", &[Some(vertices)])?),
            face_area: single(archive.floats("face_area", &[Some(faces.len())])?),
        };
        let handles = Handles::new(&archive.numbers("handles", &[None])?, vertices)?;
        let topology = Topology::new(vertices, &faces)?;
        let cloth = if is_sewn {
            let corners = archive.numbers("pattern_faces", &[Some(faces.len()), Some(3)])?;
            Cloth::sewn(topology, handles, arrays, triples(&corners))?
        } else {
            Cloth::new(topology, handles, arrays)?
        };
        let positions = points(&positions)
            .map(|p| up.to_ours(p).as_vec3())
            .collect();
        let provenance = Provenance {
            frame_rate: fps[0],
            scene: Value::Null,
            made_by: "an archive of NumPy's".to_owned(),
        };
        Ok(Self::new(cloth, positions, provenance)?)
    }
}

/// The motion of handles in an archive: `positions` `[frames, handles, 3]` `[m]`; where there is an
/// array `handles`, as in an export, these vertices of `[frames, vertices, 3]`. A rate in it must
/// be `frame_rate`.
pub(crate) fn handle_positions(
    bytes: &[u8],
    frame_rate: f64,
) -> Result<RecordedMotion, NpzTrajectoryError> {
    let archive = Arrays(Npz::open(bytes)?);
    let (values, shape) = archive.points("positions")?;
    let up = archive.up()?;
    if archive.has("fps") {
        let found = archive.floats("fps", &[Some(1)])?[0];
        if found != frame_rate {
            return Err(NpzTrajectoryError::Value {
                name: "fps",
                expected: format!("{frame_rate}, the frame rate of the scene"),
                found: found.to_string(),
            });
        }
    }
    let taken: Vec<usize> = if archive.has("handles") {
        let handles = archive.numbers("handles", &[None])?;
        handles.iter().map(|&handle| handle as usize).collect()
    } else {
        (0..shape[1]).collect()
    };
    if let Some(&bad) = taken.iter().find(|&&vertex| vertex >= shape[1]) {
        return Err(NpzTrajectoryError::Value {
            name: "handles",
            expected: format!("vertices below {}", shape[1]),
            found: bad.to_string(),
        });
    }
    let all: Vec<DVec3> = points(&values).map(|p| up.to_ours(p)).collect();
    let frames = all.chunks_exact(shape[1].max(1));
    Ok(RecordedMotion {
        positions: frames
            .map(|frame| taken.iter().map(|&vertex| frame[vertex]).collect())
            .collect(),
    })
}

/// Points of a body over time, and their rate where the archive says it.
pub(crate) struct BodyPoints {
    /// `[frames, points]` `[m]`
    pub(crate) frames: Vec<Vec<DVec3>>,
    /// Frames per second.
    pub(crate) frame_rate: Option<f64>,
}

/// The points of a body in an archive: `positions` or `points`, `[frames, points, 3]` `[m]`, and
/// `fps` `[1]` where there is one.
pub(crate) fn body_points(bytes: &[u8]) -> Result<BodyPoints, NpzTrajectoryError> {
    let archive = Arrays(Npz::open(bytes)?);
    let has_points = archive.has("points") && !archive.has("positions");
    let name = if has_points { "points" } else { "positions" };
    let (values, shape) = archive.points(name)?;
    let up = archive.up()?;
    let frame_rate = match archive.has("fps") {
        true => Some(archive.floats("fps", &[Some(1)])?[0]),
        false => None,
    };
    let all: Vec<DVec3> = points(&values).map(|p| up.to_ours(p)).collect();
    let frames = all.chunks_exact(shape[1].max(1)).map(<[_]>::to_vec);
    Ok(BodyPoints {
        frames: frames.collect(),
        frame_rate,
    })
}

fn triples(values: &[u32]) -> Vec<[u32; 3]> {
    let (triples, _) = values.as_chunks::<3>();
    triples.to_vec()
}

fn points(values: &[f64]) -> impl Iterator<Item = DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice)
}

/// An archive whose arrays are asked for by name.
struct Arrays<'a>(Npz<'a>);

impl Arrays<'_> {
    fn has(&self, name: &str) -> bool {
        self.0.names().contains(&name)
    }

    fn array(&self, name: &'static str) -> Result<Array, NpzTrajectoryError> {
        let known = || self.0.names().join(", ");
        let found = self.0.array(name)?;
        found.ok_or_else(|| NpzTrajectoryError::Missing {
            name,
            known: known(),
        })
    }

    fn floats(
        &self,
        name: &'static str,
        shape: &[Option<usize>],
    ) -> Result<Vec<f64>, NpzTrajectoryError> {
        let array = self.array(name)?;
        let values = array.expect_shape(shape).and_then(|()| array.floats());
        values.map_err(|source| NpzTrajectoryError::Array { name, source })
    }

    fn points(&self, name: &'static str) -> Result<(Vec<f64>, Vec<usize>), NpzTrajectoryError> {
        let shape = self.array(name)?.shape;
        let values = self.floats(name, &[None, None, Some(3)])?;
        Ok((values, shape))
    }

    fn numbers(
        &self,
        name: &'static str,
        shape: &[Option<usize>],
    ) -> Result<Vec<u32>, NpzTrajectoryError> {
        let array = self.array(name)?;
        let values = array.expect_shape(shape).and_then(|()| array.integers());
        let values = values.map_err(|source| NpzTrajectoryError::Array { name, source })?;
        let number = |value: i64| {
            u32::try_from(value).map_err(|_| NpzTrajectoryError::Value {
                name,
                expected: "numbers from 0".to_owned(),
                found: value.to_string(),
            })
        };
        values.into_iter().map(number).collect()
    }

    /// Axis that points up; y where the archive does not say.
    fn up(&self) -> Result<UpAxis, NpzTrajectoryError> {
        if !self.has("up_axis") {
            return Ok(UpAxis::Y);
        }
        match self.numbers("up_axis", &[Some(1)])?.as_slice() {
            [1] => Ok(UpAxis::Y),
            [2] => Ok(UpAxis::Z),
            other => Err(NpzTrajectoryError::Value {
                name: "up_axis",
                expected: "1 for y or 2 for z".to_owned(),
                found: format!("{other:?}"),
            }),
        }
    }
}

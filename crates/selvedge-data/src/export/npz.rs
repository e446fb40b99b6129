//! NumPy's archive of arrays (.npz), not packed: all that a trajectory has but its scene
//! (docs/src/guides/export.md). [`Trajectory::from_npz`](crate::Trajectory::from_npz) reads it.
//!
//! The archive has no 64-bit extension: at most 4 GiB.

use std::path::Path;

use glam::Vec3;

use super::outcome::{ExportError, Pulse, check_size};
use super::take::Take;
use crate::UpAxis;
use crate::formats::atomic::write_atomically;
use crate::formats::npz::{EntryOut, archive_bytes, write_archive};
use crate::formats::tensor_file::{TensorOut, TensorValues};
use crate::trajectory::file::cloth_tensors;

/// Writes the archive.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    let entries = entries(take);
    check_size(".npz", archive_bytes(&entries), take.every)?;
    Ok(write_atomically(path, |out| {
        write_archive(&entries, out, &mut |name| match name {
            "positions" => pulse.beat(),
            _ => Ok(()),
        })
    })?)
}

fn entries<'a>(take: &'a Take<'_>) -> Vec<EntryOut<'a>> {
    let by_frame = |name: &str, of: Box<dyn Fn(usize) -> Vec<u8> + 'a>| EntryOut {
        name: name.to_owned(),
        kind: "<f4",
        shape: vec![take.len(), take.trajectory.vertex_count(), 3],
        chunks: take.len(),
        chunk: of,
    };
    let positions = by_frame("positions", Box::new(|k| floats3(&take.positions(k))));
    let mut entries = vec![positions];
    if take.normals {
        let normals = move |k| floats3(&take.normals_at(&take.positions(k)));
        entries.push(by_frame("normals", Box::new(normals)));
    }
    entries.extend(of_cloth(take));
    for obstacle in take.obstacles() {
        let (frames, track) = (obstacle.frame_count(take), obstacle.track);
        let faces = integers(track.faces().as_flattened());
        let name = format!("obstacle_{}", obstacle.name);
        let shape = [track.faces().len(), 3];
        let of_faces = unchanging(&format!("{name}_faces"), "<i4", &shape, faces);
        entries.push(EntryOut {
            name,
            kind: "<f4",
            shape: vec![frames, track.point_count(), 3],
            chunks: frames,
            chunk: Box::new(move |k| floats3(&obstacle.positions(take, k))),
        });
        entries.push(of_faces);
    }
    entries
}

/// An array that does not change over time.
fn unchanging(
    name: &str,
    kind: &'static str,
    shape: &[usize],
    bytes: Vec<u8>,
) -> EntryOut<'static> {
    EntryOut {
        name: name.to_owned(),
        kind,
        shape: shape.to_vec(),
        chunks: 1,
        chunk: Box::new(move |_| bytes.clone()),
    }
}

/// Arrays of the cloth that do not change over time.
fn of_cloth(take: &Take<'_>) -> Vec<EntryOut<'static>> {
    let entry = |tensor: TensorOut<'_>| {
        let (kind, bytes) = match tensor.values {
            TensorValues::F64(values) => {
                ("<f8", values.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
            TensorValues::F32(values) => ("<f4", floats(values.iter().copied())),
            TensorValues::U32(values) => ("<i4", integers(&values)),
        };
        unchanging(&tensor.name, kind, &tensor.shape, bytes)
    };
    let up = match take.up {
        UpAxis::Y => 1,
        UpAxis::Z => 2,
    };
    let fps = take.trajectory.frame_rate() / take.every as f64;
    let mut tensors = cloth_tensors(take.trajectory.cloth(), &take.rest_positions());
    tensors.push(TensorOut::new(
        "fps",
        &[1],
        TensorValues::F64(vec![fps].into()),
    ));
    tensors.push(TensorOut::new(
        "up_axis",
        &[1],
        TensorValues::U32(vec![up].into()),
    ));
    tensors.into_iter().map(entry).collect()
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

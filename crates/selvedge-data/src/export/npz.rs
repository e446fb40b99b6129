//! NumPy's archive of arrays (.npz), not packed: all that a trajectory has but its scene
//! (docs/src/guides/export.md). [`Trajectory::from_npz`](crate::Trajectory::from_npz) reads it.
//!
//! The archive has no 64-bit extension: at most 4 GiB.

use std::io::{self, Seek, Write};
use std::path::Path;

use super::common::{check_size, le_floats, le_points, le_words};
use super::take::Take;
use crate::UpAxis;
use crate::formats::atomic::write_atomically;
use crate::formats::file_error::Problem;
use crate::formats::npz::NpzOut;
use crate::formats::tensor_file::{TensorOut, TensorValues};
use crate::trajectory::file::cloth_tensors;

/// Bytes that what does not grow with the frames may have, for every vertex and in all.
const PER_VERTEX: u64 = 200;
const BESIDE: u64 = 1 << 16;

/// Writes the archive.
pub(super) fn write(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    check_size(".npz", planned_bytes(take), take.every)?;
    Ok(write_atomically(path, |out| write_arrays(take, out))?)
}

/// Bytes of the archive, not fewer than it will have.
fn planned_bytes(take: &Take<'_>) -> u64 {
    let (frames, vertices) = (take.len() as u64, take.trajectory.vertex_count() as u64);
    let by_frame = 12 * frames * vertices * (1 + u64::from(take.normals));
    let bodies = take.obstacles();
    let bodies = bodies.iter().map(|body| {
        let points = (body.frame_count() * body.point_count()) as u64;
        12 * points + 12 * body.faces().len() as u64 + 1024
    });
    by_frame + PER_VERTEX * vertices + bodies.sum::<u64>() + BESIDE
}

fn write_arrays(take: &Take<'_>, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let sheet = take.sheet();
    let shape = [take.len(), sheet.point_count(), 3];
    let mut out = NpzOut::new(out);
    out.array("positions", "<f4", &shape)?;
    for number in 0..take.len() {
        out.bytes(&le_points(&sheet.positions(number)))?;
        (take.beat)()?;
    }
    if take.normals {
        out.array("normals", "<f4", &shape)?;
        for number in 0..take.len() {
            let normals = take.normals_at(&sheet.positions(number));
            out.bytes(&le_points(&normals))?;
        }
    }
    for tensor in of_cloth(take) {
        let (kind, bytes) = match tensor.values {
            TensorValues::F64(values) => {
                ("<f8", values.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
            TensorValues::F32(values) => ("<f4", le_floats(values.iter().copied())),
            TensorValues::U32(values) => ("<i4", le_words(&values)),
            TensorValues::U8(values) => ("|u1", values.into_owned()),
        };
        out.array(&tensor.name, kind, &tensor.shape)?;
        out.bytes(&bytes)?;
    }
    for body in take.obstacles() {
        let (name, faces) = (format!("obstacle_{}", body.name), body.faces());
        out.array(&name, "<f4", &[body.frame_count(), body.point_count(), 3])?;
        for number in 0..body.frame_count() {
            out.bytes(&le_points(&body.positions(number)))?;
        }
        out.array(&format!("{name}_faces"), "<i4", &[faces.len(), 3])?;
        out.bytes(&le_words(faces.as_flattened()))?;
    }
    out.finish()
}

/// Arrays of the cloth that do not change over time, the rate and the axis.
fn of_cloth<'a>(take: &Take<'a>) -> Vec<TensorOut<'a>> {
    let up = match take.up {
        UpAxis::Y => 1,
        UpAxis::Z => 2,
    };
    let fps = take.trajectory.frame_rate() / take.every as f64;
    let mut tensors = cloth_tensors(take.trajectory.cloth(), &take.rest_positions());
    let one = |name, value| TensorOut::new(name, &[1], value);
    tensors.push(one("fps", TensorValues::F64(vec![fps].into())));
    tensors.push(one("up_axis", TensorValues::U32(vec![up].into())));
    tensors
}

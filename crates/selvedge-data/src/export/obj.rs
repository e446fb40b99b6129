//! Frames as Wavefront OBJ: one, or all of them in a folder of their own as `cloth_0000.obj`,
//! `cloth_0001.obj` and so on, numbered without gaps whatever frames were taken.
//!
//! An obstacle is in files of its own: beside `x.obj` in `x.NAME.obj`; in a folder in `NAME.obj`,
//! or `NAME_0000.obj` and so on where it moves.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse};
use super::take::Take;
use crate::formats::atomic::{WriteError, write_atomically, write_folder_atomically};
use crate::formats::obj::{ObjFrame, write_obj_frame};

/// Writes the only frame.
pub(super) fn write_one(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    write_frame(take, 0, path)?;
    write_obstacles(take, path)?;
    // The file is whole: an end that was asked for comes too late.
    let _ = pulse.beat();
    Ok(())
}

/// Writes a folder with a file per frame.
pub(super) fn write_all(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    let width = (take.len() - 1).to_string().len().max(4);
    write_folder_atomically(path, |folder| {
        for number in 0..take.len() {
            let file = folder.join(format!("cloth_{number:0width$}.obj"));
            let write = || {
                let mut out = BufWriter::new(File::create(file)?);
                with_frame(take, number, |frame| frame.write(&mut out))?;
                out.flush()?;
                pulse.beat()
            };
            write().map_err(WriteError::when(path, "write into it"))?;
        }
        for obstacle in take.obstacles() {
            for number in 0..obstacle.frame_count(take) {
                let name = match obstacle.is_still() {
                    true => format!("{}.obj", obstacle.name),
                    false => format!("{}_{number:0width$}.obj", obstacle.name),
                };
                write_body(&obstacle, take, number, &folder.join(name))?;
            }
        }
        Ok(())
    })
}

/// Writes every obstacle as it is in the first frame beside `path`, as `x.NAME.obj`.
pub(super) fn write_obstacles(take: &Take<'_>, path: &Path) -> Result<(), ExportError> {
    for obstacle in take.obstacles() {
        let beside = obstacle.beside(path, "obj");
        write_body(&obstacle, take, 0, &beside)?;
    }
    Ok(())
}

/// Writes an obstacle in the frame taken as `number`.
fn write_body(
    obstacle: &TakenObstacle<'_>,
    take: &Take<'_>,
    number: usize,
    path: &Path,
) -> Result<(), WriteError> {
    write_atomically(path, |out| {
        writeln!(out, "o {}", obstacle.name)?;
        for p in obstacle.positions(take, number) {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for face in obstacle.track.faces() {
            let [a, b, c] = face.map(|point| point + 1);
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    })
}

pub(super) fn write_frame(take: &Take<'_>, number: usize, path: &Path) -> Result<(), ExportError> {
    with_frame(take, number, |frame| Ok(write_obj_frame(path, frame)?))
}

fn with_frame<T>(take: &Take<'_>, number: usize, act: impl FnOnce(&ObjFrame<'_>) -> T) -> T {
    let positions = take.positions(number);
    let normals = take.normals.then(|| take.normals_at(&positions));
    let cloth = take.trajectory.cloth();
    act(&ObjFrame {
        topology: cloth.topology(),
        positions: &positions,
        texture: cloth.texture_points(),
        normals: normals.as_deref(),
    })
}

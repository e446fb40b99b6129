//! Frames as Wavefront OBJ: one, or all of them in a folder of their own as `cloth_0000.obj`,
//! `cloth_0001.obj` and so on, numbered without gaps whatever frames were taken. Or a point cache
//! (.pc2): the positions of every vertex in every frame, and beside it the mesh of the first frame
//! as .obj of the same name, whose vertices they are.
//!
//! An obstacle is in files of its own: beside `x.obj` or `x.pc2` in `x.NAME.obj`, and as
//! `x.NAME.pc2` where it moves; in a folder in `NAME.obj`, or `NAME_0000.obj` and so on where it
//! moves.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::take::{Body, Take};
use crate::formats::atomic::{WriteError, write_atomically, write_folder_atomically};
use crate::formats::file_error::Problem;
use crate::formats::obj::{ObjFrame, write_obj_frame};
use crate::formats::pc2;

/// Writes the only frame.
pub(super) fn write_one(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    write_meshes(take, path)?;
    // The file is whole: an end that was asked for comes too late.
    let _ = (take.beat)();
    Ok(())
}

/// Writes a point cache, then the mesh, then the obstacles.
pub(super) fn write_cache(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    write_points(take, &take.sheet(), path)?;
    write_meshes(take, &path.with_extension("obj"))?;
    for body in take.obstacles().iter().filter(|body| !body.is_still()) {
        write_points(take, body, &body.beside(path, "pc2"))?;
    }
    Ok(())
}

/// Writes a folder with a file per frame.
pub(super) fn write_all(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    let width = (take.len() - 1).to_string().len().max(4);
    write_folder_atomically(path, |folder| {
        for number in 0..take.len() {
            let file = folder.join(format!("cloth_{number:0width$}.obj"));
            let write = || {
                let mut out = BufWriter::new(File::create(file)?);
                with_frame(take, number, |frame| frame.write(&mut out))?;
                out.flush()?;
                (take.beat)()
            };
            write().map_err(WriteError::when(path, "write into it"))?;
        }
        for body in take.obstacles() {
            for number in 0..body.frame_count() {
                let name = if body.is_still() {
                    format!("{}.obj", body.name)
                } else {
                    format!("{}_{number:0width$}.obj", body.name)
                };
                write_body(&body, number, &folder.join(name))?;
            }
        }
        Ok(())
    })
}

/// Writes the cloth as it is in the first frame, and every obstacle beside it.
fn write_meshes(take: &Take<'_>, path: &Path) -> Result<(), WriteError> {
    with_frame(take, 0, |frame| write_obj_frame(path, frame))?;
    for body in take.obstacles() {
        write_body(&body, 0, &body.beside(path, "obj"))?;
    }
    Ok(())
}

/// Writes an obstacle in the frame taken as `number`.
fn write_body(body: &Body<'_>, number: usize, path: &Path) -> Result<(), WriteError> {
    write_atomically(path, |out| {
        writeln!(out, "o {}", body.name)?;
        for p in body.positions(number) {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for face in body.faces() {
            let [a, b, c] = face.map(|point| point + 1);
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    })
}

/// Writes the points of a body in all frames.
fn write_points(take: &Take<'_>, body: &Body<'_>, path: &Path) -> Result<(), WriteError> {
    write_atomically(path, |out| {
        pc2::write_header(out, take.len(), body.point_count(), take.every)?;
        for number in 0..take.len() {
            pc2::write_points(out, &body.positions(number))?;
            if body.track.is_none() {
                (take.beat)()?;
            }
        }
        Ok(())
    })
}

fn with_frame<T>(take: &Take<'_>, number: usize, act: impl FnOnce(&ObjFrame<'_>) -> T) -> T {
    let positions = take.sheet().positions(number);
    let normals = take.normals.then(|| take.normals_at(&positions));
    let cloth = take.trajectory.cloth();
    act(&ObjFrame {
        topology: cloth.topology(),
        positions: &positions,
        texture: cloth.texture_points(),
        normals: normals.as_deref(),
    })
}

//! The folders of the released code of Libao et al. 2023: `cloth_pos.npy` `[frames, vertices, 3]`
//! `[m]`, `cloth_m.npy` `[vertices, 1]` `[kg]`, `cloth_f_area.npy` `[faces, 1]` `[m²]`, `face.npy`
//! `[faces, 3]`, `rest.obj` (the sagged rest pose; its texture coordinates are the material
//! coordinates) and optionally meta.json, whose `dt` `[s]` is used.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use serde_json::Value;

use super::array::{read_floats, read_indices};
use super::assemble::{Parts, Weight};
use super::error::{ForeignError, ForeignProblem};
use super::flag_simple::META;
use super::options::{ForeignFormat, HandleSource, ImportOptions, positive, refuse};
use crate::UpAxis;
use crate::formats::input::read_text;
use crate::formats::mesh_file::read_mesh;
use crate::formats::obj::{read_obj, read_obj_positions};
use crate::formats::polygons::MeshOptions;

pub(super) const POSITIONS: &str = "cloth_pos.npy";
/// Frames per second of the paper (section 3).
const PAPER_RATE: f64 = 60.0;

/// Reader of released folders.
#[derive(Clone, Debug)]
pub(super) struct Released {
    /// The choice of the options.
    frame_rate: Option<f64>,
    pub(super) handles: Vec<u32>,
    pub(super) flat: Option<PathBuf>,
    pub(super) up: UpAxis,
}

impl Released {
    pub(super) fn new(options: &ImportOptions) -> Result<Self, ForeignProblem> {
        refuse(
            options.density.as_ref(),
            "what the cloth weighs",
            "--density",
        )?;
        refuse(options.rest.as_ref(), "the rest pose (rest.obj)", "--rest")?;
        refuse(
            options.object.as_ref(),
            "which mesh is the cloth",
            "--object",
        )?;
        let handles = match &options.handles {
            Some(HandleSource::Vertices(numbers)) => numbers.clone(),
            Some(other) => {
                return Err(ForeignProblem::Option {
                    option: "--handles",
                    expected: "numbers from 0 for these folders, as 0,30",
                    found: other.describe().to_string(),
                });
            }
            None => {
                return Err(ForeignProblem::Missing {
                    what: "which vertices are held",
                    option: "--handles",
                    hint: "numbers from 0, as 0,30",
                });
            }
        };
        Ok(Self {
            frame_rate: positive(options.frame_rate, "--frame-rate")?,
            handles,
            flat: options.flat.clone(),
            up: options.up.unwrap_or(UpAxis::Y),
        })
    }

    /// The parts of the trajectory in `folder`.
    pub(super) fn read(&self, folder: &Path) -> Result<Parts, ForeignError> {
        let file = |name: &str| folder.join(name);
        let at = |name: &str, problem| ForeignError {
            path: folder.join(name),
            problem,
        };
        let positions = read_floats(&file(POSITIONS), &[None, None, Some(3)])?;
        let vertices = positions.shape[1];
        let mass = read_floats(&file("cloth_m.npy"), &[Some(vertices), Some(1)])?;
        let faces = read_indices(&file("face.npy"), &[None, Some(3)])?;
        let area = read_floats(&file("cloth_f_area.npy"), &[Some(faces.shape[0]), Some(1)])?;
        let (rest, material) = self.rest(&file("rest.obj"))?;
        if rest.len() != vertices {
            let problem = ForeignProblem::Count {
                what: "the rest pose".to_owned(),
                unit: "vertices",
                expected: vertices,
                found: rest.len(),
            };
            return Err(at("rest.obj", problem));
        }
        let point = |p: &[f64; 3]| self.up.to_ours(DVec3::from_array(*p));
        Ok(Parts {
            format: ForeignFormat::Released,
            faces: faces.values.as_chunks::<3>().0.to_vec(),
            material,
            rest: rest.into_iter().map(|p| self.up.to_ours(p)).collect(),
            positions: positions
                .values
                .as_chunks::<3>()
                .0
                .iter()
                .map(point)
                .collect(),
            handles: self.handles.clone(),
            weight: Weight::Given {
                mass: mass.values.iter().map(|&m| m as f32).collect(),
                area: area.values.iter().map(|&a| a as f32).collect(),
            },
            frame_rate: self.rate(folder)?,
        })
    }

    /// Rest positions and material coordinates.
    fn rest(&self, path: &Path) -> Result<(Vec<DVec3>, Vec<DVec2>), ForeignError> {
        let obj = |problem: crate::formats::polygons::ReadMeshError| ForeignError {
            path: problem.path.clone(),
            problem: ForeignProblem::Layout(problem.source.to_string()),
        };
        let Some(flat) = &self.flat else {
            let read = read_mesh(path, MeshOptions::default()).map_err(obj)?;
            if read.is_own_shape {
                let problem = "has no texture coordinates and is not flat: give it texture coordinates, or name a flat mesh of the same vertices";
                return Err(ForeignError {
                    path: path.to_owned(),
                    problem: ForeignProblem::Layout(problem.to_owned()),
                });
            }
            let mesh = read.sheet.mesh;
            return Ok((
                mesh.positions().to_vec(),
                mesh.material_coordinates().to_vec(),
            ));
        };
        let rest = read_obj_positions(path).map_err(obj)?;
        let mesh = read_obj(flat).map_err(obj)?.mesh;
        let material = mesh.material_coordinates().to_vec();
        if material.len() == rest.len() {
            return Ok((rest, material));
        }
        Err(ForeignError {
            path: flat.clone(),
            problem: ForeignProblem::Count {
                what: "the flat mesh".to_owned(),
                unit: "vertices",
                expected: rest.len(),
                found: material.len(),
            },
        })
    }

    /// Frames per second of the trajectory in `folder`: as the options say, or meta.json, or the
    /// paper.
    pub(super) fn rate(&self, folder: &Path) -> Result<f64, ForeignError> {
        if let Some(rate) = self.frame_rate {
            return Ok(rate);
        }
        let meta = folder.join(META);
        let at = |problem| ForeignError {
            path: meta.clone(),
            problem,
        };
        let text = match read_text(&meta) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(PAPER_RATE),
            Err(error) => return Err(at(ForeignProblem::Read(error))),
        };
        let value: Value = serde_json::from_str(&text)
            .map_err(|error| at(ForeignProblem::Layout(format!("is no JSON: {error}"))))?;
        match value.get("dt") {
            None => Ok(PAPER_RATE),
            Some(dt) => match dt.as_f64() {
                Some(dt) if dt.is_finite() && dt > 0.0 => Ok(1.0 / dt),
                _ => {
                    let problem = format!("dt must be a positive time step, found {dt}");
                    Err(at(ForeignProblem::Layout(problem)))
                }
            },
        }
    }
}

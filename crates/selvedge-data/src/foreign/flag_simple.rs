//! DeepMind's `flag_simple`: one tf.train.Example per trajectory, its features raw little-endian
//! arrays whose types and shapes are in meta.json.
//!
//! Used: `world_pos` f32 `[frames, vertices, 3]`, `mesh_pos` f32 `[1, vertices, 2]`, `cells` i32
//! `[1, faces, 3]`, `node_type` i32 `[1, vertices, 1]` (0 free, 3 handle; other types belong to
//! other data sets), and of meta.json `dt` and `trajectory_length`. A mesh that changes over time
//! is an error. Source: Pfaff et al. 2021 and the reader beside their data.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use serde::Deserialize;
use serde_json::{Value, json};

use super::assemble::{Parts, Weight, hanging};
use super::error::{ForeignError, ForeignProblem, RecordProblem};
use super::example::{Example, Feature, decode};
use super::options::{ForeignFormat, ImportOptions, RestSource, positive, refuse};
use super::tfrecord::{self, RecordPlace};
use crate::UpAxis;
use crate::formats::input::read_text;
use crate::formats::obj::read_obj;

pub(super) const META: &str = "meta.json";
const FREE: i32 = 0;
const HANDLE: i32 = 3;

/// Entries of meta.json that are used; the rest is about other programs.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Meta {
    dt: f64,
    trajectory_length: usize,
    features: BTreeMap<String, FeatureMeta>,
}

#[derive(Clone, Debug, Deserialize)]
struct FeatureMeta {
    #[serde(rename = "type")]
    kind: String,
    shape: Vec<i64>,
    dtype: String,
}

/// A feature that is read.
struct Wanted {
    name: &'static str,
    /// Length of a row.
    row: usize,
    dtype: &'static str,
    kind: &'static str,
}

const WORLD_POS: Wanted = wanted("world_pos", 3, "float32", "dynamic");
const MESH_POS: Wanted = wanted("mesh_pos", 2, "float32", "static");
const CELLS: Wanted = wanted("cells", 3, "int32", "static");
const NODE_TYPE: Wanted = wanted("node_type", 1, "int32", "static");

const fn wanted(name: &'static str, row: usize, dtype: &'static str, kind: &'static str) -> Wanted {
    Wanted {
        name,
        row,
        dtype,
        kind,
    }
}

/// Reader of `flag_simple` data.
#[derive(Clone, Debug)]
pub(super) struct FlagSimple {
    meta: Meta,
    density: f64,
    rest: RestSource,
    up: UpAxis,
}

impl FlagSimple {
    /// Reads meta.json in `folder` and checks it and the options.
    pub(super) fn open(folder: &Path, options: &ImportOptions) -> Result<Self, ForeignError> {
        let path = folder.join(META);
        let at = |problem| ForeignError {
            path: path.clone(),
            problem,
        };
        let text = read_text(&path).map_err(|e| at(ForeignProblem::Read(e)))?;
        let meta: Meta = serde_json::from_str(&text).map_err(|e| {
            at(ForeignProblem::Layout(format!(
                "is no meta.json of flag_simple: {e}"
            )))
        })?;
        meta.check().map_err(at)?;
        let settings = Self::settings(meta, options);
        settings.map_err(|problem| ForeignError {
            path: folder.to_owned(),
            problem,
        })
    }

    fn settings(meta: Meta, options: &ImportOptions) -> Result<Self, ForeignProblem> {
        refuse(options.frame_rate.as_ref(), "the time step", "--frame-rate")?;
        refuse(
            options.handles.as_ref(),
            "which vertices are held",
            "--handles",
        )?;
        refuse(
            options.object.as_ref(),
            "which mesh is the cloth",
            "--object",
        )?;
        let coordinates = "the material coordinates";
        refuse(options.flat.as_ref(), coordinates, "--flat")?;
        refuse(
            options.test.first(),
            "which trajectories to test on",
            "--test",
        )?;
        let density = positive(options.density, "--density")?;
        Ok(Self {
            meta,
            density: density.ok_or(ForeignProblem::Missing {
                what: "what the cloth weighs",
                option: "--density",
                hint: "kg/m²; a light fabric has 0.1 to 0.2",
            })?,
            rest: options.rest.clone().unwrap_or(RestSource::Flat),
            up: options.up.unwrap_or(UpAxis::Z),
        })
    }

    /// The resolved options.
    pub(super) fn describe(&self) -> Result<Value, ForeignError> {
        Ok(json!({
            "format": ForeignFormat::FlagSimple,
            "density": self.density,
            "frame_rate": self.frame_rate(),
            "rest": self.rest.describe()?,
            "up": self.up,
        }))
    }

    fn frame_rate(&self) -> f64 {
        1.0 / self.meta.dt
    }

    /// The parts of the trajectory at `place` of the file `path`.
    pub(super) fn read(&self, path: &Path, place: &RecordPlace) -> Result<Parts, ForeignProblem> {
        let mut file = File::open(path).map_err(ForeignProblem::Read)?;
        let data = tfrecord::read(&mut file, place)?;
        let start = place.data_offset();
        let example = decode(&data).map_err(|error| {
            let problem = RecordProblem::Example(error.problem);
            place.error(start + error.at as u64, problem)
        })?;
        let record = Record {
            example,
            place: *place,
        };
        self.parts(&record)
    }

    fn parts(&self, record: &Record<'_>) -> Result<Parts, ForeignProblem> {
        let material: Vec<DVec2> = rows::<2>(&record.floats(&MESH_POS)?)
            .map(DVec2::from_array)
            .collect();
        let vertices = material.len();
        let types = record.integers(&NODE_TYPE)?;
        record.check_count(&NODE_TYPE, types.len(), vertices)?;
        let positions: Vec<DVec3> = rows::<3>(&record.floats(&WORLD_POS)?)
            .map(|p| self.up.to_ours(DVec3::from_array(p)))
            .collect();
        record.check_count(
            &WORLD_POS,
            positions.len(),
            self.meta.trajectory_length.saturating_mul(vertices),
        )?;
        Ok(Parts {
            format: ForeignFormat::FlagSimple,
            faces: record.faces(vertices)?,
            handles: record.handles(&types)?,
            rest: self.rest_positions(&material, &positions)?,
            material,
            positions,
            weight: Weight::Density(self.density),
            frame_rate: self.frame_rate(),
        })
    }

    fn rest_positions(
        &self,
        material: &[DVec2],
        positions: &[DVec3],
    ) -> Result<Vec<DVec3>, ForeignProblem> {
        match &self.rest {
            RestSource::Flat => Ok(hanging(material)),
            RestSource::FirstFrame => Ok(positions[..material.len()].to_vec()),
            RestSource::Obj(path) => {
                let rest = read_obj(path)?.mesh.positions().to_vec();
                if rest.len() != material.len() {
                    return Err(ForeignProblem::Count {
                        what: format!("the rest pose {}", path.display()),
                        unit: "vertices",
                        expected: material.len(),
                        found: rest.len(),
                    });
                }
                Ok(rest)
            }
        }
    }
}

/// The TFRecord files of `folder`, by name.
pub(super) fn record_files(folder: &Path) -> Result<Vec<PathBuf>, ForeignProblem> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(ForeignProblem::Read)? {
        let path = entry.map_err(ForeignProblem::Read)?.path();
        if path.extension().is_some_and(|e| e == "tfrecord") {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        let problem = "has no .tfrecord file: flag_simple has train, valid and test";
        return Err(ForeignProblem::Layout(problem.to_owned()));
    }
    Ok(files)
}

impl Meta {
    fn check(&self) -> Result<(), ForeignProblem> {
        let wrong = |problem: String| Err(ForeignProblem::Layout(problem));
        if !(self.dt.is_finite() && self.dt > 0.0) {
            return wrong(format!(
                "dt must be a positive time step, found {} s",
                self.dt
            ));
        }
        if self.trajectory_length == 0 {
            return wrong("trajectory_length is 0".to_owned());
        }
        for wanted in [WORLD_POS, MESH_POS, CELLS, NODE_TYPE] {
            let Some(found) = self.features.get(wanted.name) else {
                return wrong(format!("features has no {}", wanted.name));
            };
            if found.kind != wanted.kind || found.dtype != wanted.dtype {
                return wrong(format!(
                    "{} is {} {}, expected {} {}",
                    wanted.name, found.kind, found.dtype, wanted.kind, wanted.dtype
                ));
            }
            if found.shape.len() != 3 || found.shape[2] != wanted.row as i64 {
                let (name, shape, row) = (wanted.name, &found.shape, wanted.row);
                return wrong(format!(
                    "{name} has the shape {shape:?}, expected [_, _, {row}]"
                ));
            }
        }
        Ok(())
    }
}

/// A decoded record.
struct Record<'a> {
    example: Example<'a>,
    place: RecordPlace,
}

impl<'a> Record<'a> {
    /// The bytes of a feature, whole rows of 4-byte numbers.
    fn words(&self, wanted: &Wanted) -> Result<&'a [[u8; 4]], ForeignProblem> {
        let start = self.place.data_offset();
        let (at, bytes) = match self.example.features.get(wanted.name) {
            Some(Feature::Bytes(values)) if values.len() == 1 => values[0],
            Some(Feature::Bytes(values)) => {
                let problem = format!("has {} values, expected one", values.len());
                return Err(self.feature_error(wanted, start, problem));
            }
            Some(Feature::Floats | Feature::Integers) => {
                let problem = "is a list of numbers, expected bytes".to_owned();
                return Err(self.feature_error(wanted, start, problem));
            }
            Some(Feature::Empty) | None => {
                return Err(self.feature_error(wanted, start, "is missing".to_owned()));
            }
        };
        let row_bytes = 4 * wanted.row;
        if bytes.is_empty() || !bytes.len().is_multiple_of(row_bytes) {
            let problem = format!(
                "has {} bytes, which is no whole number of rows of {row_bytes}",
                bytes.len()
            );
            return Err(self.feature_error(wanted, start + at as u64, problem));
        }
        Ok(bytes.as_chunks::<4>().0)
    }

    fn floats(&self, wanted: &Wanted) -> Result<Vec<f64>, ForeignProblem> {
        let words = self.words(wanted)?.iter();
        Ok(words.map(|w| f64::from(f32::from_le_bytes(*w))).collect())
    }

    fn integers(&self, wanted: &Wanted) -> Result<Vec<i32>, ForeignProblem> {
        let words = self.words(wanted)?.iter();
        Ok(words.map(|w| i32::from_le_bytes(*w)).collect())
    }

    fn faces(&self, vertices: usize) -> Result<Vec<[u32; 3]>, ForeignProblem> {
        let cells = self.integers(&CELLS)?;
        let exists = |v: &i32| usize::try_from(*v).is_ok_and(|v| v < vertices);
        if let Some(bad) = cells.iter().position(|v| !exists(v)) {
            let (cell, vertex) = (bad / 3, cells[bad]);
            let problem = format!("cell {cell} names vertex {vertex}, of {vertices} vertices");
            return Err(self.feature_error(&CELLS, self.place.data_offset(), problem));
        }
        let (cells, _) = cells.as_chunks::<3>();
        Ok(cells.iter().map(|cell| cell.map(|v| v as u32)).collect())
    }

    fn handles(&self, types: &[i32]) -> Result<Vec<u32>, ForeignProblem> {
        if let Some(vertex) = types.iter().position(|t| ![FREE, HANDLE].contains(t)) {
            let problem = format!(
                "vertex {vertex} has type {}: only free (0) and handle (3) vertices make a cloth",
                types[vertex]
            );
            return Err(self.feature_error(&NODE_TYPE, self.place.data_offset(), problem));
        }
        let numbered = types.iter().zip(0_u32..);
        Ok(numbered
            .filter(|(t, _)| **t == HANDLE)
            .map(|(_, v)| v)
            .collect())
    }

    fn check_count(
        &self,
        wanted: &Wanted,
        found: usize,
        expected: usize,
    ) -> Result<(), ForeignProblem> {
        if found == expected {
            return Ok(());
        }
        let problem =
            format!("has {found} rows, but mesh_pos and trajectory_length give {expected}");
        Err(self.feature_error(wanted, self.place.data_offset(), problem))
    }

    fn feature_error(&self, wanted: &Wanted, offset: u64, problem: String) -> ForeignProblem {
        let feature = wanted.name;
        self.place
            .error(offset, RecordProblem::Feature { feature, problem })
    }
}

fn rows<const N: usize>(values: &[f64]) -> impl Iterator<Item = [f64; N]> + '_ {
    values.as_chunks::<N>().0.iter().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Damage that a checksum would have found, were it not made before the file was written.
    #[test]
    fn damaged_examples_are_errors_or_cloths_never_panics() {
        let folder = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/fixtures/foreign/flag_simple"
        );
        let folder = Path::new(folder);
        let options = ImportOptions {
            density: Some(1.0),
            ..ImportOptions::default()
        };
        let reader = FlagSimple::open(folder, &options).unwrap();
        let mut file = File::open(folder.join("valid.tfrecord")).unwrap();
        let place = tfrecord::scan(&mut file).unwrap()[0];
        let data = tfrecord::read(&mut file, &place).unwrap();
        let mut good = 0;
        for at in 0..data.len() {
            for flip in [0x01, 0x10, 0x7f, 0x80, 0xff] {
                let mut damaged = data.clone();
                damaged[at] ^= flip;
                let Ok(example) = decode(&damaged) else {
                    continue;
                };
                let record = Record { example, place };
                let trajectory = reader.parts(&record).and_then(Parts::trajectory);
                if let Ok(trajectory) = trajectory {
                    // What is taken is whole: no place is out of this world.
                    let mut places = trajectory.positions().iter();
                    assert!(places.all(|p| p.abs().max_element() <= 1e6));
                    good += 1;
                }
            }
        }
        // Half of the bytes are coordinates, of which most changes make other coordinates.
        assert!(good > data.len() && good < 5 * data.len());
    }
}

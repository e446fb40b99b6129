//! Cloths beside the setting's own: the meshes that have a name, at one density, and any that the
//! file describes, on each of which the test motions are run.
//!
//! A trajectory is then called by mesh and motion, as `wide.bouncy`. The motion `apart` fits the
//! handles of each mesh.

use super::{NamedCloth, NamedMotion};
use crate::formats::file_error::Problem;
use crate::scene::{HandleSelection, MeshFile, MeshSpec, field};
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::motion::apart;
use selvedge_cloth::{Handles, Mesh};
use serde::Deserialize;
use std::path::Path;

/// A motion that depends on where the handles are.
const APART: &str = "apart";

impl NamedCloth {
    /// The cloth that `sheet` is at `density` `[vertices/m²]`, and its mesh.
    ///
    /// # Errors
    /// [`Problem`] for a density at which there is no such mesh.
    pub fn of_sheet(sheet: &NamedSheet, density: f64, seed: u64) -> Result<(Self, Mesh), Problem> {
        check_density("meshes.density", density)?;
        let mesh = MeshSpec::from(sheet.of(sheet.vertices(density), seed));
        let built = mesh.build("".as_ref())?;
        let handles = built.labels.get(sheet.handles).cloned();
        let cloth = Self {
            name: sheet.name.to_owned(),
            mesh,
            handles: handles.unwrap_or_default(),
        };
        Ok((cloth, built.mesh))
    }
}

fn check_density(name: &'static str, density: f64) -> Result<(), Problem> {
    if density.is_finite() && density > 0.0 {
        return Ok(());
    }
    let problem = format!("must be finite and positive, found {density} vertices/m²");
    Err(field(name, problem))
}

/// The file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshesFile {
    names: MeshNames,
    density: f64,
    seed: u64,
}

/// A cloth in the file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClothFile {
    name: String,
    mesh: MeshFile,
    handles: HandleSelection,
}

/// Every cloth of a file, each with a name of its own.
pub(super) fn all_of(
    meshes: Option<MeshesFile>,
    cloths: Vec<ClothFile>,
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<Vec<(NamedCloth, Mesh)>, Problem> {
    let mut all = meshes.map_or(Ok(Vec::new()), MeshesFile::resolve)?;
    for cloth in cloths {
        if all.iter().any(|(other, _)| other.name == cloth.name) {
            let problem = format!("two are called {:?}: rename one", cloth.name);
            return Err(field("cloths.name", problem));
        }
        all.push(cloth.resolve(folder, warnings)?);
    }
    Ok(all)
}

impl ClothFile {
    fn resolve(
        self,
        folder: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<(NamedCloth, Mesh), Problem> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if self.name.is_empty() || !self.name.chars().all(is_plain) {
            let problem = format!(
                "{:?} becomes part of the name of a file: take letters, digits, - and _",
                self.name
            );
            return Err(field("cloths.name", problem));
        }
        let mesh = self.mesh.resolve(folder)?;
        let read = mesh.read(folder)?;
        let mended = read.warnings.iter();
        warnings.extend(mended.map(|text| format!("cloths.{}: {text}", self.name)));
        let selected = self.handles.select(&read.sheet)?;
        if !selected.schedule.is_empty() {
            let problem = "has groups that let go, which no model can learn yet: take released out";
            return Err(field("cloths.handles", problem));
        }
        let cloth = NamedCloth {
            name: self.name,
            mesh,
            handles: selected.vertices,
        };
        Ok((cloth, read.sheet.mesh))
    }
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a list of meshes, or \"all\"")]
enum MeshNames {
    All(All),
    Names(Vec<String>),
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum All {
    All,
}

impl MeshesFile {
    /// The cloths and their meshes.
    pub(super) fn resolve(self) -> Result<Vec<(NamedCloth, Mesh)>, Problem> {
        let density = self.density;
        check_density("meshes.density", density)?;
        let sheets: Vec<NamedSheet> = match self.names {
            MeshNames::All(All::All) => named_sheets().to_vec(),
            MeshNames::Names(names) => {
                names.iter().map(|n| by_name(n)).collect::<Result<_, _>>()?
            }
        };
        if sheets.is_empty() {
            return Err(field("meshes.names", "is empty: name at least one mesh"));
        }
        let mut cloths: Vec<(NamedCloth, Mesh)> = Vec::with_capacity(sheets.len());
        for sheet in sheets {
            if cloths.iter().any(|(cloth, _)| cloth.name == sheet.name) {
                return Err(field("meshes.names", format!("has {:?} twice", sheet.name)));
            }
            cloths.push(NamedCloth::of_sheet(&sheet, density, self.seed)?);
        }
        Ok(cloths)
    }
}

fn by_name(name: &str) -> Result<NamedSheet, Problem> {
    NamedSheet::by_name(name).ok_or_else(|| {
        let known: Vec<&str> = named_sheets().iter().map(|sheet| sheet.name).collect();
        let known = known.join(", ");
        field(
            "meshes.names",
            format!("no mesh is called {name:?}; known are {known}"),
        )
    })
}

/// Every motion on every cloth.
pub(super) fn on_each(
    cloths: &[(NamedCloth, Mesh)],
    motions: &[NamedMotion],
) -> Result<Vec<NamedMotion>, Problem> {
    let mut runs = Vec::with_capacity(cloths.len() * motions.len());
    for (cloth, mesh) in cloths {
        for motion in motions {
            let motion_of = match motion.name.as_str() {
                APART => apart_of(cloth, mesh)?,
                _ => motion.motion.clone(),
            };
            runs.push(NamedMotion {
                name: format!("{}.{}", cloth.name, motion.name),
                motion: motion_of,
                cloth: Some(cloth.name.clone()),
            });
        }
    }
    Ok(runs)
}

fn apart_of(cloth: &NamedCloth, mesh: &Mesh) -> Result<selvedge_cloth::Motion, Problem> {
    let handles = Handles::new(&cloth.handles, mesh.topology().vertex_count())?;
    let start = handles.select(mesh.positions());
    Ok(apart(&start)?)
}

//! Cloths beside the setting's own: the meshes that have a name, at one density, and any that the
//! file describes, on each of which the test motions are run, or those that it learns from.
//!
//! A trajectory is then called by mesh and motion, as `wide.bouncy`. The motion `apart` fits the
//! handles of each mesh.

use super::{MotionList, NamedCloth, NamedMotion};
use crate::formats::file_error::Problem;
use crate::obstacle::ObstacleFile;
use crate::scene::{
    HandleSelection, MaterialSource, MeshFile, MeshSpec, field, resolved_obstacles, usual_contact,
};
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::motion::apart;
use selvedge_cloth::{Environment, HandleSchedule, Handles, Mesh, Motion};
use serde::Deserialize;
use std::collections::BTreeMap;
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
            schedule: HandleSchedule::default(),
            material: None,
            environment: None,
            contact: None,
            obstacles: Vec::new(),
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
    material: Option<MaterialSource>,
    environment: Option<Environment>,
    #[serde(default)]
    obstacles: Vec<ObstacleFile>,
    /// Motions of the training split; none for a cloth to test on.
    train: Option<MotionList>,
}

/// A cloth beside the setting's own.
pub(super) struct Other {
    pub(super) cloth: NamedCloth,
    pub(super) mesh: Mesh,
    /// Motions to learn from, where it is not one to test on.
    pub(super) train: Option<Vec<NamedMotion>>,
}

/// Every cloth of a file, each with a name of its own.
pub(super) fn all_of(
    meshes: Option<MeshesFile>,
    cloths: Vec<ClothFile>,
    own: &BTreeMap<String, Motion>,
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<Vec<Other>, Problem> {
    let mut all = meshes.map_or(Ok(Vec::new()), MeshesFile::resolve)?;
    for cloth in cloths {
        if all.iter().any(|other| other.cloth.name == cloth.name) {
            let problem = format!("two are called {:?}: rename one", cloth.name);
            return Err(field("cloths.name", problem));
        }
        all.push(cloth.resolve(own, folder, warnings)?);
    }
    Ok(all)
}

impl ClothFile {
    fn resolve(
        self,
        own: &BTreeMap<String, Motion>,
        folder: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Other, Problem> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if self.name.is_empty() || !self.name.chars().all(is_plain) {
            let problem = format!(
                "{:?} becomes part of the name of a file: take letters, digits, - and _",
                self.name
            );
            return Err(field("cloths.name", problem));
        }
        let mesh = self.mesh.resolve(folder)?;
        let mut read = mesh.read(folder)?;
        let obstacles = resolved_obstacles(self.obstacles, folder)?;
        let contact = (!obstacles.is_empty()).then(|| usual_contact(&mut read));
        let mended = read.warnings.iter();
        warnings.extend(mended.map(|text| format!("cloths.{}: {text}", self.name)));
        let selected = self.handles.select(&read.sheet)?;
        let cloth = NamedCloth {
            name: self.name,
            mesh,
            handles: selected.vertices,
            schedule: selected.schedule,
            material: self
                .material
                .map(|source| source.resolve(folder, &mut Vec::new()))
                .transpose()?,
            environment: self.environment,
            contact,
            obstacles,
        };
        Ok(Other {
            cloth,
            mesh: read.sheet.mesh,
            train: match self.train {
                Some(list) => Some(list.resolve("cloths.train", own)?),
                None => None,
            },
        })
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
    pub(super) fn resolve(self) -> Result<Vec<Other>, Problem> {
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
        let mut cloths: Vec<Other> = Vec::with_capacity(sheets.len());
        for sheet in sheets {
            if cloths.iter().any(|other| other.cloth.name == sheet.name) {
                return Err(field("meshes.names", format!("has {:?} twice", sheet.name)));
            }
            let (cloth, mesh) = NamedCloth::of_sheet(&sheet, density, self.seed)?;
            let train = None;
            cloths.push(Other { cloth, mesh, train });
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

impl Other {
    /// Runs of the cloth in these motions.
    pub(super) fn runs(&self, motions: &[NamedMotion]) -> Result<Vec<NamedMotion>, Problem> {
        let run = |motion: &NamedMotion| {
            Ok(NamedMotion {
                name: format!("{}.{}", self.cloth.name, motion.name),
                motion: match motion.name.as_str() {
                    APART => apart_of(&self.cloth, &self.mesh)?,
                    _ => motion.motion.clone(),
                },
                cloth: Some(self.cloth.name.clone()),
            })
        };
        motions.iter().map(run).collect()
    }
}

fn apart_of(cloth: &NamedCloth, mesh: &Mesh) -> Result<Motion, Problem> {
    let handles = Handles::new(&cloth.handles, mesh.topology().vertex_count())?;
    let start = handles.select(mesh.positions());
    Ok(apart(&start)?)
}

//! Source of a material in a file: the name of a shipped fabric, a TOML file with the keys of a
//! table, or a table that changes one of these or has numbers of its own.

use std::path::{Path, PathBuf};

use selvedge_assets::MATERIALS;
use selvedge_cloth::{BendTable, Compression, Isotropic, Material, StretchTable};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::problem::{field, parse_toml, read_text};
use crate::formats::file_error::Problem;
use crate::formats::input::ending_of;

/// One way to say what the cloth is made of.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum MaterialSource {
    /// The name of a shipped material, or a TOML file, relative to the file that names it.
    Named(String),
    /// A table.
    Table(Box<MaterialTable>),
}

/// A material of one's own: built on exactly one of `from`, `isotropic`, and `stretch` with `bend`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MaterialTable {
    /// A shipped material or a TOML file that is changed.
    from: Option<String>,
    /// The constants of an isotropic sheet.
    isotropic: Option<Isotropic>,
    /// A table of stretching stiffness.
    stretch: Option<StretchTable>,
    /// A table of bending stiffness.
    bend: Option<BendTable>,
    name: Option<String>,
    source: Option<String>,
    density: Option<f64>,
    damping: Option<f64>,
    /// Resistance to being pressed together.
    compression: Option<Compression>,
    /// Factor of the stretching stiffness.
    stretch_multiplier: Option<f64>,
    /// Factor of the bending stiffness.
    bend_multiplier: Option<f64>,
}

/// Files that may be built on each other.
const DEEPEST: usize = 8;

impl<'de> Deserialize<'de> for MaterialSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable;
        impl<'de> Visitor<'de> for NameOrTable {
            type Value = MaterialSource;

            fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("the name of a material, a TOML file, or a table")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<MaterialSource, E> {
                Ok(MaterialSource::Named(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MaterialSource, A::Error> {
                // Not by way of a value, so that errors tell the line of a key.
                let table = MaterialTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(MaterialSource::Table(Box::new(table)))
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}

impl MaterialSource {
    /// Looks up what is named; files are relative to `folder`, and those that were read are added
    /// to `files`.
    pub(crate) fn resolve(
        &self,
        folder: &Path,
        files: &mut Vec<PathBuf>,
    ) -> Result<Material, Problem> {
        let mut chain = Vec::new();
        let resolved = match self {
            Self::Named(name) => named(name, folder, &mut chain),
            Self::Table(table) => table.resolve(folder, &mut chain),
        };
        files.extend(chain);
        resolved.map_err(|problem| field("material", problem))
    }
}

/// The shipped materials: names and TOML texts, the default first.
pub fn materials() -> &'static [(&'static str, &'static str)] {
    MATERIALS
}

/// A fabric: a shipped one by its name, or one of a TOML file, relative to the current folder.
///
/// ```
/// let denim = selvedge_data::open_material("11oz-black-denim")?;
/// assert!(denim.density > 0.3);
/// # Ok::<(), selvedge_data::Problem>(())
/// ```
///
/// # Errors
/// [`Problem`] names the file and the field, or the fabrics that there are.
pub fn open_material(name_or_file: &str) -> Result<Material, Problem> {
    named(name_or_file, Path::new(""), &mut Vec::new()).map_err(Problem)
}

fn material_text(name: &str) -> Option<&'static str> {
    MATERIALS.iter().find(|entry| entry.0 == name).map(|e| e.1)
}

pub(super) fn shipped_material(name: &str) -> Option<Result<Material, Problem>> {
    material_text(name).map(|_| open_material(name))
}

/// A shipped material by name, or one in a TOML file, which is added to the `chain` of files that
/// are built on it.
fn named(name_or_path: &str, folder: &Path, chain: &mut Vec<PathBuf>) -> Result<Material, String> {
    if let Some(text) = material_text(name_or_path) {
        let table = parse_toml::<MaterialTable>(text);
        let table = table.map_err(|problem| problem.to_string())?;
        return table.resolve(folder, chain);
    }
    if ending_of(Path::new(name_or_path)) != "toml" {
        let known: Vec<&str> = MATERIALS.iter().map(|entry| entry.0).collect();
        let known = known.join(", ");
        return Err(format!(
            "{name_or_path:?} is neither a .toml file nor one of {known}"
        ));
    }
    let path = folder.join(name_or_path);
    let within = |problem: String| format!("{}: {problem}", path.display());
    if chain.len() == DEEPEST {
        return Err(within("is built on itself".to_owned()));
    }
    let table = read_text(&path).and_then(|text| parse_toml::<MaterialTable>(&text));
    let table = table.map_err(|problem| within(problem.to_string()))?;
    chain.push(path.clone());
    let folder = path.parent().unwrap_or(folder);
    table.resolve(folder, chain).map_err(within)
}

impl MaterialTable {
    fn resolve(&self, folder: &Path, chain: &mut Vec<PathBuf>) -> Result<Material, String> {
        let mut material = self.base(folder, chain)?;
        material.name = self.name.clone().unwrap_or(material.name);
        material.source = self.source.clone().unwrap_or(material.source);
        material.density = self.density.unwrap_or(material.density);
        material.damping = self.damping.unwrap_or(material.damping);
        material.compression = self.compression.unwrap_or(material.compression);
        let stretch = multiplier("stretch_multiplier", self.stretch_multiplier)?;
        let bend = multiplier("bend_multiplier", self.bend_multiplier)?;
        let material = material.multiplied(stretch, bend);
        material.validate().map_err(|error| error.to_string())?;
        Ok(material)
    }

    /// The material that the table is built on.
    fn base(&self, folder: &Path, chain: &mut Vec<PathBuf>) -> Result<Material, String> {
        let (stretch, bend) = match (&self.from, &self.isotropic, self.stretch, self.bend) {
            (Some(name), None, None, None) => {
                let mut material = named(name, folder, chain)?;
                // What has been changed is no longer the measured fabric.
                material.name += ", changed";
                return Ok(material);
            }
            (None, Some(isotropic), None, None) => {
                isotropic.validate().map_err(|error| error.to_string())?;
                (isotropic.stretch_table(), isotropic.bend_table())
            }
            (None, None, Some(stretch), Some(bend)) => (stretch, bend),
            _ => {
                return Err(
                    "needs exactly one of from, isotropic, and stretch together with bend"
                        .to_owned(),
                );
            }
        };
        Ok(Material {
            name: self.name.clone().ok_or("name is missing")?,
            source: String::new(),
            density: self.density.ok_or("density is missing")?,
            damping: 0.0,
            stretch,
            bend,
            compression: Compression::default(),
        })
    }
}

fn multiplier(field: &str, value: Option<f64>) -> Result<f64, String> {
    match value {
        None => Ok(1.0),
        Some(value) if value.is_finite() && value > 0.0 => Ok(value),
        Some(value) => Err(format!(
            "{field} must be finite and positive, found {value}"
        )),
    }
}

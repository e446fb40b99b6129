//! The cloth of an ARCSim scene: its mesh and how it is placed, and its material.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::{BendTable, Material, StrainLimits, StretchTable};
use serde_json::Value;

use super::super::material_source::shipped_material;
use super::super::mesh_spec::{MeshSource, MeshSpec, Rotate, Transform};
use super::super::problem::SceneProblem;
use super::super::text::read_text;
use super::object::{Object, numbers, parse_json};
use super::parts::Parts;
use super::shared::find_file;
use crate::formats::polygons::{FabricNames, MeshOptions, Sewing};

/// Ranges of factors of a material, of mass per area `[kg/m²]` and of damping `[s]`.
const FACTORS: RangeInclusive<f64> = 1e-6..=1e6;
const DENSITIES: RangeInclusive<f64> = 1e-6..=1e6;
const DAMPING: RangeInclusive<f64> = 0.0..=100.0;

/// Mesh and material of a scene.
pub(super) struct SceneCloth {
    pub(super) mesh: MeshSpec,
    pub(super) material: Material,
    /// Further materials, of the faces with label 1, 2 and so on.
    pub(super) others: Vec<Material>,
    /// The materials' own files, where they have some.
    pub(super) material_files: Vec<PathBuf>,
}

impl SceneCloth {
    /// The further materials by the labels of faces, of which the mesh has these. One that no face
    /// has is warned of, and so is a label without a material.
    pub(super) fn fabrics(
        &self,
        labels: &[String],
        warnings: &mut Vec<String>,
    ) -> BTreeMap<String, Material> {
        let mut fabrics = BTreeMap::new();
        for (number, material) in (1..).zip(&self.others) {
            let label = number.to_string();
            if labels.contains(&label) {
                fabrics.insert(label, material.clone());
            } else {
                warnings.push(format!(
                    "cloths[0].materials[{number}] is left out: no face of the mesh has the label {number}"
                ));
            }
        }
        let count = self.others.len() + 1;
        let has_material = |label: &&String| label.parse().is_ok_and(|n: usize| n < count);
        let others: Vec<&str> = labels
            .iter()
            .filter(|label| !has_material(label))
            .map(String::as_str)
            .collect();
        if !others.is_empty() {
            warnings.push(format!(
                "faces with the label {} have the first material: cloths[0].materials has {count}, of the labels 0 to {}",
                others.join(", "),
                count - 1
            ));
        }
        fabrics
    }
}

/// Reads `cloths`, of which there must be one.
pub(super) fn read(
    scene: &mut Object<'_>,
    folder: &Path,
    parts: &Parts,
    warnings: &mut Vec<String>,
) -> Result<SceneCloth, SceneProblem> {
    let mut cloths = scene.objects("cloths")?;
    let (Some(mut cloth), None) = (cloths.pop(), cloths.pop()) else {
        let count = scene.list("cloths")?.len();
        return Err(scene.wrong("cloths", "must have one cloth", &format!("{count} cloths")));
    };
    let mesh = read_mesh(&mut cloth, folder, warnings)?;
    let mut materials = Vec::new();
    let mut material_files = Vec::new();
    for used in cloth.objects("materials")? {
        let (material, file) = read_material(used, folder, parts, warnings)?;
        materials.push(material);
        material_files.extend(file);
    }
    if materials.is_empty() {
        return Err(cloth.missing("materials"));
    }
    let others = materials.split_off(1);
    let material = materials.swap_remove(0);
    // Remeshing that is not disabled has its own warning.
    cloth.pass_over(&["remeshing"]);
    cloth.finish(warnings);
    Ok(SceneCloth {
        mesh,
        material,
        others,
        material_files,
    })
}

fn read_mesh(
    cloth: &mut Object<'_>,
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<MeshSpec, SceneProblem> {
    let path = cloth.text("mesh")?.ok_or_else(|| cloth.missing("mesh"))?;
    let Some(found) = find_file(path, folder) else {
        let must = "must be an OBJ file beside the scene or in the working directory";
        return Err(cloth.wrong("mesh", must, &path));
    };
    let mut transform = Transform::default();
    if let Some(mut placed) = cloth.child("transform")? {
        transform = Transform {
            scale: placed.number("scale")?.unwrap_or(1.0),
            rotation: read_rotation(&mut placed)?,
            translation: placed.vector("translate")?.unwrap_or_default(),
            ..transform
        };
        placed.finish(warnings);
    }
    let options = MeshOptions {
        fabrics: FabricNames::Labels,
        ..MeshOptions::default()
    };
    Ok(MeshSpec {
        source: MeshSource::obj(&found, folder, options)?,
        transform,
        rest_angles: None,
        sewing: Sewing::default(),
        seam_stiffness: None,
    })
}

/// `rotate`: degrees and axis.
pub(super) fn read_rotation(transform: &mut Object<'_>) -> Result<Rotate, SceneProblem> {
    let [angle_deg, x, y, z] = transform.numbers::<4>("rotate")?.unwrap_or_default();
    let axis = DVec3::new(x, y, z);
    if axis == DVec3::ZERO && angle_deg != 0.0 {
        let found = format!("{angle_deg}° about no axis");
        return Err(transform.wrong("rotate", "must be degrees and an axis", &found));
    }
    let axis = if axis == DVec3::ZERO { DVec3::Y } else { axis };
    Ok(Rotate { axis, angle_deg })
}

/// The material, and the file that it is in.
fn read_material(
    mut used: Object<'_>,
    folder: &Path,
    parts: &Parts,
    warnings: &mut Vec<String>,
) -> Result<(Material, Option<PathBuf>), SceneProblem> {
    let path = used.text("data")?.ok_or_else(|| used.missing("data"))?;
    let (mut material, file) = read_data(path, &used, folder, warnings)?;
    let mut factor = |key, range| -> Result<f64, SceneProblem> {
        Ok(used.number_within(key, range)?.unwrap_or(1.0))
    };
    let [density, stretching, bending, layers] = [
        factor("density_mult", &FACTORS)?,
        factor("stretching_mult", &FACTORS)?,
        // A cloth that does not resist bending is one that can be run.
        factor("bending_mult", &(0.0..=*FACTORS.end()))?,
        factor("thicken", &FACTORS)?,
    ];
    material.density *= density * layers;
    for stiffness in material.stretch.0.as_flattened_mut() {
        *stiffness *= stretching * layers;
    }
    for stiffness in material.bend.0.as_flattened_mut() {
        *stiffness *= bending * layers;
    }
    if let Some(damping) = used.number_within("damping", &DAMPING)? {
        material.damping = damping;
    }
    let limits = used.numbers::<2>("strain_limits")?;
    if !parts.disables("strainlimiting") {
        material.strain_limits = limits.map(|[min, max]| StrainLimits {
            min: min.max(0.0),
            max,
        });
    }
    if parts.disables("plasticity") {
        used.pass_over(&["yield_curv", "weakening"]);
    }
    used.finish(warnings);
    Ok((material, file))
}

/// The material in a file, with that file, or the shipped one of its name where there is no such
/// file.
fn read_data(
    path: &str,
    used: &Object<'_>,
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<(Material, Option<PathBuf>), SceneProblem> {
    let place = used.place("data");
    let name = Path::new(path).file_stem().unwrap_or_default();
    let name = name.to_string_lossy();
    let Some(found) = find_file(path, folder) else {
        let shipped = shipped_material(&name).ok_or_else(|| SceneProblem::Key {
            key: place.clone(),
            problem: format!("there is no file {path}, and no shipped material is called {name}"),
        })??;
        warnings.push(format!(
            "{place}: there is no file {path}: the shipped material {name} is taken"
        ));
        return Ok((shipped, None));
    };
    let within = |problem: SceneProblem| SceneProblem::Key {
        key: place.clone(),
        problem: format!("{path}: {problem}"),
    };
    let file = folder.join(found);
    let text = read_text(&file).map_err(within)?;
    let material = parse_material(&text, &name, warnings).map_err(within)?;
    Ok((material, Some(file)))
}

/// A material in ARCSim's own form: density `[kg/m²]`, six rows of stretching `[N/m]`, three of
/// bending `[N·m]`.
pub(super) fn parse_material(
    text: &str,
    name: &str,
    warnings: &mut Vec<String>,
) -> Result<Material, SceneProblem> {
    let json = parse_json(text)?;
    let mut data = Object::new(&json, String::new())?;
    let material = Material {
        name: name.to_owned(),
        source: format!("{name}.json"),
        density: data
            .number_within("density", &DENSITIES)?
            .ok_or_else(|| data.missing("density"))?,
        damping: 0.0,
        strain_limits: None,
        stretch: StretchTable(rows(&mut data, "stretching")?),
        bend: BendTable(rows(&mut data, "bending")?),
    };
    let mut unread = Vec::new();
    data.finish(&mut unread);
    warnings.extend(
        unread
            .into_iter()
            .map(|text| format!("{name}.json: {text}")),
    );
    Ok(material)
}

fn rows<'a, const R: usize, const C: usize>(
    data: &mut Object<'a>,
    key: &'a str,
) -> Result<[[f64; C]; R], SceneProblem> {
    let value: &Value = data.value(key).ok_or_else(|| data.missing(key))?;
    let rows = value.as_array().and_then(|rows| {
        let rows: Option<Vec<[f64; C]>> = rows.iter().map(numbers).collect();
        rows?.try_into().ok()
    });
    rows.ok_or_else(|| {
        let must = format!("must be {R} rows of {C} numbers");
        data.wrong(key, &must, value)
    })
}

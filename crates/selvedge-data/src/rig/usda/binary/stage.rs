//! From the specs of a crate to prims: the same as text gives.

use super::super::meshes;
use super::super::operations::{Attribute, Samples};
use super::super::prim::{Absence, Prim, Stage};
use super::tables::{ATTRIBUTE, PRIM, PSEUDO_ROOT, Spec, Tables, VARIANT_SET};
use super::values::{Rep, Values};

/// The prims of a crate, with the arrays of meshes where they are wanted, and its stage.
pub(in super::super) fn read(
    bytes: &[u8],
    keeps_arrays: bool,
) -> Result<(Vec<Prim>, Stage), String> {
    let tables = Tables::read(bytes)?;
    let values = Values::new(bytes, tables.version);
    let mut reader = Reader {
        numbers: vec![None; tables.paths.len()],
        tables: &tables,
        values,
        prims: Vec::new(),
        keeps_arrays,
    };
    let mut specs = tables.specs.clone();
    if specs.iter().any(|spec| spec.path >= tables.paths.len()) {
        return Err("has a spec without a path: it was changed".to_owned());
    }
    // What is above comes before what is in it.
    specs.sort_by_key(|spec| tables.paths[spec.path].order);
    let mut stage = Stage::default();
    for spec in specs {
        match spec.kind {
            PSEUDO_ROOT => stage = reader.stage(spec)?,
            PRIM => reader.prim(spec)?,
            ATTRIBUTE => reader.attribute(spec)?,
            kind if kind >= VARIANT_SET - 1 => {
                if let Some(prim) = reader.above(spec) {
                    prim.composes("variants");
                }
            }
            _ => {}
        }
    }
    Ok((reader.prims, stage))
}

struct Reader<'a> {
    tables: &'a Tables,
    values: Values<'a>,
    /// Number of the prim at each path.
    numbers: Vec<Option<usize>>,
    prims: Vec<Prim>,
    keeps_arrays: bool,
}

impl Reader<'_> {
    fn above(&mut self, spec: Spec) -> Option<&mut Prim> {
        let above = self.tables.paths[spec.path].above?;
        let number = self.numbers[above]?;
        self.prims.get_mut(number)
    }

    fn token(&self, rep: Rep) -> &str {
        let token = self.tables.tokens.get(rep.low() as usize);
        token.map(String::as_str).unwrap_or_default()
    }

    fn stage(&self, spec: Spec) -> Result<Stage, String> {
        let mut stage = Stage::default();
        let positive = |name: &str, rep: Rep| match self.values.numbers(rep)?.as_deref() {
            Some(&[number]) if number > 0.0 && number.is_finite() => Ok(number),
            found => Err(format!("{name} must be positive, found {found:?}")),
        };
        for (name, rep) in self.tables.fields(spec)? {
            match name {
                "timeCodesPerSecond" => stage.codes_per_second = Some(positive(name, rep)?),
                "framesPerSecond" => stage.frames_per_second = Some(positive(name, rep)?),
                "startTimeCode" | "endTimeCode" => {
                    let code = self.values.numbers(rep)?;
                    let code = code.and_then(|code| code.first().copied());
                    match name {
                        "startTimeCode" => stage.start_code = code,
                        _ => stage.end_code = code,
                    }
                }
                "metersPerUnit" => stage.metres_per_unit = positive(name, rep)?,
                "upAxis" => {
                    stage.is_z_up = match self.token(rep) {
                        "Y" => false,
                        "Z" => true,
                        found => return Err(format!("upAxis: expected Y or Z, found {found:?}")),
                    };
                }
                "subLayers" if rep.is_strings() => {
                    return Err(
                        "has sublayers, which are not followed: flatten it (usdcat --flatten)"
                            .to_owned(),
                    );
                }
                _ => {}
            }
        }
        Ok(stage)
    }

    fn prim(&mut self, spec: Spec) -> Result<(), String> {
        let path = &self.tables.paths[spec.path];
        let mut prim = Prim {
            name: path.name.clone(),
            parent: path.above.and_then(|above| self.numbers[above]),
            ..Prim::default()
        };
        for (name, rep) in self.tables.fields(spec)? {
            match name {
                "typeName" => self.token(rep).clone_into(&mut prim.kind),
                "specifier" if rep.low() != 0 => prim.specifies(rep.low() != 1),
                "active" if rep.low() == 0 => prim.is_absent(Absence::Inactive),
                "references" => match self.values.reference(rep)? {
                    Some((text, path)) if self.tables.is_empty_text(text) => {
                        prim.reference = Some(self.tables.path(path));
                    }
                    _ => prim.composes(name),
                },
                "payload" | "inheritPaths" | "specializes" | "variantSetNames" => {
                    prim.composes(name);
                }
                _ => {}
            }
        }
        self.numbers[spec.path] = Some(self.prims.len());
        self.prims.push(prim);
        Ok(())
    }

    fn attribute(&mut self, spec: Spec) -> Result<(), String> {
        let tables = self.tables;
        let path = &tables.paths[spec.path];
        if !path.is_property {
            return Ok(());
        }
        let fields = tables.fields(spec)?;
        let find = |wanted: &str| fields.iter().find(|field| field.0 == wanted).map(|f| f.1);
        let kind = find("typeName")
            .map_or("", |rep| self.token(rep))
            .to_owned();
        let (name, default) = (path.name.as_str(), find("default"));
        if name == "xformOpOrder" {
            let order = default.map(|rep| self.values.tokens(rep)).transpose()?;
            let order = order.flatten().unwrap_or_default();
            let text = |token: usize| tables.tokens.get(token).cloned().unwrap_or_default();
            let order = order.into_iter().map(text).collect();
            if let Some(prim) = self.above(spec) {
                prim.order = Some(order);
            }
            return Ok(());
        }
        let token = default.map(|rep| self.token(rep).to_owned());
        if let Some(prim) = self.above(spec) {
            prim.says(name, &token.unwrap_or_default());
            prim.is_skinned |= meshes::is_of_skeleton(name);
            prim.is_timed |= name == "visibility" && find("timeSamples").is_some();
        }
        let array = meshes::array_of(&kind, name).filter(|_| self.keeps_arrays);
        if array.is_none() && !name.starts_with("xformOp:") {
            return Ok(());
        }
        if find("connectionPaths").is_some() && array.is_none() {
            if let Some(prim) = self.above(spec) {
                let problem = format!("its {name} is not understood here: bake it to samples");
                prim.obstacle = Some(problem);
            }
            return Ok(());
        }
        let timed = find("timeSamples").map(|rep| self.values.samples(rep));
        let mut samples = Vec::new();
        let timed = timed.transpose()?.flatten();
        for &(code, rep) in timed.iter().flatten() {
            // Of an array that is not of points the first counts.
            let is_done = array.as_ref().is_some_and(|a| a != meshes::POINTS);
            if rep.is_block() || is_done && !samples.is_empty() {
                continue;
            }
            match self.values.numbers(rep)? {
                None if array.is_some() => {}
                numbers => samples.push((code, numbers.unwrap_or_default())),
            }
        }
        let is_timed = !samples.is_empty() || timed.is_some() && array.is_none();
        let samples = match default {
            _ if is_timed => Samples::Timed(samples),
            None => return Ok(()),
            Some(rep) => match self.values.numbers(rep)? {
                None if array.is_some() => return Ok(()),
                numbers => Samples::Constant(numbers.unwrap_or_default()),
            },
        };
        if let Some(prim) = self.above(spec) {
            prim.attributes.push(Attribute {
                name: array.unwrap_or_else(|| name.to_owned()),
                samples,
                line: 0,
            });
        }
        Ok(())
    }
}

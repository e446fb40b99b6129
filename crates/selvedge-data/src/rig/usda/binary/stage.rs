//! From the specs of a crate to prims: the same as text gives.

use super::super::meshes;
use super::super::operations::{Attribute, Samples};
use super::super::prim::{Absence, Kept, Prim, Stage};
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
                if let Some(number) = reader.above(spec) {
                    reader.prims[number].composes("variants");
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

impl<'a> Reader<'a> {
    /// The number of the prim above.
    fn above(&self, spec: Spec) -> Option<usize> {
        self.numbers[self.tables.paths[spec.path].above?]
    }

    fn token(&self, rep: Rep) -> &'a str {
        let token = self.tables.tokens.get(rep.low() as usize);
        token.map(String::as_str).unwrap_or_default()
    }

    fn stage(&self, spec: Spec) -> Result<Stage, String> {
        let mut stage = Stage::default();
        for (name, rep) in self.tables.fields(spec)? {
            if name == "subLayers" && rep.is_strings() {
                let problem =
                    "has sublayers, which are not followed: flatten it (usdcat --flatten)";
                return Err(problem.to_owned());
            }
            let numbers = self.values.numbers(rep)?.unwrap_or_default();
            stage.set(name, numbers.first().copied(), self.token(rep))?;
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
        let (true, Some(number)) = (path.is_property, self.above(spec)) else {
            return Ok(());
        };
        let fields = tables.fields(spec)?;
        let find = |wanted: &str| fields.iter().find(|field| field.0 == wanted).map(|f| f.1);
        let kind = find("typeName").map_or("", |rep| self.token(rep));
        let (name, default, timed) = (path.name.as_str(), find("default"), find("timeSamples"));
        let token = default.map(|rep| self.token(rep));
        let prim = &mut self.prims[number];
        let wants = self.keeps_arrays;
        let array = match prim.takes_property(kind, name, token, timed.is_some(), wants) {
            Kept::Nothing => return Ok(()),
            Kept::Order => {
                let order = default.map(|rep| self.values.tokens(rep)).transpose()?;
                let order = order.flatten().unwrap_or_default().into_iter();
                let text = |token: usize| tables.tokens.get(token).cloned().unwrap_or_default();
                prim.order = Some(order.map(text).collect());
                return Ok(());
            }
            Kept::Operation if find("connectionPaths").is_some() => {
                prim.connects(name);
                return Ok(());
            }
            Kept::Operation => None,
            Kept::Array(array) => Some(array),
        };
        let (is_timed, samples) = self.samples(array.as_deref(), default, timed)?;
        if is_timed || !samples.is_empty() {
            self.prims[number].attributes.push(Attribute {
                name: array.unwrap_or_else(|| name.to_owned()),
                is_timed,
                samples,
                line: 0,
            });
        }
        Ok(())
    }

    /// The values of an operation, or of an `array`, and true where they change in time; none where
    /// an array has none.
    fn samples(
        &self,
        array: Option<&str>,
        default: Option<Rep>,
        timed: Option<Rep>,
    ) -> Result<(bool, Samples), String> {
        let timed = timed.map(|rep| self.values.samples(rep)).transpose()?;
        let timed = timed.flatten();
        let mut samples = Vec::new();
        for &(code, rep) in timed.iter().flatten() {
            // Of an array that is not of points the first counts.
            let is_done = array.is_some_and(|a| a != meshes::POINTS) && !samples.is_empty();
            if rep.is_block() || is_done {
                continue;
            }
            match self.values.numbers(rep)? {
                None if array.is_some() => {}
                numbers => samples.push((code, numbers.unwrap_or_default())),
            }
        }
        let is_timed = !samples.is_empty() || timed.is_some() && array.is_none();
        if let (false, Some(rep)) = (is_timed, default) {
            let numbers = self.values.numbers(rep)?;
            if array.is_none() || numbers.is_some() {
                samples.push((0.0, numbers.unwrap_or_default()));
            }
        }
        Ok((is_timed, samples))
    }
}

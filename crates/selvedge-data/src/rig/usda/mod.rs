//! Nodes and their animation from USD, as text (.usda), as a binary crate (.usdc) or in an archive
//! (.usdz): prims with `xformOp:` attributes, their time
//! samples, and `xformOpOrder`; `upAxis`, `metersPerUnit` and `timeCodesPerSecond` of the stage.
//!
//! Everything else is passed over by its brackets. A reference to a prim of the same file is
//! followed, as flattening leaves it of instances. Not understood, and an error where meshes are
//! read or a node is followed: what else comes from other files or prims (references, payloads,
//! inherits, specializes, variants); for a node, `over` and `class` too. Sublayers are an error
//! always. Samples are joined linearly, as USD does by itself.
//!
//! Conventions of USD: a list of operations goes from the outermost to the innermost; matrices have
//! their translation in the last row; quaternions begin with the real part; angles are in degrees.
//!
//! Format: the USD documentation, "Usd ASCII" and `UsdGeomXformable`.

mod binary;
mod meshes;
mod operations;
mod package;
mod prim;
mod references;
mod tokens;

use self::operations::{Attribute, Samples};
use self::prim::{Absence, Prim, Stage, rig};
use self::tokens::{Token, Tokens, in_line};
use super::error::RigError;
use super::moving_mesh::MovingMesh;
use super::node::Rig;
use super::node_mesh::NodeMesh;

/// Prims within prims, and brackets within brackets, at most.
const DEEPEST: usize = 200;

/// The rig in the bytes of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Rig, RigError> {
    let (prims, stage) = read(bytes, false)?;
    Ok(rig(&prims, &stage))
}

/// The rig in the bytes of a file, and its meshes as they move.
pub(super) fn parse_bodies(bytes: &[u8]) -> Result<(Rig, Vec<MovingMesh>), RigError> {
    let (mut prims, stage) = read(bytes, true)?;
    let rate = stage.rate();
    let mut rig = rig(&prims, &stage);
    let mut made = Vec::new();
    for mesh in meshes::meshes(&prims, &mut rig.warnings)? {
        let prim = &mut prims[mesh.node];
        let timed = prim.take_samples(meshes::POINTS);
        made.push(meshes::moving(mesh, timed, rate, &prim.name)?);
    }
    Ok((rig, made))
}

/// The rig in the bytes of a file, and the meshes of its prims.
pub(super) fn parse_meshes(bytes: &[u8]) -> Result<(Rig, Vec<NodeMesh>), RigError> {
    let (prims, stage) = read(bytes, true)?;
    let mut rig = rig(&prims, &stage);
    let meshes = meshes::meshes(&prims, &mut rig.warnings)?;
    Ok((rig, meshes))
}

/// The prims of a file, with the arrays of meshes where they are wanted, and its stage.
fn read(bytes: &[u8], keeps_arrays: bool) -> Result<(Vec<Prim>, Stage), RigError> {
    let (mut prims, stage) = layer(bytes, keeps_arrays)?;
    references::follow(&mut prims).map_err(RigError::Content)?;
    Ok((prims, stage))
}

/// As [`read`], before references are followed.
fn layer(bytes: &[u8], keeps_arrays: bool) -> Result<(Vec<Prim>, Stage), RigError> {
    if bytes.starts_with(package::ZIP) {
        let inside = package::first_file(bytes).map_err(RigError::Content)?;
        // The file in an archive is no archive.
        if !inside.starts_with(package::ZIP) {
            return layer(inside, keeps_arrays);
        }
    }
    if bytes.starts_with(binary::MAGIC) {
        return binary::read(bytes, keeps_arrays).map_err(RigError::Content);
    }
    let text = std::str::from_utf8(bytes).map_err(|_| in_line(1, "is not text (UTF-8)"))?;
    let header = text.lines().next().unwrap_or_default();
    if !header.starts_with("#usda 1.") {
        let found: String = header.chars().take(40).collect();
        return Err(in_line(1, format!("expected #usda 1.0, found {found:?}")));
    }
    let mut reader = Reader {
        tokens: Tokens::new(text),
        prims: Vec::new(),
        keeps_arrays,
    };
    let stage = reader.stage()?;
    while reader.tokens.peek()?.is_some() {
        reader.prim(None, 0)?;
    }
    Ok((reader.prims, stage))
}

struct Reader<'a> {
    tokens: Tokens<'a>,
    prims: Vec<Prim>,
    keeps_arrays: bool,
}

impl<'a> Reader<'a> {
    /// The metadata of the stage.
    fn stage(&mut self) -> Result<Stage, RigError> {
        let mut stage = Stage::default();
        if !self.tokens.skip_if("(")? {
            return Ok(stage);
        }
        while !self.tokens.skip_if(")")? {
            let token = self.tokens.next()?;
            let Token::Word(key) = token else { continue };
            if key == "subLayers" {
                return Err(self.tokens.wrong(
                    "the stage has sublayers, which are not followed: flatten it (usdcat --flatten)",
                ));
            }
            if !self.tokens.skip_if("=")? {
                continue;
            }
            match key {
                "timeCodesPerSecond" => stage.codes_per_second = Some(self.positive(key)?),
                "startTimeCode" => stage.start_code = Some(self.tokens.number()?),
                "endTimeCode" => stage.end_code = Some(self.tokens.number()?),
                "framesPerSecond" => stage.frames_per_second = Some(self.positive(key)?),
                "metersPerUnit" => stage.metres_per_unit = self.positive(key)?,
                "upAxis" => {
                    stage.is_z_up = match self.tokens.next()? {
                        Token::Text("Y") => false,
                        Token::Text("Z") => true,
                        found => {
                            let found = format!("upAxis: expected \"Y\" or \"Z\", found {found}");
                            return Err(self.tokens.wrong(found));
                        }
                    };
                }
                _ => self.skip_value()?,
            }
        }
        Ok(stage)
    }

    fn positive(&mut self, key: &str) -> Result<f64, RigError> {
        let value = self.tokens.number()?;
        if value > 0.0 {
            return Ok(value);
        }
        let problem = format!("{key} must be positive, found {value}");
        Err(self.tokens.wrong(problem))
    }

    /// `def Type "name" ( … ) { … }`.
    fn prim(&mut self, parent: Option<usize>, depth: usize) -> Result<(), RigError> {
        if depth > DEEPEST {
            return Err(self.tokens.wrong("prims are nested too deeply"));
        }
        let mut prim = Prim {
            parent,
            ..Prim::default()
        };
        match self.tokens.next()? {
            Token::Word("def") => {}
            Token::Word(word @ ("over" | "class")) => prim.specifies(word == "class"),
            found => {
                let problem = format!("expected def, over or class, found {found}");
                return Err(self.tokens.wrong(problem));
            }
        }
        if let Some(Token::Word(kind)) = self.tokens.peek()? {
            kind.clone_into(&mut prim.kind);
            self.tokens.next()?;
        }
        prim.name = match self.tokens.next()? {
            Token::Text(name) => name.to_owned(),
            found => {
                let problem = format!("expected the name of a prim, found {found}");
                return Err(self.tokens.wrong(problem));
            }
        };
        if self.tokens.skip_if("(")? {
            self.prim_metadata(&mut prim)?;
        }
        self.tokens.expect("{")?;
        let number = self.prims.len();
        self.prims.push(prim);
        while !self.tokens.skip_if("}")? {
            self.statement(number, depth)?;
        }
        Ok(())
    }

    /// Passes over the metadata of a prim; what in it brings more from elsewhere.
    fn prim_metadata(&mut self, prim: &mut Prim) -> Result<(), RigError> {
        while !self.tokens.skip_if(")")? {
            if let Token::Word(key) = self.tokens.next()? {
                let composes = matches!(
                    key,
                    "references"
                        | "payload"
                        | "inherits"
                        | "specializes"
                        | "variants"
                        | "variantSets"
                );
                if !self.tokens.skip_if("=")? {
                    continue;
                }
                if key == "active" {
                    let found = self.tokens.next()?;
                    if matches!(found, Token::Word("false" | "0")) {
                        prim.is_absent(Absence::Inactive);
                    }
                    continue;
                }
                match (composes, self.composed()?) {
                    (true, Some(path)) if key == "references" => {
                        prim.reference = Some(path.to_owned());
                    }
                    (true, _) => prim.composes(key),
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Passes over what a prim brings from elsewhere, with its offset in time; the path of a prim
    /// of the same file, where that is all.
    fn composed(&mut self) -> Result<Option<&'a str>, RigError> {
        let path = match self.tokens.peek()? {
            Some(Token::Path(path)) if !path.is_empty() => Some(path),
            _ => None,
        };
        self.skip_value()?;
        let has_offset = self.tokens.peek()? == Some(Token::Sign("("));
        if has_offset {
            self.skip_value()?;
        }
        Ok(path.filter(|_| !has_offset))
    }

    /// A prim or a property within prim `number`.
    fn statement(&mut self, number: usize, depth: usize) -> Result<(), RigError> {
        match self.tokens.peek()? {
            Some(Token::Word("def" | "over" | "class")) => self.prim(Some(number), depth + 1),
            Some(Token::Word("variantSet")) => self.variants(number),
            Some(Token::Sign(";")) => self.tokens.next().map(drop),
            Some(Token::Word(_)) => self.property(number),
            _ => {
                let found = self.tokens.next()?;
                let problem = format!("expected a property or a prim, found {found}");
                Err(self.tokens.wrong(problem))
            }
        }
    }

    fn variants(&mut self, number: usize) -> Result<(), RigError> {
        self.tokens.next()?;
        self.tokens.next()?;
        self.tokens.expect("=")?;
        self.skip_value()?;
        self.prims[number].composes("variants");
        Ok(())
    }

    /// `[words] type[] name[.timeSamples] [= value] [( … )]`.
    fn property(&mut self, number: usize) -> Result<(), RigError> {
        let (mut name, mut kind) = ("", "");
        while let Some(Token::Word(word)) = self.tokens.peek()? {
            // A new statement begins where the last one had no value.
            if !name.is_empty() && self.tokens.is_at_line_start() {
                break;
            }
            (kind, name) = (name, word);
            self.tokens.next()?;
            if self.tokens.skip_if("[")? {
                self.tokens.expect("]")?;
            }
        }
        if self.tokens.skip_if("=")? {
            self.value_of(number, kind, name)?;
        }
        if self.tokens.skip_if("(")? {
            self.skip_to(")", 0)?;
        }
        Ok(())
    }

    fn value_of(&mut self, number: usize, kind: &str, name: &'a str) -> Result<(), RigError> {
        if name == "xformOpOrder" {
            let order = self.texts()?;
            self.prims[number].order = Some(order);
            return Ok(());
        }
        if let Some(Token::Text(token)) = self.tokens.peek()? {
            self.prims[number].says(name, token);
        }
        self.prims[number].is_skinned |= meshes::is_of_skeleton(name);
        self.prims[number].is_timed |= name == "visibility.timeSamples";
        let array = meshes::array_of(kind, name).filter(|_| self.keeps_arrays);
        let is_array = array.is_some();
        if !is_array && !name.starts_with("xformOp:") {
            return self.skip_value();
        }
        if !is_array && name.ends_with(".connect") {
            self.skip_value()?;
            let problem = format!("its {name} is not understood here: bake it to samples");
            self.prims[number].obstacle = Some(problem);
            return Ok(());
        }
        let line = self.tokens.line_of_last();
        let (own, samples) = match name.strip_suffix(".timeSamples") {
            Some(own) => match self.time_samples(is_array)? {
                samples if is_array && samples.is_empty() => return Ok(()),
                samples => (own, Samples::Timed(samples)),
            },
            None => match self.value(is_array)? {
                Some(numbers) => (name, Samples::Constant(numbers)),
                None => return Ok(()),
            },
        };
        self.prims[number].attributes.push(Attribute {
            name: array.unwrap_or_else(|| own.to_owned()),
            samples,
            line,
        });
        Ok(())
    }

    /// The numbers of an array, if it is one, or of a transform.
    fn value(&mut self, is_array: bool) -> Result<Option<Vec<f64>>, RigError> {
        match is_array {
            true => self.bracketed(),
            false => self.numbers().map(Some),
        }
    }

    /// `[(0, 0, 0), …]`; none for another value, which is passed over.
    fn bracketed(&mut self) -> Result<Option<Vec<f64>>, RigError> {
        if !self.tokens.skip_if("[")? {
            self.skip_value()?;
            return Ok(None);
        }
        let mut numbers = Vec::new();
        while !self.tokens.skip_if("]")? {
            let is_sign = matches!(self.tokens.peek()?, Some(Token::Sign("(" | ")" | ",")));
            if is_sign {
                self.tokens.next()?;
            } else {
                numbers.push(self.tokens.number()?);
            }
        }
        Ok(Some(numbers))
    }

    /// `{ code: value, … }`.
    fn time_samples(&mut self, is_array: bool) -> Result<Vec<(f64, Vec<f64>)>, RigError> {
        self.tokens.expect("{")?;
        let mut samples = Vec::new();
        while !self.tokens.skip_if("}")? {
            let code = self.tokens.number()?;
            self.tokens.expect(":")?;
            if let Some(numbers) = self.value(is_array)? {
                samples.push((code, numbers));
            }
            self.tokens.skip_if(",")?;
        }
        Ok(samples)
    }

    /// A number, or numbers in parentheses, one after another.
    fn numbers(&mut self) -> Result<Vec<f64>, RigError> {
        let mut numbers = Vec::new();
        let mut depth = 0;
        loop {
            if self.tokens.skip_if("(")? {
                depth += 1;
            } else if depth > 0 && self.tokens.skip_if(")")? {
                depth -= 1;
            } else if depth == 0 || !self.tokens.skip_if(",")? {
                numbers.push(self.tokens.number()?);
            }
            // No transform has more than the 16 numbers of a matrix.
            if numbers.len() > 16 || depth > 2 {
                return Err(self.tokens.wrong("a transform has too many numbers"));
            }
            if depth == 0 {
                return Ok(numbers);
            }
        }
    }

    /// `["a", "b"]`.
    fn texts(&mut self) -> Result<Vec<String>, RigError> {
        self.tokens.expect("[")?;
        let mut texts = Vec::new();
        while !self.tokens.skip_if("]")? {
            match self.tokens.next()? {
                Token::Text(text) => texts.push(text.to_owned()),
                Token::Sign(",") => {}
                found => {
                    let problem = format!("expected a text in quotes, found {found}");
                    return Err(self.tokens.wrong(problem));
                }
            }
        }
        Ok(texts)
    }

    /// Passes over a value: one token, or all within its brackets.
    fn skip_value(&mut self) -> Result<(), RigError> {
        match self.tokens.next()? {
            Token::Sign("(") => self.skip_to(")", 0),
            Token::Sign("[") => self.skip_to("]", 0),
            Token::Sign("{") => self.skip_to("}", 0),
            // An asset may be followed by the path of a prim in it.
            Token::Asset => match self.tokens.peek()? {
                Some(Token::Path(_)) => self.tokens.next().map(drop),
                _ => Ok(()),
            },
            _ => Ok(()),
        }
    }

    fn skip_to(&mut self, end: &str, depth: usize) -> Result<(), RigError> {
        if depth > DEEPEST {
            return Err(self.tokens.wrong("brackets are nested too deeply"));
        }
        loop {
            match self.tokens.next()? {
                Token::Sign(sign) if sign == end => return Ok(()),
                Token::Sign("(") => self.skip_to(")", depth + 1)?,
                Token::Sign("[") => self.skip_to("]", depth + 1)?,
                Token::Sign("{") => self.skip_to("}", depth + 1)?,
                Token::Sign(sign @ (")" | "]" | "}")) => {
                    let problem = format!("expected {end}, found {sign}");
                    return Err(self.tokens.wrong(problem));
                }
                _ => {}
            }
        }
    }
}

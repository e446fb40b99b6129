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
use self::prim::{Absence, Kept, Prim, Stage, rig};
use self::tokens::{Token, Tokens, in_line};
use super::node::{Rig, RigError, Wanted};

/// Prims within prims at most.
const DEEPEST: usize = 200;

/// The rig in the bytes of a file.
pub(super) fn parse(bytes: &[u8], wanted: Wanted<'_>) -> Result<Rig, RigError> {
    let (mut prims, stage) = layer(bytes, !matches!(wanted, Wanted::Nodes(_)))?;
    references::follow(&mut prims).map_err(RigError::Content)?;
    let mut rig = rig(&prims, &stage);
    if !matches!(wanted, Wanted::Nodes(_)) {
        rig.meshes = meshes::meshes(&prims, wanted == Wanted::Meshes, &mut rig.warnings)?;
    }
    if wanted != Wanted::Meshes {
        for mesh in &mut rig.meshes {
            meshes::move_points(mesh, &mut prims[mesh.node], stage.rate())?;
        }
    }
    Ok(rig)
}

/// The prims of a file, with the arrays of meshes where they are wanted, and its stage; references
/// are not followed yet.
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
            let (number, token) = match self.tokens.peek()? {
                Some(Token::Word(word)) => (word.parse().ok(), ""),
                Some(Token::Text(text)) => (None, text),
                _ => (None, ""),
            };
            self.skip_value()?;
            let set = stage.set(key, number, token);
            set.map_err(|problem| self.tokens.wrong(problem))?;
        }
        Ok(stage)
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
            found => return Err(self.tokens.expected("def, over or class", found)),
        }
        if let Some(Token::Word(kind)) = self.tokens.peek()? {
            kind.clone_into(&mut prim.kind);
            self.tokens.next()?;
        }
        prim.name = match self.tokens.next()? {
            Token::Text(name) => name.to_owned(),
            found => return Err(self.tokens.expected("the name of a prim", found)),
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
            let Token::Word(key) = self.tokens.next()? else {
                continue;
            };
            if !self.tokens.skip_if("=")? {
                continue;
            }
            if key == "active" {
                if let Token::Word("false" | "0") = self.tokens.next()? {
                    prim.is_absent(Absence::Inactive);
                }
                continue;
            }
            match (key, self.composed()?) {
                ("references", Some(path)) => prim.reference = Some(path.to_owned()),
                ("references" | "payload" | "inherits", _)
                | ("specializes" | "variants" | "variantSets", _) => prim.composes(key),
                _ => {}
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
                Err(self.tokens.expected("a property or a prim", found))
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
            self.skip_to(")")?;
        }
        Ok(())
    }

    fn value_of(&mut self, number: usize, kind: &str, name: &'a str) -> Result<(), RigError> {
        let (own, of) = name.split_once('.').unwrap_or((name, ""));
        let is_timed = of == "timeSamples";
        let token = match self.tokens.peek()? {
            Some(Token::Text(token)) if of.is_empty() => Some(token),
            _ => None,
        };
        let prim = &mut self.prims[number];
        let array = match prim.takes_property(kind, own, token, is_timed, self.keeps_arrays) {
            Kept::Order if of.is_empty() => {
                let order = self.texts()?;
                self.prims[number].order = Some(order);
                return Ok(());
            }
            Kept::Nothing | Kept::Order => return self.skip_value(),
            Kept::Operation if of == "connect" => {
                prim.connects(name);
                return self.skip_value();
            }
            Kept::Array(_) if of == "connect" => return self.skip_value(),
            Kept::Operation => None,
            Kept::Array(array) => Some(array),
        };
        let (line, is_array) = (self.tokens.line_of_last(), array.is_some());
        let samples = if is_timed {
            self.time_samples(is_array)?
        } else {
            Vec::from_iter(self.value(is_array)?.map(|numbers| (0.0, numbers)))
        };
        if !(is_array && samples.is_empty()) {
            self.prims[number].attributes.push(Attribute {
                name: array.unwrap_or_else(|| own.to_owned()),
                is_timed,
                samples,
                line,
            });
        }
        Ok(())
    }

    /// The numbers of a transform, one or those in parentheses; or of an array, `[(0, 0, 0), …]`,
    /// none for another value, which is passed over.
    fn value(&mut self, is_array: bool) -> Result<Option<Vec<f64>>, RigError> {
        if !self.tokens.skip_if(if is_array { "[" } else { "(" })? {
            if is_array {
                return self.skip_value().map(|()| None);
            }
            return Ok(Some(vec![self.tokens.number()?]));
        }
        let mut numbers = Vec::new();
        let mut open = 1;
        while open > 0 {
            match self.tokens.peek()? {
                Some(Token::Sign("]")) if is_array => open = 0,
                Some(Token::Sign("(")) if !is_array => open += 1,
                Some(Token::Sign(")")) if !is_array => open -= 1,
                Some(Token::Sign("(" | ")" | ",")) => {}
                _ => {
                    numbers.push(self.tokens.number()?);
                    continue;
                }
            }
            self.tokens.next()?;
        }
        Ok(Some(numbers))
    }

    /// `{ code: value, … }`.
    fn time_samples(&mut self, is_array: bool) -> Result<Samples, RigError> {
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

    /// `["a", "b"]`.
    fn texts(&mut self) -> Result<Vec<String>, RigError> {
        self.tokens.expect("[")?;
        let mut texts = Vec::new();
        while !self.tokens.skip_if("]")? {
            match self.tokens.next()? {
                Token::Text(text) => texts.push(text.to_owned()),
                Token::Sign(",") => {}
                found => return Err(self.tokens.expected("a text in quotes", found)),
            }
        }
        Ok(texts)
    }

    /// Passes over a value: one token, or all within its brackets.
    fn skip_value(&mut self) -> Result<(), RigError> {
        match self.tokens.next()? {
            Token::Sign("(") => self.skip_to(")"),
            Token::Sign("[") => self.skip_to("]"),
            Token::Sign("{") => self.skip_to("}"),
            // An asset may be followed by the path of a prim in it.
            Token::Asset => match self.tokens.peek()? {
                Some(Token::Path(_)) => self.tokens.next().map(drop),
                _ => Ok(()),
            },
            _ => Ok(()),
        }
    }

    /// Passes over all to the `end` of a bracket that is open, with the brackets in it.
    fn skip_to(&mut self, end: &'static str) -> Result<(), RigError> {
        let mut open = vec![end];
        while let Some(&end) = open.last() {
            match self.tokens.next()? {
                Token::Sign("(") => open.push(")"),
                Token::Sign("[") => open.push("]"),
                Token::Sign("{") => open.push("}"),
                Token::Sign(sign) if sign == end => drop(open.pop()),
                found @ Token::Sign(")" | "]" | "}") => {
                    return Err(self.tokens.expected(end, found));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

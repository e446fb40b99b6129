//! A stage as a binary crate (.usdc), of version 0.8.0, with packed tables and plain arrays.
//!
//! Little-endian. The file begins with "PXR-USDC", the version in 8 bytes, the offset of the table
//! of contents (i64) and 64 bytes of zeros; then come values, tables, and the table of contents.
//! Offsets count from the beginning of the crate. A value is 64 bits: its type, whether it is an
//! array, whether it is here, and 48 bits of value or offset. Arrays begin at multiples of 8 bytes:
//! their length (u64), their numbers.
//!
//! Format: the sources of OpenUSD, `pxr/usd/usd/crateFile.h` and `crateFile.cpp`.

use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};

use glam::Vec3;

use super::super::common::le_floats as floats;
use super::stage::{Prim, Property, Stage, Value};
use super::tables::Tables;

const HEADER: u64 = 88;

/// Types of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool = 1,
    Int = 3,
    Float = 8,
    Double = 9,
    String = 10,
    Token = 11,
    Vec2f = 20,
    Vec3d = 23,
    Vec3f = 24,
    TokenListOp = 32,
    PathListOp = 34,
    TokenVector = 41,
    Specifier = 42,
    Variability = 44,
    TimeSamples = 46,
    DoubleVector = 48,
}

/// Types of what has a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spec {
    Attribute = 1,
    Prim = 6,
    PseudoRoot = 7,
    Relationship = 8,
}

const IS_ARRAY: u64 = 1 << 63;
const IS_HERE: u64 = 1 << 62;

/// A value that is within its 64 bits.
pub(super) fn here(kind: Kind, value: u32) -> u64 {
    IS_HERE | ((kind as u64) << 48) | u64::from(value)
}

/// A crate under way.
pub(super) struct CrateOut<'a, W> {
    out: &'a mut W,
    at: u64,
    tables: Tables,
    /// Time codes, which all samples share.
    codes: u64,
}

/// Writes the crate.
pub(super) fn write(stage: &Stage<'_>, out: &mut (impl Write + Seek)) -> io::Result<()> {
    out.write_all(b"PXR-USDC\x00\x08\x00\x00\x00\x00\x00\x00")?;
    out.write_all(&[0; 72])?;
    let mut made = CrateOut {
        out,
        at: HEADER,
        tables: Tables::default(),
        codes: 0,
    };
    let codes: Vec<f64> = stage.codes.iter().map(|&code| code as f64).collect();
    let mut bytes = (codes.len() as u64).to_le_bytes().to_vec();
    bytes.extend(codes.iter().flat_map(|code| code.to_le_bytes()));
    made.codes = made.value(Kind::DoubleVector, &bytes)?;
    made.root(stage)?;
    for prim in &stage.prims {
        made.prim(prim, "", stage)?;
    }
    made.finish()
}

impl<W: Write + Seek> CrateOut<'_, W> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn align(&mut self) -> io::Result<()> {
        let over = self.at.next_multiple_of(8) - self.at;
        self.put(&[0; 8][..over as usize])
    }

    /// A value of these bytes in the file.
    fn value(&mut self, kind: Kind, bytes: &[u8]) -> io::Result<u64> {
        self.align()?;
        let value = ((kind as u64) << 48) | self.at;
        self.put(bytes)?;
        Ok(value)
    }

    /// An array of `count` elements of these bytes.
    fn array(&mut self, kind: Kind, count: usize, bytes: &[u8]) -> io::Result<u64> {
        if count == 0 {
            return Ok(IS_ARRAY | ((kind as u64) << 48));
        }
        let value = self.value(kind, &(count as u64).to_le_bytes())?;
        self.put(bytes)?;
        Ok(IS_ARRAY | value)
    }

    fn triples(&mut self, points: &[Vec3]) -> io::Result<u64> {
        let bytes = floats(points.iter().flat_map(|p| p.to_array()));
        self.array(Kind::Vec3f, points.len(), &bytes)
    }

    fn double(&mut self, number: f64) -> io::Result<u64> {
        self.value(Kind::Double, &number.to_le_bytes())
    }

    fn token(&mut self, text: &str) -> u64 {
        here(Kind::Token, self.tables.token(text))
    }

    /// A list of tokens.
    fn tokens<'t>(
        &mut self,
        kind: Kind,
        head: &[u8],
        texts: impl ExactSizeIterator<Item = &'t str>,
    ) -> io::Result<u64> {
        let mut bytes = head.to_vec();
        bytes.extend((texts.len() as u64).to_le_bytes());
        for text in texts {
            bytes.extend(self.tables.token(text).to_le_bytes());
        }
        self.value(kind, &bytes)
    }

    fn root(&mut self, stage: &Stage<'_>) -> io::Result<()> {
        let end = stage.codes.last().copied().unwrap_or_default() as f64;
        let mut fields = BTreeMap::new();
        if let Some(first) = stage.prims.first() {
            fields.insert("defaultPrim", self.token(&first.name));
        }
        let said = self.tables.string(stage.made_by);
        fields.insert("documentation", here(Kind::String, said));
        for (name, number) in [
            ("endTimeCode", end),
            ("framesPerSecond", stage.rate),
            ("metersPerUnit", 1.0),
            ("startTimeCode", 0.0),
            ("timeCodesPerSecond", stage.rate),
        ] {
            fields.insert(name, self.double(number)?);
        }
        fields.insert("upAxis", self.token(stage.up));
        let names = stage.prims.iter().map(|prim| prim.name.as_str());
        let children = self.tokens(Kind::TokenVector, &[], names)?;
        fields.insert("primChildren", children);
        self.tables.spec("/", Spec::PseudoRoot, &fields);
        Ok(())
    }

    fn prim(&mut self, prim: &Prim<'_>, above: &str, stage: &Stage<'_>) -> io::Result<()> {
        const PREPENDED: u8 = 1 << 5;
        let path = format!("{above}/{}", prim.name);
        let mut fields = BTreeMap::new();
        fields.insert("specifier", here(Kind::Specifier, 0));
        fields.insert("typeName", self.token(prim.kind));
        if prim.is_component {
            fields.insert("kind", self.token("component"));
        }
        if !prim.applies.is_empty() {
            let applies = prim.applies.iter().copied();
            let applied = self.tokens(Kind::TokenListOp, &[PREPENDED], applies)?;
            fields.insert("apiSchemas", applied);
        }
        if !prim.properties.is_empty() {
            let names = prim.properties.iter().map(|property| property.name);
            let names = self.tokens(Kind::TokenVector, &[], names)?;
            fields.insert("properties", names);
        }
        if !prim.children.is_empty() {
            let names = prim.children.iter().map(|child| child.name.as_str());
            let names = self.tokens(Kind::TokenVector, &[], names)?;
            fields.insert("primChildren", names);
        }
        self.tables.spec(&path, Spec::Prim, &fields);
        for property in &prim.properties {
            self.property(property, &path, stage)?;
        }
        for child in &prim.children {
            self.prim(child, &path, stage)?;
        }
        Ok(())
    }

    fn property(
        &mut self,
        property: &Property<'_>,
        above: &str,
        stage: &Stage<'_>,
    ) -> io::Result<()> {
        let path = format!("{above}.{}", property.name);
        let mut fields = BTreeMap::new();
        if let Value::Target(target) = &property.value {
            fields.insert("variability", here(Kind::Variability, 1));
            fields.insert("targetPaths", self.path(target)?);
            self.tables.spec(&path, Spec::Relationship, &fields);
            return Ok(());
        }
        fields.insert("typeName", self.token(property.kind));
        if property.is_uniform {
            fields.insert("variability", here(Kind::Variability, 1));
        }
        if let Some(how) = property.interpolation {
            fields.insert("interpolation", self.token(how));
        }
        match &property.value {
            Value::Nothing => {}
            Value::Source(source) => {
                fields.insert("connectionPaths", self.path(source)?);
            }
            Value::Frames(_) | Value::Places(_) => {
                let samples = self.samples(&property.value, stage)?;
                fields.insert("timeSamples", samples);
            }
            value => {
                fields.insert("default", self.default(value)?);
            }
        }
        self.tables.spec(&path, Spec::Attribute, &fields);
        Ok(())
    }

    /// A list that is this path only.
    fn path(&mut self, path: &str) -> io::Result<u64> {
        const EXPLICIT: u8 = 1 | 1 << 1;
        let mut bytes = vec![EXPLICIT];
        bytes.extend(1_u64.to_le_bytes());
        bytes.extend(self.tables.path(path).to_le_bytes());
        self.value(Kind::PathListOp, &bytes)
    }

    fn default(&mut self, value: &Value<'_>) -> io::Result<u64> {
        match value {
            Value::Flag(flag) => Ok(here(Kind::Bool, u32::from(*flag))),
            Value::Token(token) => Ok(self.token(token)),
            Value::Number(number) => Ok(here(Kind::Float, number.to_bits())),
            Value::Tokens(tokens) => {
                let numbers = tokens.iter().map(|token| self.tables.token(token));
                let bytes: Vec<u8> = numbers.flat_map(u32::to_le_bytes).collect();
                self.array(Kind::Token, tokens.len(), &bytes)
            }
            Value::Whole(numbers) => {
                let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
                self.array(Kind::Int, numbers.len(), &bytes)
            }
            Value::Pairs(pairs) => {
                let bytes = floats(pairs.iter().flat_map(|p| p.to_array()));
                self.array(Kind::Vec2f, pairs.len(), &bytes)
            }
            Value::Triple(point) => self.value(Kind::Vec3f, &floats(point.to_array())),
            Value::Triples(points) => self.triples(points),
            Value::Nothing
            | Value::Frames(_)
            | Value::Places(_)
            | Value::Target(_)
            | Value::Source(_) => Err(io::Error::other("a value that is no default")),
        }
    }

    /// Time samples: the way to their codes, the way on, and a value for each.
    fn samples(&mut self, value: &Value<'_>, stage: &Stage<'_>) -> io::Result<u64> {
        let mut bytes = 8_i64.to_le_bytes().to_vec();
        bytes.extend(self.codes.to_le_bytes());
        bytes.extend(8_i64.to_le_bytes());
        bytes.extend((stage.codes.len() as u64).to_le_bytes());
        for number in 0..stage.codes.len() {
            let sample = match value {
                Value::Frames(of) => self.triples(&of(number)?)?,
                Value::Places(place) => {
                    let place = place(number).as_dvec3().to_array();
                    self.value(Kind::Vec3d, &place.map(f64::to_le_bytes).concat())?
                }
                other => self.default(other)?,
            };
            bytes.extend(sample.to_le_bytes());
        }
        self.value(Kind::TimeSamples, &bytes)
    }

    /// Writes the tables and where they are; returns the length of the crate.
    fn finish(mut self) -> io::Result<()> {
        let tables = std::mem::take(&mut self.tables);
        let mut contents = Vec::new();
        self.align()?;
        for (name, table) in tables.sections() {
            let mut entry = [0; 16];
            entry[..name.len()].copy_from_slice(name.as_bytes());
            contents.extend(entry);
            contents.extend(self.at.to_le_bytes());
            contents.extend((table.len() as u64).to_le_bytes());
            self.put(&table)?;
        }
        let place = self.at;
        self.put(&(contents.len() as u64 / 32).to_le_bytes())?;
        self.put(&contents)?;
        self.out.seek(SeekFrom::Start(16))?;
        self.out.write_all(&place.to_le_bytes())
    }
}

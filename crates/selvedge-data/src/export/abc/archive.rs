//! An Alembic archive under way: objects, properties, samples with their keys, metadata that are
//! said once, and time samplings.

use std::io;

use super::super::take::Take;
use super::property::{Form, Property, compound_header};
use crate::formats::ogawa::{NO_DATA, NO_GROUP, OgawaOut, Sink};

/// Version of the format, and of the library whose format it is.
const VERSION: i32 = 0;
const LIBRARY: i32 = 10_803;

/// An archive under way.
pub(super) struct Archive<'a> {
    out: OgawaOut<'a>,
    /// Metadata of properties and objects, numbered from 1.
    metadata: Vec<&'static str>,
}

/// An object that was written: its header, and what the group above has of it.
#[derive(Debug)]
pub(super) struct Object {
    header: Vec<u8>,
    group: u64,
}

/// Times of the samples, and what the archive says of itself.
pub(super) struct Sampling {
    samples: usize,
    /// Time from one sample to the next `[s]`.
    step: f64,
    rate: f64,
    made_by: String,
}

impl Sampling {
    pub(super) fn of(take: &Take<'_>) -> Self {
        let rate = take.trajectory.frame_rate();
        let made_by = take.trajectory.provenance().made_by.chars();
        // These separate metadata.
        let is_plain = |c: &char| !c.is_control() && *c != ';' && *c != '=';
        Self {
            samples: take.len(),
            step: take.every as f64 / rate,
            rate,
            made_by: made_by.filter(is_plain).collect(),
        }
    }

    /// Sampling 0, of what never changes, and sampling 1.
    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (samples, step) in [(1, 1.0), (self.samples as u32, self.step)] {
            bytes.extend(samples.to_le_bytes());
            bytes.extend(f64::to_le_bytes(step));
            bytes.extend(1_u32.to_le_bytes());
            bytes.extend(0_f64.to_le_bytes());
        }
        bytes
    }
}

impl<'a> Archive<'a> {
    /// Begins an archive in an empty file.
    pub(super) fn new(out: &'a mut dyn Sink) -> io::Result<Self> {
        Ok(Self {
            out: OgawaOut::new(out)?,
            metadata: Vec::new(),
        })
    }

    /// A sample of a property of one element, as a child of its group.
    pub(super) fn scalar(&mut self, bytes: &[u8]) -> io::Result<u64> {
        // Readers share samples by this key.
        let key = blake3::hash(bytes);
        self.out.data(&[&key.as_bytes()[..16], bytes])
    }

    /// A sample of a property of many elements, as two children of its group: the number of
    /// elements follows from the length.
    pub(super) fn array(&mut self, bytes: &[u8]) -> io::Result<[u64; 2]> {
        if bytes.is_empty() {
            return Ok([NO_DATA, NO_DATA]);
        }
        Ok([self.scalar(bytes)?, NO_DATA])
    }

    pub(super) fn property(
        &mut self,
        name: &str,
        form: Form,
        samples: usize,
        children: &[u64],
    ) -> io::Result<Property> {
        let metadata = self.number_of(form.metadata);
        Ok(Property {
            header: form.header(name, samples, metadata),
            group: self.out.group(children)?,
        })
    }

    pub(super) fn compound(
        &mut self,
        name: &str,
        metadata: &'static str,
        properties: Vec<Property>,
    ) -> io::Result<Property> {
        let metadata = self.number_of(metadata);
        Ok(Property {
            header: compound_header(name, metadata),
            group: self.group_of(properties)?,
        })
    }

    pub(super) fn object(
        &mut self,
        name: &str,
        metadata: &'static str,
        properties: Vec<Property>,
        children: Vec<Object>,
    ) -> io::Result<Object> {
        let metadata = self.number_of(metadata) as u8;
        let mut header = (name.len() as u32).to_le_bytes().to_vec();
        header.extend(name.as_bytes());
        header.push(metadata);
        Ok(Object {
            header,
            group: self.family(properties, children)?,
        })
    }

    /// Ends the archive; `top` are the objects that are in no other.
    pub(super) fn finish(mut self, top: Vec<Object>, sampling: &Sampling) -> io::Result<()> {
        let version = self.out.data(&[&VERSION.to_le_bytes()])?;
        let library = self.out.data(&[&LIBRARY.to_le_bytes()])?;
        let objects = self.family(Vec::new(), top)?;
        let said = format!(
            "FramesPerTimeUnit={};_ai_AlembicVersion=1.8.3;_ai_Application={}",
            sampling.rate, sampling.made_by
        );
        let said = self.out.data(&[said.as_bytes()])?;
        let times = self.out.data(&[&sampling.to_bytes()])?;
        let mut indexed = Vec::new();
        for text in &self.metadata {
            indexed.push(text.len() as u8);
            indexed.extend(text.as_bytes());
        }
        let indexed = self.out.data(&[&indexed])?;
        let root = [version, library, objects, said, times, indexed];
        let root = self.out.group(&root)?;
        self.out.finish(root)
    }

    /// The group of an object: its properties, its children, their headers and two hashes, which
    /// say whether two objects are alike.
    fn family(&mut self, properties: Vec<Property>, children: Vec<Object>) -> io::Result<u64> {
        let own: Vec<u8> = properties.iter().flat_map(|p| p.header.clone()).collect();
        let own_place: Vec<u8> = properties
            .iter()
            .flat_map(|p| p.group.to_le_bytes())
            .collect();
        let mut groups = vec![self.group_of(properties)?];
        groups.extend(children.iter().map(|child| child.group));
        let headers: Vec<u8> = children.into_iter().flat_map(|c| c.header).collect();
        let hash = |parts: [&[u8]; 2]| blake3::hash(&parts.concat());
        // Where the properties are counts too: no two objects here are alike.
        let (properties, below) = (hash([&own, &own_place]), hash([&headers, &own_place]));
        let hashes = [&properties.as_bytes()[..16], &below.as_bytes()[..16]].concat();
        groups.push(self.out.data(&[&headers, &hashes])?);
        self.out.group(&groups)
    }

    fn group_of(&mut self, properties: Vec<Property>) -> io::Result<u64> {
        if properties.is_empty() {
            return Ok(NO_GROUP);
        }
        let mut groups: Vec<u64> = properties.iter().map(|property| property.group).collect();
        let headers: Vec<u8> = properties.into_iter().flat_map(|p| p.header).collect();
        groups.push(self.out.data(&[&headers])?);
        self.out.group(&groups)
    }

    fn number_of(&mut self, metadata: &'static str) -> u32 {
        if metadata.is_empty() {
            return 0;
        }
        let known = self.metadata.iter().position(|&known| known == metadata);
        let number = known.unwrap_or_else(|| {
            self.metadata.push(metadata);
            self.metadata.len() - 1
        });
        number as u32 + 1
    }
}

//! An Alembic archive under way: objects, properties with headers packed into bits, samples with
//! their keys, metadata that are said once, and time samplings.

use std::io;

use indexmap::IndexSet;

use super::super::take::Take;
use crate::formats::ogawa::{NO_DATA, NO_GROUP, OgawaOut, Sink};

/// Version of the format, and of the library whose format it is.
const VERSION: i32 = 0;
const LIBRARY: i32 = 10_803;

/// An archive under way.
pub(super) struct Archive<'a> {
    out: OgawaOut<'a>,
    /// Metadata of properties and objects, numbered from 1.
    metadata: IndexSet<&'static str>,
}

/// An object or a property that was written: its header, and what the group above has of it.
#[derive(Debug)]
pub(super) struct Written {
    header: Vec<u8>,
    group: u64,
}

/// Sampling 0, of what never changes, and sampling 1, of the frames taken.
fn samplings(take: &Take<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let step = take.every as f64 / take.trajectory.frame_rate();
    for (samples, step) in [(1, 1.0), (take.len() as u32, step)] {
        bytes.extend(samples.to_le_bytes());
        bytes.extend(f64::to_le_bytes(step));
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(0_f64.to_le_bytes());
    }
    bytes
}

impl<'a> Archive<'a> {
    /// Begins an archive in an empty file.
    pub(super) fn new(out: &'a mut dyn Sink) -> io::Result<Self> {
        Ok(Self {
            out: OgawaOut::new(out)?,
            metadata: IndexSet::new(),
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
    ) -> io::Result<Written> {
        let metadata = self.number_of(form.metadata);
        Ok(Written {
            header: form.header(name, samples, metadata),
            group: self.out.group(children)?,
        })
    }

    /// A property of one sample of many elements.
    pub(super) fn constant(&mut self, name: &str, form: Form, bytes: &[u8]) -> io::Result<Written> {
        let children = self.array(bytes)?;
        self.property(name, form, 1, &children)
    }

    pub(super) fn compound(
        &mut self,
        name: &str,
        metadata: &'static str,
        properties: Vec<Written>,
    ) -> io::Result<Written> {
        let metadata = self.number_of(metadata);
        Ok(Written {
            header: compound_header(name, metadata),
            group: self.group_of(properties)?,
        })
    }

    pub(super) fn object(
        &mut self,
        name: &str,
        metadata: &'static str,
        properties: Vec<Written>,
        children: Vec<Written>,
    ) -> io::Result<Written> {
        let metadata = self.number_of(metadata) as u8;
        let mut header = (name.len() as u32).to_le_bytes().to_vec();
        header.extend(name.as_bytes());
        header.push(metadata);
        Ok(Written {
            header,
            group: self.family(properties, children)?,
        })
    }

    /// Ends the archive; `top` are the objects that are in no other.
    pub(super) fn finish(mut self, top: Vec<Written>, take: &Take<'_>) -> io::Result<()> {
        let version = self.out.data(&[&VERSION.to_le_bytes()])?;
        let library = self.out.data(&[&LIBRARY.to_le_bytes()])?;
        let objects = self.family(Vec::new(), top)?;
        let made_by = take.trajectory.provenance().made_by.chars();
        // These separate metadata.
        let is_plain = |c: &char| !c.is_control() && *c != ';' && *c != '=';
        let said = format!(
            "FramesPerTimeUnit={};_ai_AlembicVersion=1.8.3;_ai_Application={}",
            take.trajectory.frame_rate(),
            made_by.filter(is_plain).collect::<String>()
        );
        let said = self.out.data(&[said.as_bytes()])?;
        let times = self.out.data(&[&samplings(take)])?;
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
    fn family(&mut self, properties: Vec<Written>, children: Vec<Written>) -> io::Result<u64> {
        let own: Vec<u8> = properties.iter().flat_map(|p| p.header.clone()).collect();
        let own_place = properties.iter().flat_map(|p| p.group.to_le_bytes());
        let own_place: Vec<u8> = own_place.collect();
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

    fn group_of(&mut self, properties: Vec<Written>) -> io::Result<u64> {
        if properties.is_empty() {
            return Ok(NO_GROUP);
        }
        let mut groups: Vec<u64> = properties.iter().map(|property| property.group).collect();
        let headers: Vec<u8> = properties.into_iter().flat_map(|p| p.header).collect();
        groups.push(self.out.data(&[&headers])?);
        self.out.group(&groups)
    }

    fn number_of(&mut self, metadata: &'static str) -> u32 {
        match metadata {
            "" => 0,
            said => self.metadata.insert_full(said).0 as u32 + 1,
        }
    }
}

/// A form of a property's samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// Number of the type: 0 bool, 1 u8, 5 u32, 6 i32, 10 f32, 11 f64.
    pod: u32,
    /// Numbers of an element.
    extent: u32,
    is_scalar: bool,
    /// `key=value;key=value`.
    metadata: &'static str,
}

/// The box of a mesh.
pub(super) const BOUNDS: Form = Form {
    pod: 11,
    extent: 6,
    is_scalar: true,
    metadata: "interpretation=box",
};

impl Form {
    /// One element in a sample, without metadata.
    pub(super) const fn scalar(pod: u32, extent: u32) -> Self {
        Self {
            pod,
            extent,
            is_scalar: true,
            metadata: "",
        }
    }

    /// Elements by the dozen.
    pub(super) const fn array(pod: u32, extent: u32, metadata: &'static str) -> Self {
        Self {
            pod,
            extent,
            is_scalar: false,
            metadata,
        }
    }

    /// The header of a property of `samples` samples, each different from the last; of more than
    /// one they are at the times of sampling 1.
    fn header(self, name: &str, samples: usize, metadata: u32) -> Vec<u8> {
        const TIMED: u32 = 0x100;
        const ALIKE_IN_SIZE: u32 = 0x400;
        const CONSTANT: u32 = 0x800;
        let kind = if self.is_scalar { 1 } else { 2 };
        let width = width_of(samples.max(name.len()));
        let is_timed = samples > 1;
        let times = if is_timed { TIMED } else { CONSTANT };
        let info = kind
            | (width << 2)
            | (self.pod << 4)
            | times
            | ALIKE_IN_SIZE
            | (self.extent << 12)
            | (metadata << 20);
        let mut header = info.to_le_bytes().to_vec();
        push(&mut header, width, samples);
        if is_timed {
            push(&mut header, width, 1);
        }
        push(&mut header, width, name.len());
        header.extend(name.as_bytes());
        header
    }
}

/// The header of a property that has properties.
fn compound_header(name: &str, metadata: u32) -> Vec<u8> {
    let width = width_of(name.len());
    let mut header = ((width << 2) | (metadata << 20)).to_le_bytes().to_vec();
    push(&mut header, width, name.len());
    header.extend(name.as_bytes());
    header
}

/// Width of the numbers in a header, up to the largest: 0 for one byte, 1 for two, 2 for four.
fn width_of(largest: usize) -> u32 {
    match largest {
        0..=0xff => 0,
        0x100..=0xffff => 1,
        _ => 2,
    }
}

fn push(header: &mut Vec<u8>, width: u32, number: usize) {
    header.extend(&(number as u32).to_le_bytes()[..1 << width]);
}

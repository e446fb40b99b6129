//! Objects and properties of an Alembic archive, as far as their headers say. Samples are found
//! when they are asked for.

use super::budget::MOST_SAMPLES;
use crate::formats::ogawa::{Group, Ogawa};

/// Objects at most, and objects within objects.
const MOST_OBJECTS: usize = 10_000;
const DEEPEST: usize = 200;

/// Types of numbers.
pub(super) const U8: u32 = 1;
pub(super) const U32: u32 = 5;
pub(super) const I32: u32 = 6;
pub(super) const F32: u32 = 10;
pub(super) const F64: u32 = 11;

/// Bytes of a key before every sample.
const KEY: usize = 16;

/// Bytes of two hashes behind the headers of an object's children.
const HASHES: usize = 32;

/// An archive.
pub(super) struct AbcFile<'a> {
    pub(super) objects: Vec<AbcObject<'a>>,
    samplings: Vec<Sampling>,
}

/// An object of the tree.
pub(super) struct AbcObject<'a> {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    metadata: String,
    properties: Vec<AbcProperty<'a>>,
}

/// A property.
#[derive(Clone)]
pub(super) struct AbcProperty<'a> {
    pub(super) name: String,
    pub(super) pod: u32,
    pub(super) extent: usize,
    kind: Kind,
    samples: usize,
    /// The first sample that differs from the one before it, and the last; 0 where none does.
    changes: [usize; 2],
    sampling: usize,
    group: Group<'a>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Compound,
    Scalar,
    Array,
}

/// Times of samples.
struct Sampling {
    /// Time of a cycle of samples `[s]`; none where all times are given.
    cycle: Option<f64>,
    times: Vec<f64>,
}

/// Counts the bytes of headers that were read: no more than the file has, so that headers that are
/// shared cost no more than whole ones.
struct Headers {
    metadata: Vec<String>,
    left: usize,
}

impl<'a> AbcFile<'a> {
    /// The archive in the bytes of a file.
    ///
    /// # Errors
    /// The defect, as the end of a sentence.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let root = Ogawa::open(bytes)?;
        if root.len() != 6 {
            return Err(format!(
                "is no Alembic archive: its root has {} parts, expected 6",
                root.len()
            ));
        }
        let mut file = Self {
            objects: Vec::new(),
            samplings: samplings(root.data(4)?)?,
        };
        let mut headers = Headers {
            metadata: metadata(root.data(5)?)?,
            left: bytes.len(),
        };
        file.add_children(root.group(2)?, None, 0, &mut headers)?;
        Ok(file)
    }

    fn add_children(
        &mut self,
        group: Group<'a>,
        parent: Option<usize>,
        depth: usize,
        headers: &mut Headers,
    ) -> Result<(), String> {
        if depth > DEEPEST {
            return Err(format!("has objects that are more than {DEEPEST} deep"));
        }
        let Some(last) = group.len().checked_sub(1) else {
            return Ok(());
        };
        let text = group.data(last)?;
        headers.read(text)?;
        let mut text = Bytes(&text[..text.len().saturating_sub(HASHES)]);
        let mut child = 1;
        while !text.0.is_empty() {
            if self.objects.len() == MOST_OBJECTS {
                return Err(format!("has more than {MOST_OBJECTS} objects"));
            }
            let length = text.number(4)?;
            let name = text.text(length)?;
            let number = text.number(1)?;
            let metadata = headers.metadata(number, 4, &mut text)?;
            let own = group.group(child)?;
            let properties = match own.len() {
                0 => Vec::new(),
                _ => headers.properties(own.group(0)?)?,
            };
            self.objects.push(AbcObject {
                name,
                parent,
                metadata,
                properties,
            });
            let object = self.objects.len() - 1;
            self.add_children(own, Some(object), depth + 1, headers)?;
            child += 1;
        }
        Ok(())
    }

    /// The properties of a compound property.
    pub(super) fn within(
        &self,
        property: &AbcProperty<'a>,
    ) -> Result<Vec<AbcProperty<'a>>, String> {
        if property.kind != Kind::Compound {
            return Err(format!("its {} has no properties", property.name));
        }
        // No schema is read that has more; metadata are not asked for.
        let mut headers = Headers {
            metadata: vec![String::new(); 256],
            left: 1 << 20,
        };
        headers.properties(property.group)
    }

    /// Time of a sample of a property `[s]`.
    pub(super) fn time(&self, property: &AbcProperty<'_>, sample: usize) -> Result<f64, String> {
        let none = || format!("its {} has no time for sample {sample}", property.name);
        let sampling = self.samplings.get(property.sampling).ok_or_else(none)?;
        let count = sampling.times.len();
        match sampling.cycle {
            Some(cycle) => {
                let turns = (sample / count) as f64;
                Ok(sampling.times[sample % count] + turns * cycle)
            }
            None => sampling.times.get(sample).copied().ok_or_else(none),
        }
    }
}

impl<'a> AbcObject<'a> {
    /// True for a mesh of polygons.
    pub(super) fn is_mesh(&self) -> bool {
        let schemas = ["schema=AbcGeom_PolyMesh_", "schema=AbcGeom_SubD_"];
        schemas.iter().any(|schema| self.metadata.contains(schema))
    }

    /// True for what places others.
    pub(super) fn is_node(&self) -> bool {
        self.metadata.contains("schema=AbcGeom_Xform_")
    }

    /// The property of this name.
    pub(super) fn property(&self, name: &str) -> Option<&AbcProperty<'a>> {
        self.properties
            .iter()
            .find(|property| property.name == name)
    }
}

impl<'a> AbcProperty<'a> {
    /// The samples that differ from the one before them, with the last one of those that are alike
    /// at the beginning: values between them follow.
    pub(super) fn keys(&self) -> Result<Vec<usize>, String> {
        let [first, last] = self.changes;
        if self.samples == 0 {
            return Err(format!("its {} has no samples", self.name));
        }
        if last == 0 {
            return Ok(vec![0]);
        }
        if first == 0 || first > last || last >= self.samples {
            return Err(format!(
                "its {} has changes from sample {first} to {last} of {}",
                self.name, self.samples
            ));
        }
        if last - first >= MOST_SAMPLES {
            return Err(format!(
                "its {} has more than {MOST_SAMPLES} samples",
                self.name
            ));
        }
        let mut keys = vec![0];
        if first > 1 {
            keys.push(first - 1);
        }
        keys.extend(first..=last);
        Ok(keys)
    }

    /// The bytes of a sample.
    pub(super) fn sample(&self, sample: usize) -> Result<&'a [u8], String> {
        let [first, last] = self.changes;
        let stored = match sample {
            _ if last == 0 || sample < first => 0,
            sample => sample.min(last) - first + 1,
        };
        let child = match self.kind {
            Kind::Scalar => stored,
            Kind::Array => 2 * stored,
            Kind::Compound => return Err(format!("its {} has no samples", self.name)),
        };
        let bytes = self.group.data(child)?;
        Ok(bytes.get(KEY..).unwrap_or_default())
    }
}

impl Headers {
    /// Counts a header.
    fn read(&mut self, bytes: &[u8]) -> Result<(), String> {
        let left = self.left.checked_sub(bytes.len());
        self.left = left.ok_or("has more headers than bytes: it was changed")?;
        Ok(())
    }

    /// Metadata by their number; 255 where they follow, after their length in `width` bytes.
    fn metadata(
        &self,
        number: usize,
        width: usize,
        text: &mut Bytes<'_>,
    ) -> Result<String, String> {
        match number {
            0xff => {
                let length = text.number(width)?;
                text.text(length)
            }
            number => self
                .metadata
                .get(number)
                .cloned()
                .ok_or_else(|| format!("names metadata {number} of {}", self.metadata.len())),
        }
    }

    /// The properties in a group.
    fn properties<'a>(&mut self, group: Group<'a>) -> Result<Vec<AbcProperty<'a>>, String> {
        let Some(last) = group.len().checked_sub(1) else {
            return Ok(Vec::new());
        };
        let text = group.data(last)?;
        self.read(text)?;
        let mut text = Bytes(text);
        let mut properties = Vec::new();
        while !text.0.is_empty() {
            let own = group.group(properties.len())?;
            properties.push(self.property(&mut text, own)?);
        }
        Ok(properties)
    }

    fn property<'a>(
        &self,
        text: &mut Bytes<'_>,
        group: Group<'a>,
    ) -> Result<AbcProperty<'a>, String> {
        let info = text.number(4)? as u32;
        let width = match (info >> 2) & 3 {
            0 => 1,
            1 => 2,
            2 => 4,
            _ => return Err("has a property whose header cannot be".to_owned()),
        };
        let kind = match info & 3 {
            0 => Kind::Compound,
            1 => Kind::Scalar,
            _ => Kind::Array,
        };
        let (mut samples, mut changes, mut sampling) = (0, [0, 0], 0);
        if kind != Kind::Compound {
            samples = text.number(width)?;
            if info & 0x200 != 0 {
                changes = [text.number(width)?, text.number(width)?];
            } else if info & 0x800 == 0 {
                changes = [1, samples.saturating_sub(1)];
            }
            if info & 0x100 != 0 {
                sampling = text.number(width)?;
            }
        }
        let length = text.number(width)?;
        let name = text.text(length)?;
        self.metadata((info >> 20) as usize & 0xff, width, text)?;
        Ok(AbcProperty {
            name,
            pod: (info >> 4) & 0xf,
            extent: (info >> 12) as usize & 0xff,
            kind,
            samples,
            changes,
            sampling,
            group,
        })
    }
}

/// Bytes that are read from the front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let split = self.0.split_at_checked(count);
        let (front, rest) = split.ok_or("has a header that was cut short or changed")?;
        self.0 = rest;
        Ok(front)
    }

    /// A whole number of `width` bytes, at most 4.
    fn number(&mut self, width: usize) -> Result<usize, String> {
        let bytes = self.take(width)?;
        Ok(bytes
            .iter()
            .rev()
            .fold(0, |n, &byte| (n << 8) | usize::from(byte)))
    }

    fn double(&mut self) -> Result<f64, String> {
        let bytes = self.take(8)?.iter().rev();
        Ok(f64::from_bits(
            bytes.fold(0, |n, &byte| (n << 8) | u64::from(byte)),
        ))
    }

    fn text(&mut self, length: usize) -> Result<String, String> {
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// Metadata that are said once; number 0 are none.
fn metadata(bytes: &[u8]) -> Result<Vec<String>, String> {
    let mut text = Bytes(bytes);
    let mut all = vec![String::new()];
    while !text.0.is_empty() {
        let length = text.number(1)?;
        all.push(text.text(length)?);
    }
    Ok(all)
}

fn samplings(bytes: &[u8]) -> Result<Vec<Sampling>, String> {
    let mut text = Bytes(bytes);
    let mut all = Vec::new();
    while !text.0.is_empty() {
        text.number(4)?;
        let cycle = text.double()?;
        let count = text.number(4)?;
        let bytes = text.take(count.saturating_mul(8))?;
        let mut times = Bytes(bytes);
        let times: Vec<f64> = (0..count)
            .map(|_| times.double())
            .collect::<Result<_, _>>()?;
        if times.is_empty() || times.iter().any(|time| !time.is_finite()) {
            return Err("has a time sampling without times".to_owned());
        }
        // Alembic's sign for times that are all given.
        let is_given = cycle >= f64::MAX / 64.0;
        all.push(Sampling {
            cycle: (!is_given).then_some(cycle),
            times,
        });
    }
    Ok(all)
}

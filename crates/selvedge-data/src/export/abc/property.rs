//! Headers of properties, as Alembic packs them into bits.

/// A form of a property's samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// Number of the type: 0 bool, 1 u8, 5 u32, 6 i32, 10 f32, 11 f64.
    pod: u32,
    /// Numbers of an element.
    extent: u32,
    is_scalar: bool,
    /// `key=value;key=value`.
    pub(super) metadata: &'static str,
}

/// The box of a mesh.
pub(super) const BOUNDS: Form = Form {
    pod: 11,
    extent: 6,
    is_scalar: true,
    metadata: "interpretation=box",
};

/// A property that was written: its header, and what the group above has of it.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) header: Vec<u8>,
    pub(super) group: u64,
}

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
    pub(super) fn header(self, name: &str, samples: usize, metadata: u32) -> Vec<u8> {
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
pub(super) fn compound_header(name: &str, metadata: u32) -> Vec<u8> {
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

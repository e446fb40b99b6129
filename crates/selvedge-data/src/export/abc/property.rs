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
        let width = Width::of(samples.max(name.len()));
        let is_timed = samples > 1;
        let times = if is_timed { TIMED } else { CONSTANT };
        let info = kind
            | width.bits()
            | (self.pod << 4)
            | times
            | ALIKE_IN_SIZE
            | (self.extent << 12)
            | (metadata << 20);
        let mut header = info.to_le_bytes().to_vec();
        width.push(&mut header, samples);
        if is_timed {
            width.push(&mut header, 1);
        }
        width.push(&mut header, name.len());
        header.extend(name.as_bytes());
        header
    }
}

/// The header of a property that has properties.
pub(super) fn compound_header(name: &str, metadata: u32) -> Vec<u8> {
    let width = Width::of(name.len());
    let mut header = (width.bits() | (metadata << 20)).to_le_bytes().to_vec();
    width.push(&mut header, name.len());
    header.extend(name.as_bytes());
    header
}

/// Width of the numbers in a header.
#[derive(Clone, Copy)]
enum Width {
    One,
    Two,
    Four,
}

impl Width {
    fn of(largest: usize) -> Self {
        match largest {
            0..=0xff => Self::One,
            0x100..=0xffff => Self::Two,
            _ => Self::Four,
        }
    }

    fn bits(self) -> u32 {
        match self {
            Self::One => 0,
            Self::Two => 1 << 2,
            Self::Four => 2 << 2,
        }
    }

    fn push(self, header: &mut Vec<u8>, number: usize) {
        let bytes = (number as u32).to_le_bytes();
        let used = match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        };
        header.extend(&bytes[..used]);
    }
}

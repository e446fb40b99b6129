//! Values of a crate: 64 bits each, with their type, whether they are an array, here or packed, and
//! 48 bits of value or offset.

use std::cell::Cell;

use super::tables::{Part, cut};
use crate::formats::packing::little;

const TOKEN: u64 = 11;
const REFERENCES: u64 = 35;
const TOKEN_VECTOR: u64 = 41;
const TIME_SAMPLES: u64 = 46;
const DOUBLE_VECTOR: u64 = 48;
const STRING_VECTOR: u64 = 50;
const BLOCK: u64 = 51;

/// Arrays of fewer numbers are not packed.
const LEAST_PACKED: usize = 16;

/// Samples at most of a property.
const MOST_SAMPLES: usize = 100_000;

/// A value of 64 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rep(u64);

impl Rep {
    pub(super) fn of(eight: &[u8]) -> Self {
        Self(little(eight))
    }

    fn kind(self) -> u64 {
        (self.0 >> 48) & 0xff
    }

    fn is_array(self) -> bool {
        self.0 >> 63 == 1
    }

    fn is_here(self) -> bool {
        (self.0 >> 62) & 1 == 1
    }

    fn is_packed(self) -> bool {
        (self.0 >> 61) & 1 == 1
    }

    fn payload(self) -> u64 {
        self.0 & 0xffff_ffff_ffff
    }

    /// The low 32 bits of a value that is here.
    pub(super) fn low(self) -> u32 {
        self.0 as u32
    }

    /// True for a value that hides weaker ones.
    pub(super) fn is_block(self) -> bool {
        self.kind() == BLOCK
    }

    /// True for a list of strings, which is not empty.
    pub(super) fn is_strings(self) -> bool {
        self.kind() == STRING_VECTOR
    }
}

/// A type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    Int,
    UInt,
    Long,
    ULong,
    Half,
    Float,
    Double,
}

impl Number {
    fn width(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Int | Self::UInt | Self::Float => 4,
            Self::Long | Self::ULong | Self::Double => 8,
        }
    }

    fn read(self, b: &[u8]) -> f64 {
        let bits = little(b);
        match self {
            Self::Int => f64::from(bits as i32),
            Self::UInt => f64::from(bits as u32),
            Self::Long => bits.cast_signed() as f64,
            Self::ULong => bits as f64,
            Self::Half => half::f16::from_bits(bits as u16).to_f64(),
            Self::Float => f64::from(f32::from_bits(bits as u32)),
            Self::Double => f64::from_bits(bits),
        }
    }
}

/// Form of a type: how many numbers it has, and of which type.
fn form(kind: u64) -> Option<(usize, Number)> {
    Some(match kind {
        3 => (1, Number::Int),
        4 => (1, Number::UInt),
        5 => (1, Number::Long),
        6 => (1, Number::ULong),
        7 => (1, Number::Half),
        8 => (1, Number::Float),
        9 | 56 => (1, Number::Double),
        15 => (16, Number::Double),
        16 | 27 => (4, Number::Double),
        17 | 28 => (4, Number::Float),
        18 | 29 => (4, Number::Half),
        19 => (2, Number::Double),
        20 => (2, Number::Float),
        21 => (2, Number::Half),
        22 => (2, Number::Int),
        23 => (3, Number::Double),
        24 => (3, Number::Float),
        25 => (3, Number::Half),
        26 => (3, Number::Int),
        30 => (4, Number::Int),
        _ => return None,
    })
}

/// Values in the bytes of a crate.
pub(super) struct Values<'a> {
    bytes: &'a [u8],
    version: u8,
    /// Numbers that may still be taken from arrays.
    left: Cell<usize>,
}

impl<'a> Values<'a> {
    pub(super) fn new(bytes: &'a [u8], version: u8) -> Self {
        Self {
            bytes,
            version,
            left: Cell::new(bytes.len().saturating_mul(8) + (1 << 22)),
        }
    }

    /// The file from a place on.
    fn part(&self, at: u64) -> Result<Part<'a>, String> {
        let at = usize::try_from(at).map_err(|_| cut())?;
        let bytes = self.bytes;
        Ok(Part { bytes, at })
    }

    fn spend(&self, count: usize) -> Result<(), String> {
        let left = self.left.get().checked_sub(count);
        self.left
            .set(left.ok_or("has arrays that are far larger than the file")?);
        Ok(())
    }

    /// The numbers of a value; none where it has no numbers.
    pub(super) fn numbers(&self, rep: Rep) -> Result<Option<Vec<f64>>, String> {
        let Some((width, number)) = form(rep.kind()) else {
            return Ok(None);
        };
        let mut numbers = match (rep.is_array(), rep.is_here()) {
            (true, _) => self.array(rep, width, number)?,
            (false, true) => Self::inlined(rep, width, number),
            (false, false) => self.part(rep.payload())?.reals(width, number)?,
        };
        // Turns have their real part last here, and first in text.
        if (16..=18).contains(&rep.kind()) {
            for turn in numbers.chunks_exact_mut(4) {
                turn.rotate_right(1);
            }
        }
        Ok(Some(numbers))
    }

    fn inlined(rep: Rep, width: usize, number: Number) -> Vec<f64> {
        let low = rep.low();
        let part = |k: usize| f64::from(low.to_le_bytes()[k].cast_signed());
        match (width, number) {
            (1, Number::Double) => vec![f64::from(f32::from_bits(low))],
            (1, Number::Long) => vec![f64::from(low.cast_signed())],
            (1, number) => vec![number.read(&low.to_le_bytes()[..number.width().min(4)])],
            (16, _) => (0..16)
                .map(|k| if k % 5 == 0 { part(k / 5) } else { 0.0 })
                .collect(),
            (width, _) => (0..width).map(part).collect(),
        }
    }

    fn array(&self, rep: Rep, width: usize, number: Number) -> Result<Vec<f64>, String> {
        let (mut part, count) = self.elements(rep)?;
        let all = count.checked_mul(width).ok_or_else(cut)?;
        self.spend(all)?;
        if rep.is_packed() && width == 1 && count >= LEAST_PACKED {
            packed(part, count, number)
        } else {
            part.reals(all, number)
        }
    }

    /// The file from the first element of an array on, and the number of its elements.
    fn elements(&self, rep: Rep) -> Result<(Part<'a>, usize), String> {
        let at = rep.payload();
        let mut part = self.part(at + if self.version < 5 { 4 } else { 0 })?;
        let count = match at {
            0 => 0,
            _ => part.number(if self.version < 7 { 4 } else { 8 })?,
        };
        Ok((part, count))
    }

    /// As [`Self::elements`], of a list.
    fn listed(&self, rep: Rep) -> Result<(Part<'a>, usize), String> {
        let mut part = self.part(rep.payload())?;
        let count = part.number(8)?;
        Ok((part, count))
    }

    /// The tokens of an array or a list of them, by number; none for another value.
    pub(super) fn tokens(&self, rep: Rep) -> Result<Option<Vec<usize>>, String> {
        let (mut part, count) = match (rep.kind(), rep.is_array()) {
            (TOKEN, false) => return Ok(Some(vec![rep.low() as usize])),
            (TOKEN, true) => self.elements(rep)?,
            (TOKEN_VECTOR, _) => self.listed(rep)?,
            _ => return Ok(None),
        };
        part.words(count).map(Some)
    }

    /// The only reference of a list, without an offset in time: number of the text of its file,
    /// and of its path. None for other lists.
    pub(super) fn reference(&self, rep: Rep) -> Result<Option<(usize, usize)>, String> {
        if rep.kind() != REFERENCES || rep.is_here() {
            return Ok(None);
        }
        // A byte says which lists there are: 2 the whole one, 4, 32 and 64 what is added.
        let mut part = self.part(rep.payload())?;
        let lists = part.number(1)? & !1;
        if ![2, 4, 32, 64].contains(&lists) || part.number(8)? != 1 {
            return Ok(None);
        }
        let reference = (part.number(4)?, part.number(4)?);
        let [offset, scale] = part.reals(2, Number::Double)?[..] else {
            return Ok(None);
        };
        Ok((offset == 0.0 && scale == 1.0).then_some(reference))
    }

    /// Time samples: codes and values. None for another value.
    pub(super) fn samples(&self, rep: Rep) -> Result<Option<Vec<(f64, Rep)>>, String> {
        if rep.kind() != TIME_SAMPLES {
            return Ok(None);
        }
        // A way to the codes, a way on, each from where it stands.
        let jump = |at: u64| -> Result<u64, String> {
            let way = little(self.part(at)?.take(8)?).cast_signed();
            at.checked_add_signed(way).ok_or_else(cut)
        };
        let codes = jump(rep.payload())?;
        let times = Rep::of(self.part(codes)?.take(8)?);
        let mut part = self.part(jump(codes.checked_add(8).ok_or_else(cut)?)?)?;
        let count = part.number(8)?;
        if count > MOST_SAMPLES {
            return Err(format!(
                "has {count} samples of a property, more than {MOST_SAMPLES}"
            ));
        }
        let values = part.take(8 * count)?.chunks_exact(8);
        let times = self.times(times)?;
        if times.len() != count {
            return Err(format!("has {count} samples at {} times", times.len()));
        }
        Ok(Some(times.into_iter().zip(values.map(Rep::of)).collect()))
    }

    fn times(&self, rep: Rep) -> Result<Vec<f64>, String> {
        if rep.kind() != DOUBLE_VECTOR {
            return Ok(self.numbers(rep)?.unwrap_or_default());
        }
        let (mut part, count) = self.listed(rep)?;
        self.spend(count)?;
        part.reals(count, Number::Double)
    }
}

impl Part<'_> {
    /// The next `count` numbers of a type.
    fn reals(&mut self, count: usize, number: Number) -> Result<Vec<f64>, String> {
        let length = count.checked_mul(number.width()).ok_or_else(cut)?;
        let bytes = self.take(length)?.chunks_exact(number.width());
        Ok(bytes.map(|b| number.read(b)).collect())
    }
}

/// The numbers of a packed array.
fn packed(mut part: Part<'_>, count: usize, number: Number) -> Result<Vec<f64>, String> {
    let mut whole = |width: usize| part.numbers(count, width).map(Vec::into_iter);
    match number {
        Number::UInt => return Ok(whole(4)?.map(|n| f64::from(n as u32)).collect()),
        Number::Int | Number::Long | Number::ULong => {
            return Ok(whole(number.width())?.map(|n| n as f64).collect());
        }
        Number::Half | Number::Float | Number::Double => {}
    }
    match part.number(1)? as u8 {
        b'i' => Ok(part.numbers(count, 4)?.iter().map(|&n| n as f64).collect()),
        b't' => {
            let entries = part.number(4)?;
            let table = part.reals(entries, number)?;
            let entry = |n: i64| table.get(usize::try_from(n).ok()?).copied();
            let places = part.numbers(count, 4)?.into_iter();
            places.map(entry).collect::<Option<_>>().ok_or_else(cut)
        }
        _ => Err("has an array that is packed in an unknown way".to_owned()),
    }
}

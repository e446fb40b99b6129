//! Packing of the tables and arrays of a binary USD file: blocks of LZ4, and whole numbers as
//! differences of one, two or four bytes.
//!
//! A packed run of bytes begins with the number of its chunks (u8): 0 for one chunk, which is the
//! rest; else each chunk is its length (i32) and a block. Packed whole numbers are the commonest
//! difference (i32), two bits for each number (0: that difference, 1: one byte, 2: two, 3: four),
//! and the differences that are not common, all of it packed as bytes. Numbers of 64 bits have
//! differences of two, four and eight bytes.
//!
//! Reading gives at most as many bytes as it was asked for.
//!
//! Format: the sources of OpenUSD, `pxr/base/tf/fastCompression.cpp` and
//! `pxr/usd/usd/integerCoding.cpp`.

use lz4_flex::block;

/// Packs bytes, as one chunk.
pub(crate) fn pack(bytes: &[u8]) -> Vec<u8> {
    [&[0][..], &block::compress(bytes)].concat()
}

/// Unpacks bytes, of which there must be `length`.
pub(crate) fn unpack(packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let all = unpack_at_most(packed, length)?;
    if all.len() == length {
        Ok(all)
    } else {
        Err(format!(
            "has {} packed bytes where {length} should be",
            all.len()
        ))
    }
}

/// Unpacks at most so many bytes; more are an error.
fn unpack_at_most(packed: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let mut all = Vec::new();
    match packed.split_first() {
        None => {}
        Some((0, block)) => unpack_block(block, most, &mut all)?,
        Some((chunks, mut rest)) => {
            for _ in 0..*chunks {
                let (size, after) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
                let size = usize::try_from(i32::from_le_bytes(*size)).map_err(|_| cut())?;
                let (block, after) = after.split_at_checked(size).ok_or_else(cut)?;
                unpack_block(block, most, &mut all)?;
                rest = after;
            }
        }
    }
    Ok(all)
}

fn cut() -> String {
    "has packed bytes that were cut short or changed".to_owned()
}

/// Adds a block of LZ4 to `all`, which may not become longer than `most`.
fn unpack_block(block: &[u8], most: usize, all: &mut Vec<u8>) -> Result<(), String> {
    // A byte of a block gives 255 at most.
    let room = (most - all.len()).min(256 * block.len());
    all.extend(block::decompress(block, room).map_err(|_| cut())?);
    Ok(())
}

/// Packs whole numbers.
pub(crate) fn pack_numbers(numbers: &[i32]) -> Vec<u8> {
    const COMMON: i32 = 1;
    if numbers.is_empty() {
        return Vec::new();
    }
    let mut codes = vec![0_u8; numbers.len().div_ceil(4)];
    let mut others = Vec::new();
    let mut last = 0_i32;
    for (place, &number) in numbers.iter().enumerate() {
        let difference = number.wrapping_sub(last);
        last = number;
        let code = if difference == COMMON {
            0
        } else if let Ok(small) = i8::try_from(difference) {
            others.extend(small.to_le_bytes());
            1
        } else if let Ok(medium) = i16::try_from(difference) {
            others.extend(medium.to_le_bytes());
            2
        } else {
            others.extend(difference.to_le_bytes());
            3
        };
        codes[place / 4] |= code << (2 * (place % 4));
    }
    pack(&[COMMON.to_le_bytes().as_slice(), &codes, &others].concat())
}

/// Unpacks `count` whole numbers whose differences have at most `width` bytes: 4 or 8.
pub(crate) fn unpack_numbers(
    packed: &[u8],
    count: usize,
    width: usize,
) -> Result<Vec<i64>, String> {
    if count == 0 {
        return Ok(Vec::new());
    }
    // A packed byte makes at most 255 others, and these at most four numbers.
    if count > packed.len().saturating_mul(1024) {
        return Err(cut());
    }
    let codes = count.div_ceil(4);
    let bytes = unpack_at_most(packed, width + codes + width * count)?;
    let (common, rest) = bytes.split_at_checked(width).ok_or_else(cut)?;
    let (codes, mut others) = rest.split_at_checked(codes).ok_or_else(cut)?;
    let common = signed(common);
    let mut last = 0_i64;
    let mut numbers = Vec::with_capacity(count);
    for place in 0..count {
        let own = match (codes[place / 4] >> (2 * (place % 4))) & 3 {
            0 => 0,
            1 => width / 4,
            2 => width / 2,
            _ => width,
        };
        let (bytes, after) = others.split_at_checked(own).ok_or_else(cut)?;
        others = after;
        let difference = if own == 0 { common } else { signed(bytes) };
        last = last.wrapping_add(difference);
        if width == 4 {
            // As numbers of 32 bits go round.
            last = i64::from(last as i32);
        }
        numbers.push(last);
    }
    Ok(numbers)
}

/// A number of at most eight bytes, the lowest first.
pub(crate) fn little(bytes: &[u8]) -> u64 {
    let digits = bytes.iter().rev();
    digits.fold(0, |n, &byte| (n << 8) | u64::from(byte))
}

/// A whole number of one, two, four or eight bytes.
fn signed(bytes: &[u8]) -> i64 {
    let is_negative = bytes.last().is_some_and(|byte| byte & 0x80 != 0);
    let mut wide = [if is_negative { 0xff } else { 0 }; 8];
    wide[..bytes.len()].copy_from_slice(bytes);
    i64::from_le_bytes(wide)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back() {
        for length in [0, 1, 14, 15, 16, 269, 270, 271, 5000] {
            let bytes: Vec<u8> = (0..length).map(|n| (n * 7 % 251) as u8).collect();
            let packed = pack(&bytes);
            assert_eq!(unpack(&packed, length).unwrap(), bytes);
            assert!(unpack(&packed, length + 1).is_err());
            assert!(length == 0 || unpack(&packed, length - 1).is_err());
        }
    }

    #[test]
    fn matches_repeat_what_was_made() {
        // "ab", then ten bytes from two back, then "c".
        let block = [0, 0x26, b'a', b'b', 2, 0, 0x10, b'c'];
        assert_eq!(unpack(&block, 13).unwrap(), b"ababababababc");
        assert!(unpack(&block, 12).is_err());
        for (bad, length) in [
            (vec![0, 0x26, b'a', b'b', 3, 0, 0x10, b'c'], 13),
            (vec![0, 0x26, b'a', b'b', 0, 0, 0x10, b'c'], 13),
            (vec![0, 0xf0], 3),
            (vec![0, 0x30, 1], 3),
            (vec![2, 9, 0, 0, 0, 1], 3),
        ] {
            assert!(unpack(&bad, length).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn whole_numbers_come_back() {
        let numbers = [0, 1, 2, 2, -130, 40_000, 40_001, i32::MAX, i32::MIN, -1, 5];
        for count in 0..=numbers.len() {
            let packed = pack_numbers(&numbers[..count]);
            let found = unpack_numbers(&packed, count, 4).unwrap();
            let expected: Vec<i64> = numbers[..count].iter().map(|&n| i64::from(n)).collect();
            assert_eq!(found, expected);
        }
        let packed = pack_numbers(&numbers);
        assert!(unpack_numbers(&packed, numbers.len() + 9, 4).is_err());
        assert!(unpack_numbers(&packed, usize::MAX / 64, 4).is_err());
    }
}

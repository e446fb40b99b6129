//! Damage to the parts of containers, with the lengths and checksums around them mended. One in
//! eight keeps the old ones, so that these are tested, too.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::{binary, json, text};
use crate::fuzz::zip::zip;

/// Bytes `[at, at + N)` as a little-endian number.
fn word(bytes: &[u8], at: usize, size: usize) -> Option<usize> {
    let part = bytes.get(at..at.checked_add(size)?)?;
    let word = part
        .iter()
        .rev()
        .fold(0_u64, |word, b| word << 8 | u64::from(*b));
    usize::try_from(word).ok()
}

fn is_mended(rng: &mut ChaCha8Rng) -> bool {
    rng.random_ratio(7, 8)
}

/// A JSON text with something changed, as a value or as text.
fn changed_json(input: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    match serde_json::from_slice::<Value>(input) {
        Ok(mut value) if rng.random_ratio(4, 5) => {
            json::change(&mut value, rng);
            value.to_string().into_bytes()
        }
        _ => text::damage(input, input, rng),
    }
}

/// Header or tensors of a safetensors file.
pub(super) fn safetensors(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let length = word(bytes, 0, 8)?;
    let header = bytes.get(8..8_usize.checked_add(length)?)?;
    let mut body = bytes.get(8 + length..)?.to_vec();
    if rng.random_ratio(1, 3) && !body.is_empty() {
        let at = rng.random_range(0..body.len());
        binary::put_word(&mut body, at, rng);
        return Some([&bytes[..8 + length], &body].concat());
    }
    let mut header = changed_json(header, rng);
    header.resize(header.len().next_multiple_of(8), b' ');
    let said = if is_mended(rng) { header.len() } else { length };
    Some([&(said as u64).to_le_bytes(), &header[..], &body].concat())
}

/// JSON or data of a binary glTF file.
pub(super) fn glb(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let length = word(bytes, 12, 4)?;
    let text = bytes.get(20..20_usize.checked_add(length)?)?;
    let rest = bytes.get(20 + length..)?;
    let mut data = rest.get(8..).unwrap_or_default().to_vec();
    let mut text = text.to_vec();
    if rng.random_ratio(1, 3) && !data.is_empty() {
        let at = rng.random_range(0..data.len());
        binary::put_word(&mut data, at, rng);
    } else {
        text = changed_json(&text, rng);
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    if !is_mended(rng) {
        return Some([&bytes[..20], &text, rest].concat());
    }
    let all = 28 + text.len() + data.len();
    let number = |n: usize| (n as u32).to_le_bytes();
    let mut file = [
        &bytes[..8],
        &number(all),
        &number(text.len()),
        b"JSON",
        &text,
    ]
    .concat();
    if !data.is_empty() {
        file.extend([&number(data.len())[..], b"BIN\0", &data].concat());
    }
    Some(file)
}

/// Dictionary or data of a NumPy array.
pub(super) fn npy(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let length = word(bytes, 8, 2)?;
    let header = bytes.get(10..10 + length)?;
    let mut data = bytes.get(10 + length..)?.to_vec();
    if rng.random() && !data.is_empty() {
        let at = rng.random_range(0..data.len());
        binary::put_word(&mut data, at, rng);
        return Some([&bytes[..10 + length], &data].concat());
    }
    let mut header = text::damage(header, b"(1, 2, 3)\n'<f8'\n'>i4'\n'|O'\nTrue", rng);
    header.truncate(usize::from(u16::MAX));
    let said = if is_mended(rng) { header.len() } else { length };
    Some([&bytes[..8], &(said as u16).to_le_bytes(), &header, &data].concat())
}

/// One array of a ZIP archive that is not packed, or the archive's own bytes.
pub(super) fn npz(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let mut entries = Vec::new();
    let mut at = 0;
    while bytes.get(at..at + 4)? == b"PK\x03\x04" {
        let [packed, name, extra] =
            [(18, 4), (26, 2), (28, 2)].map(|(k, n)| word(bytes, at + k, n));
        let (start, packed) = (at + 30, packed?);
        let data = start + name? + extra?;
        let called = bytes.get(start..start + name?)?.to_vec();
        entries.push((called, bytes.get(data..data.checked_add(packed)?)?.to_vec()));
        at = data + packed;
    }
    if entries.is_empty() {
        return None;
    }
    let chosen = rng.random_range(0..entries.len());
    match rng.random_range(0..10) {
        0 => drop(entries.remove(chosen)),
        1 => entries.push(entries[chosen].clone()),
        2 => entries[chosen].0 = text::damage(&entries[chosen].0, b"", rng),
        _ => entries[chosen].1 = npy(&entries[chosen].1, rng)?,
    }
    Some(zip(&entries))
}

/// One record of a TFRecord file, its checksums mended.
pub(super) fn records(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let mut all = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let length = word(bytes, at, 8)?;
        all.push(bytes.get(at + 12..(at + 12).checked_add(length)?)?.to_vec());
        at += 16 + length;
    }
    let chosen = rng.random_range(0..all.len().max(1));
    match (rng.random_range(0..8), all.len()) {
        (_, 0) => return None,
        (0, _) => drop(all.remove(chosen)),
        (1, _) => all.push(all[chosen].clone()),
        _ => all[chosen] = binary::damage(&all[chosen], bytes, rng),
    }
    let mut file = Vec::new();
    for record in all {
        let length = (record.len() as u64).to_le_bytes();
        file.extend([&length[..], &masked_crc32c(&length).to_le_bytes()].concat());
        file.extend([&record[..], &masked_crc32c(&record).to_le_bytes()].concat());
    }
    Some(file)
}

/// CRC-32C as TFRecord keeps it, bit by bit.
fn masked_crc32c(bytes: &[u8]) -> u32 {
    let mut register = u32::MAX;
    for byte in bytes {
        register ^= u32::from(*byte);
        for _ in 0..8 {
            let carry = register & 1;
            register = (register >> 1) ^ (carry * 0x82f6_3b78);
        }
    }
    (!register).rotate_right(15).wrapping_add(0xa282_ead8)
}

/// Body of a message of the socket; its header of four bytes stays most of the time.
pub(super) fn message(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let (header, body) = bytes.split_first_chunk::<4>()?;
    let body = match body.first() {
        Some(b'{') => changed_json(body, rng),
        _ => binary::damage(body, bytes, rng),
    };
    Some([&header[..], &body].concat())
}

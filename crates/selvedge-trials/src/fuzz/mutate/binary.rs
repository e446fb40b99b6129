//! Damage to bytes of which nothing is known.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pick::pick;

/// Words that lengths, counts and floating-point numbers are wrong at.
const WORDS: [u64; 14] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7f80_0000,
    0x7fc0_0000,
    0x7ff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    u64::MAX,
];

/// Bytes of `input` changed, removed, repeated or replaced by some of `other`.
pub(super) fn damage(input: &[u8], other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    if bytes.is_empty() {
        return other.to_vec();
    }
    let at = rng.random_range(0..bytes.len());
    let most = (bytes.len() - at).min(64);
    let length = rng.random_range(1..=most);
    match rng.random_range(0..7) {
        0 => bytes[at] ^= 1 << rng.random_range(0..8),
        1 => bytes[at] = rng.random(),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..at + length)),
        4 => {
            let part = bytes[at..at + length].to_vec();
            bytes.splice(at..at, part);
        }
        5 => put_word(&mut bytes, at, rng),
        _ => {
            let from = rng.random_range(0..=other.len());
            let to = other.len().min(from + length);
            bytes.splice(at..at + length, other[from..to].iter().copied());
        }
    }
    bytes
}

/// Puts a word of one to eight bytes over those from about `at`.
pub(super) fn put_word(bytes: &mut [u8], at: usize, rng: &mut ChaCha8Rng) {
    let size = *pick(&[1, 2, 4, 8], rng);
    let at = if rng.random() { at / size * size } else { at };
    let word = pick(&WORDS, rng).to_le_bytes();
    let at = at.min(bytes.len());
    for (byte, new) in bytes[at..].iter_mut().zip(&word[..size]) {
        *byte = *new;
    }
}

//! Damage to files, by what they are made of: lengths and checksums are mended, so that a reader
//! gets past them to what they guard.

mod binary;
mod containers;
mod json;
mod pick;
mod text;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// The make of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Make {
    /// Words, numbers and signs in lines.
    Text,
    /// Text that is JSON.
    Json,
    /// Lines of JSON.
    JsonLines,
    /// Text that is TOML.
    Toml,
    /// A header of JSON and tensors.
    Safetensors,
    /// Binary glTF.
    Glb,
    /// One NumPy array.
    Npy,
    /// A ZIP archive of NumPy arrays.
    Npz,
    /// TFRecord: records with lengths and checksums.
    Records,
    /// Bytes of any other make.
    Binary,
    /// A message of the viewer's socket.
    Message,
}

/// Damages `input`, a file of this make; `other` is another one, to take parts from.
pub(crate) fn mutate(make: Make, input: &[u8], other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..rng.random_range(1..4) {
        bytes = once(make, &bytes, other, rng);
        // What grows without end is only slow.
        bytes.truncate(MOST_BYTES);
    }
    bytes
}

/// Size that an input may have.
const MOST_BYTES: usize = 1 << 18;

fn once(make: Make, bytes: &[u8], other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    if make != Make::Text && rng.random_ratio(1, 6) {
        return binary::damage(bytes, other, rng);
    }
    let structured = match make {
        Make::Text => Some(text::damage(bytes, other, rng)),
        Make::Json => json::damage(bytes, rng),
        Make::JsonLines => json::damage_line(bytes, rng),
        Make::Toml => json::damage_toml(bytes, rng),
        Make::Safetensors => containers::safetensors(bytes, rng),
        Make::Glb => containers::glb(bytes, rng),
        Make::Npy => containers::npy(bytes, rng),
        Make::Npz => containers::npz(bytes, rng),
        Make::Records => containers::records(bytes, rng),
        Make::Binary => None,
        Make::Message => containers::message(bytes, rng),
    };
    match structured {
        Some(damaged) => damaged,
        None if matches!(make, Make::Json | Make::JsonLines | Make::Toml) => {
            text::damage(bytes, other, rng)
        }
        None => binary::damage(bytes, other, rng),
    }
}

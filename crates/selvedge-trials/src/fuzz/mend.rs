//! Damage to the parts of containers, with the lengths and checksums around them mended, so that a
//! reader gets past these to what they guard.

use super::zip::zip;

/// The make of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Make {
    /// Bytes or text without lengths or checksums of their own.
    Plain,
    /// A header of JSON and tensors.
    Safetensors,
    /// Binary glTF.
    Glb,
    /// A ZIP archive of NumPy arrays.
    Npz,
}

/// `input` with one of its parts, by `choice`, damaged by `damage`, and put together again; none
/// where it is no such file.
pub(super) fn damaged(
    make: Make,
    input: &[u8],
    choice: usize,
    damage: &mut dyn FnMut(&[u8]) -> Vec<u8>,
) -> Option<Vec<u8>> {
    match make {
        Make::Plain => None,
        Make::Safetensors => {
            let header = word(input, 0, 8)?;
            let (header, body) = input.get(8..)?.split_at_checked(header)?;
            if choice.is_multiple_of(3) {
                return Some([&input[..8 + header.len()], &damage(body)].concat());
            }
            let mut header = damage(header);
            header.resize(header.len().next_multiple_of(8), b' ');
            Some([&(header.len() as u64).to_le_bytes(), &header[..], body].concat())
        }
        Make::Glb => {
            let (text, rest) = input.get(20..)?.split_at_checked(word(input, 12, 4)?)?;
            let (mut text, mut data) = (text.to_vec(), rest.get(8..).unwrap_or_default().to_vec());
            if choice.is_multiple_of(3) {
                data = damage(&data);
            } else {
                text = damage(&text);
            }
            text.resize(text.len().next_multiple_of(4), b' ');
            data.resize(data.len().next_multiple_of(4), 0);
            let number = |n: usize| (n as u32).to_le_bytes();
            let all = 28 + text.len() + data.len();
            let head = [&input[..8], &number(all), &number(text.len()), b"JSON"].concat();
            Some([&head[..], &text, &number(data.len()), b"BIN\0", &data].concat())
        }
        Make::Npz => {
            let mut entries = entries(input)?;
            let count = entries.len();
            let entry = entries.get_mut(choice % count.max(1))?;
            entry.1 = damage(&entry.1);
            Some(zip(&entries))
        }
    }
}

/// Names and contents of a ZIP archive that is not packed.
fn entries(bytes: &[u8]) -> Option<Vec<(Vec<u8>, Vec<u8>)>> {
    let mut entries = Vec::new();
    let mut at = 0;
    while bytes.get(at..at + 4)? == b"PK\x03\x04" {
        let [packed, name, extra] =
            [(18, 4), (26, 2), (28, 2)].map(|(k, size)| word(bytes, at + k, size));
        let (start, packed) = (at + 30, packed?);
        let data = start + name? + extra?;
        let called = bytes.get(start..start + name?)?.to_vec();
        entries.push((called, bytes.get(data..data.checked_add(packed)?)?.to_vec()));
        at = data + packed;
    }
    Some(entries)
}

/// Bytes `[at, at + size)` as a little-endian number.
fn word(bytes: &[u8], at: usize, size: usize) -> Option<usize> {
    let part = bytes.get(at..at.checked_add(size)?)?;
    let word = part
        .iter()
        .rev()
        .fold(0_u64, |word, byte| word << 8 | u64::from(*byte));
    usize::try_from(word).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_stay_as_they_are_make_the_same_file() {
        let safetensors = [&8_u64.to_le_bytes()[..], b"{}      ", &[1, 2, 3]].concat();
        let npz = zip(&[
            (b"a.npy".to_vec(), vec![1, 2]),
            (b"b.npy".to_vec(), vec![3]),
        ]);
        let glb = [
            &b"glTF\x02\0\0\0"[..],
            &36_u32.to_le_bytes(),
            &4_u32.to_le_bytes(),
            b"JSON{}  ",
            &4_u32.to_le_bytes(),
            b"BIN\0abcd",
        ]
        .concat();
        for (make, file) in [
            (Make::Safetensors, safetensors),
            (Make::Npz, npz),
            (Make::Glb, glb),
        ] {
            for choice in 0..4 {
                let same = damaged(make, &file, choice, &mut |part| part.to_vec());
                assert_eq!(same.as_deref(), Some(&file[..]), "{make:?} {choice}");
                let longer = damaged(make, &file, choice, &mut |part| [part, b"x"].concat());
                let longer = longer.unwrap();
                let again = damaged(make, &longer, choice, &mut |part| part.to_vec());
                assert_eq!(again, Some(longer), "{make:?} {choice}");
            }
            let mut keep = |part: &[u8]| part.to_vec();
            assert_eq!(damaged(make, &file[..7], 0, &mut keep), None);
        }
    }
}

//! Archives of arrays, packed as NumPy packs them.

use std::io::Write;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::formats::arrays::ArrayFile;
use crate::test_help::says;

/// A .npy file of f64 or i64 numbers.
pub(crate) fn npy(descr: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(bytes);
    file
}

pub(crate) fn floats(shape: &str, values: &[f64]) -> Vec<u8> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    npy("<f8", shape, &bytes)
}

/// A ZIP archive of `files`, deflated.
pub(crate) fn archive(files: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        let packed = SimpleFileOptions::DEFAULT.compression_method(CompressionMethod::Deflated);
        zip.start_file(format!("{name}.npy"), packed).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn arrays_come_back_with_type_and_shape() {
    let values = [0.1, 1e-300, -5.0, 0.2, 7.0, 1.0];
    let single = [1.5_f32, -2.0].map(f32::to_le_bytes);
    let frames = [60_i32, 120].map(i32::to_le_bytes);
    let bytes = archive(&[
        ("x", floats("(2, 1, 3)", &values)),
        ("single", npy("<f4", "(2,)", single.as_flattened())),
        ("frames", npy("<i4", "(2,)", frames.as_flattened())),
        ("text", npy("<U4", "()", &[0; 16])),
        ("rate", npy("<i8", "()", &60_i64.to_le_bytes())),
    ]);
    let file = ArrayFile::npz(&bytes).unwrap();
    assert_eq!(file.names(), ["frames", "rate", "single", "text", "x"]);
    assert_eq!(file.floats("rate").unwrap().single().unwrap(), 60.0);
    assert!(file.floats("single").unwrap().single().is_err());
    let x = file.floats("x").unwrap();
    assert_eq!(x.shape, [2, 1, 3]);
    assert_eq!(x.values, values);
    assert!(file.wholes("x").is_err());
    assert_eq!(file.floats("single").unwrap().values, [1.5, -2.0]);
    assert_eq!(file.singles("single").unwrap().values, [1.5, -2.0]);
    assert_eq!(file.wholes("frames").unwrap().values, [60, 120]);
    let refused = |name: &str, words: &str| says(file.floats(name).err().unwrap(), &[words]);
    refused("text", "array text: expected F64 or F32, found <U4 []");
    let named = "has no array named y (found frames, rate, single, text, x)";
    refused("y", named);
}

#[test]
fn damage_is_an_error_and_no_panic() {
    let whole = archive(&[("x", floats("(3,)", &[1.0, 2.0, 3.0]))]);
    for length in 0..whole.len() {
        let cut = ArrayFile::npz(&whole[..length]);
        assert!(cut.is_err(), "{length} of {} bytes", whole.len());
    }
    for at in 0..whole.len() {
        let mut spoilt = whole.clone();
        spoilt[at] ^= 0xff;
        // Bytes that tell the time or a version have no meaning here; all others show.
        if let Ok(file) = ArrayFile::npz(&spoilt)
            && let Ok(array) = file.floats("x")
        {
            assert_eq!(array.values, [1.0, 2.0, 3.0]);
        }
    }
    let wrong = archive(&[("x", floats("(4,)", &[1.0]))]);
    let error = ArrayFile::npz(&wrong).unwrap().floats("x").err().unwrap();
    says(error, &["its shape needs 32"]);
}

//! Point caches (.pc2): the positions of every point in every sample.
//!
//! Little-endian: "POINTCACHE2\0", version 1 (i32), points (i32), first frame (f32), frames from one
//! sample to the next (f32), samples (i32), then x, y, z (f32) by sample and point. The rate is not
//! in the file. Format: as Blender's Mesh Cache reads it. A file is read whole; its length must be
//! what its header says, so that no more memory is taken than a few times its size.

use std::io::{self, Write};

use glam::{DVec3, Vec3};

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER: usize = 32;

/// Points over time.
#[derive(Debug, PartialEq)]
pub(crate) struct PointCache {
    /// Frames from one sample to the next.
    pub(crate) every: f64,
    /// Points by sample.
    pub(crate) frames: Vec<Vec<DVec3>>,
}

/// Writes the header of `samples` of `points`, `every` so many frames.
pub(crate) fn write_header(
    out: &mut impl Write,
    samples: usize,
    points: usize,
    every: usize,
) -> io::Result<()> {
    let count = |number: usize| i32::try_from(number).map_err(io::Error::other);
    out.write_all(MAGIC)?;
    out.write_all(&1_i32.to_le_bytes())?;
    out.write_all(&count(points)?.to_le_bytes())?;
    out.write_all(&0_f32.to_le_bytes())?;
    out.write_all(&(every as f32).to_le_bytes())?;
    out.write_all(&count(samples)?.to_le_bytes())
}

/// Writes the points of a sample.
pub(crate) fn write_points(out: &mut impl Write, points: &[Vec3]) -> io::Result<()> {
    let mut coordinates = points.iter().flat_map(|p| p.to_array());
    coordinates.try_for_each(|coordinate| out.write_all(&coordinate.to_le_bytes()))
}

/// The cache in the bytes of a .pc2.
pub(crate) fn parse(bytes: &[u8]) -> Result<PointCache, String> {
    if !bytes.starts_with(MAGIC) {
        return Err("is no point cache: it does not begin with POINTCACHE2".to_owned());
    }
    let field = |at: usize| -> Result<[u8; 4], String> {
        let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
        four.ok_or_else(|| {
            format!(
                "ends at byte {}, within its header of {HEADER}",
                bytes.len()
            )
        })
    };
    let whole = |at: usize| Ok::<_, String>(i32::from_le_bytes(field(at)?));
    let version = whole(12)?;
    if version != 1 {
        return Err(format!("is a point cache of version {version}, known is 1"));
    }
    let (points, samples) = (whole(16)?, whole(28)?);
    let step = f64::from(f32::from_le_bytes(field(24)?));
    let (Ok(points @ 1..), Ok(samples @ 1..)) = (usize::try_from(points), usize::try_from(samples))
    else {
        return Err(format!(
            "has {samples} samples of {points} points: it is empty"
        ));
    };
    if !(step.is_finite() && step > 0.0) {
        return Err(format!("has a sample every {step} frames, which cannot be"));
    }
    let expected = samples.checked_mul(points);
    let expected = expected.and_then(|n| n.checked_mul(12)?.checked_add(HEADER));
    if expected != Some(bytes.len()) {
        return Err(format!(
            "has {} bytes, but {samples} samples of {points} points need {}: it was cut short or changed",
            bytes.len(),
            expected.map_or_else(|| "more than there can be".to_owned(), |n| n.to_string())
        ));
    }
    let words = bytes[HEADER..].as_chunks::<4>().0.iter();
    let numbers = words.map(|word| f64::from(f32::from_le_bytes(*word)));
    let numbers: Vec<f64> = numbers.collect();
    let sample = |own: &[f64]| own.chunks_exact(3).map(DVec3::from_slice).collect();
    Ok(PointCache {
        every: step,
        frames: numbers.chunks_exact(3 * points).map(sample).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache(points: i32, samples: i32, step: f32, numbers: &[f32]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(1_i32.to_le_bytes());
        bytes.extend(points.to_le_bytes());
        bytes.extend(0_f32.to_le_bytes());
        bytes.extend(step.to_le_bytes());
        bytes.extend(samples.to_le_bytes());
        bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        bytes
    }

    #[test]
    fn what_is_written_is_read() {
        let mut out = Vec::new();
        write_header(&mut out, 2, 1, 3).unwrap();
        write_points(&mut out, &[Vec3::X]).unwrap();
        write_points(&mut out, &[Vec3::new(1.0, 2.0, 3.0)]).unwrap();
        assert_eq!(out.len(), HEADER + 24);
        let expected = PointCache {
            every: 3.0,
            frames: vec![vec![DVec3::X], vec![DVec3::new(1.0, 2.0, 3.0)]],
        };
        assert_eq!(parse(&out), Ok(expected));
    }

    #[test]
    fn what_is_damaged_is_named() {
        let good = cache(1, 2, 1.0, &[0.0; 6]);
        for (bytes, named) in [
            (b"POINTCACHE1".to_vec(), "does not begin"),
            (good[..20].to_vec(), "ends at byte 20"),
            (good[..40].to_vec(), "need 56: it was cut short"),
            (cache(0, 2, 1.0, &[]), "empty"),
            (cache(i32::MAX, i32::MAX, 1.0, &[]), "need "),
            (cache(1, 2, 0.0, &[0.0; 6]), "every 0 frames"),
        ] {
            let problem = parse(&bytes).unwrap_err();
            assert!(problem.contains(named), "{named}: {problem}");
        }
    }
}

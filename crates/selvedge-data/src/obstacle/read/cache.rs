//! Point caches (.pc2, .mdd): the positions of every point in every sample.
//!
//! A .pc2 is little-endian: "POINTCACHE2\0", version 1 (i32), points (i32), first frame (f32),
//! frames from one sample to the next (f32), samples (i32), then x, y, z (f32) by sample and point.
//! The rate is not in the file. A .mdd is big-endian: samples (i32), points (i32), the time of each
//! sample (f32, s), then x, y, z (f32) by sample and point. Formats: as Blender's Mesh Cache and
//! LightWave read them. A file is read whole; its length must be what its header says, so that no
//! more memory is taken than a few times its size.

use glam::DVec3;

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER: usize = 32;
const MDD_HEADER: usize = 8;

/// Largest part of the time between two samples by which the time of one may be off: single
/// precision, after hours.
const UNEVEN: f64 = 0.02;

/// Points over time.
#[derive(Debug, PartialEq)]
pub(super) struct Cache {
    /// Time from one sample to the next.
    pub(super) step: Step,
    pub(super) frames: Vec<Vec<DVec3>>,
}

/// A time from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// In frames, of which nothing says how long they are.
    Frames(f64),
    Seconds(f64),
}

impl Step {
    /// Samples per second, where `rate` frames are a second.
    pub(super) fn rate(self, rate: f64) -> f64 {
        match self {
            Self::Frames(frames) => rate / frames,
            Self::Seconds(seconds) => 1.0 / seconds,
        }
    }
}

/// The cache in the bytes of a .pc2.
///
/// # Errors
/// The defect, as a sentence.
pub(super) fn parse(bytes: &[u8]) -> Result<Cache, String> {
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
    let expected = samples
        .checked_mul(points)
        .and_then(|n| n.checked_mul(12)?.checked_add(HEADER));
    if expected != Some(bytes.len()) {
        return Err(format!(
            "has {} bytes, but {samples} samples of {points} points need {}: it was cut short or changed",
            bytes.len(),
            expected.map_or_else(|| "more than there can be".to_owned(), |n| n.to_string())
        ));
    }
    let coordinate = |c: &[u8]| f64::from(f32::from_le_bytes([c[0], c[1], c[2], c[3]]));
    let point = |p: &[u8]| {
        DVec3::new(
            coordinate(&p[..4]),
            coordinate(&p[4..8]),
            coordinate(&p[8..]),
        )
    };
    let frames = bytes[HEADER..].chunks_exact(12 * points);
    Ok(Cache {
        step: Step::Frames(step),
        frames: frames
            .map(|frame| frame.chunks_exact(12).map(point).collect())
            .collect(),
    })
}

/// The cache in the bytes of a .mdd. One sample has no rate: it is taken to last a frame.
///
/// # Errors
/// The defect, as a sentence.
pub(super) fn parse_mdd(bytes: &[u8]) -> Result<Cache, String> {
    let word = |at: usize| -> Option<[u8; 4]> { bytes.get(at..at + 4)?.try_into().ok() };
    let (Some(samples), Some(points)) = (word(0), word(4)) else {
        return Err(format!(
            "ends at byte {}, within its header of {MDD_HEADER}",
            bytes.len()
        ));
    };
    let (samples, points) = (i32::from_be_bytes(samples), i32::from_be_bytes(points));
    let sizes = (usize::try_from(samples), usize::try_from(points));
    let (Ok(samples @ 1..), Ok(points @ 1..)) = sizes else {
        return Err(format!(
            "has {samples} samples of {points} points: it is empty, or no .mdd"
        ));
    };
    let expected = samples
        .checked_mul(points)
        .and_then(|n| n.checked_mul(12)?.checked_add(MDD_HEADER + 4 * samples));
    if expected != Some(bytes.len()) {
        return Err(format!(
            "has {} bytes, but {samples} samples of {points} points need {}: it was cut short or changed, or is no .mdd",
            bytes.len(),
            expected.map_or_else(|| "more than there can be".to_owned(), |n| n.to_string())
        ));
    }
    let number = |c: &[u8]| f64::from(f32::from_be_bytes([c[0], c[1], c[2], c[3]]));
    let (times, coordinates) = bytes[MDD_HEADER..].split_at(4 * samples);
    let times: Vec<f64> = times.chunks_exact(4).map(number).collect();
    let point = |p: &[u8]| DVec3::new(number(&p[..4]), number(&p[4..8]), number(&p[8..]));
    Ok(Cache {
        step: even_step(&times)?,
        frames: coordinates
            .chunks_exact(12 * points)
            .map(|frame| frame.chunks_exact(12).map(point).collect())
            .collect(),
    })
}

/// The time between two of `times` `[s]`, which must be even.
fn even_step(times: &[f64]) -> Result<Step, String> {
    let [first, .., last] = times else {
        return Ok(Step::Frames(1.0));
    };
    let step = (last - first) / (times.len() - 1) as f64;
    let is_off = |(number, time): (usize, &f64)| {
        let off = (time - first - number as f64 * step).abs();
        off.is_nan() || off > UNEVEN * step
    };
    if !(step.is_finite() && step > 0.0) {
        return Err(format!(
            "has samples from {first} s to {last} s: their times must grow"
        ));
    }
    match times.iter().enumerate().find(|&(k, t)| is_off((k, t))) {
        None => Ok(Step::Seconds(step)),
        Some((number, time)) => Err(format!(
            "has sample {number} at {time} s, but samples every {step} s: bake it anew at an even rate"
        )),
    }
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
    fn samples_are_read_in_order() {
        let numbers: Vec<f32> = (0..12).map(|n| n as f32).collect();
        let read = parse(&cache(2, 2, 0.5, &numbers)).unwrap();
        assert_eq!(read.step, Step::Frames(0.5));
        assert_eq!(read.step.rate(60.0), 120.0);
        assert_eq!(read.frames[1][0], DVec3::new(6.0, 7.0, 8.0));
        assert_eq!(read.frames[0].len(), 2);
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

    fn mdd(samples: i32, points: i32, times: &[f32], numbers: &[f32]) -> Vec<u8> {
        let mut bytes = samples.to_be_bytes().to_vec();
        bytes.extend(points.to_be_bytes());
        bytes.extend(times.iter().chain(numbers).flat_map(|n| n.to_be_bytes()));
        bytes
    }

    #[test]
    fn samples_of_a_mdd_have_times() {
        let numbers: Vec<f32> = (0..18).map(|n| n as f32).collect();
        let read = parse_mdd(&mdd(3, 2, &[1.0, 1.04, 1.08], &numbers)).unwrap();
        assert!((read.step.rate(60.0) - 25.0).abs() < 1e-4);
        assert_eq!(read.frames[2][1], DVec3::new(15.0, 16.0, 17.0));
        let one = parse_mdd(&mdd(1, 1, &[9.0], &[1.0, 2.0, 3.0])).unwrap();
        assert_eq!(one.step.rate(60.0), 60.0);
    }

    #[test]
    fn what_is_damaged_in_a_mdd_is_named() {
        let good = mdd(3, 1, &[0.0, 1.0, 2.0], &[0.0; 9]);
        assert!(parse_mdd(&good).is_ok());
        for (bytes, named) in [
            (good[..6].to_vec(), "ends at byte 6"),
            (good[..40].to_vec(), "need 56: it was cut short"),
            (mdd(0, 2, &[], &[]), "empty"),
            (mdd(-1, 2, &[], &[]), "empty"),
            (mdd(i32::MAX, i32::MAX, &[], &[]), "need "),
            (mdd(3, 1, &[0.0; 3], &[0.0; 9]), "must grow"),
            (
                mdd(3, 1, &[0.0, f32::NAN, 2.0], &[0.0; 9]),
                "sample 1 at NaN",
            ),
            (mdd(3, 1, &[0.0, 0.5, 2.0], &[0.0; 9]), "even rate"),
            (mdd(2, 1, &[0.0, f32::INFINITY], &[0.0; 6]), "must grow"),
        ] {
            let problem = parse_mdd(&bytes).unwrap_err();
            assert!(problem.contains(named), "{named}: {problem}");
        }
    }
}

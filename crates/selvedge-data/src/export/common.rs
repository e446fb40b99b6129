//! What the writers of exports share: the largest size of a file, and bytes of numbers.

use glam::Vec3;

use crate::formats::file_error::Problem;

/// The most bytes that a file can have whose lengths have 32 bits.
const LARGEST: u64 = u32::MAX as u64;

/// An error where `bytes`, of every `every`th frame, are more than lengths of 32 bits can say, with
/// the thinning that helps.
pub(super) fn check_size(format: &str, bytes: u64, every: usize) -> Result<(), Problem> {
    if bytes <= LARGEST {
        return Ok(());
    }
    let every = every as u64 * bytes.div_ceil(LARGEST);
    Err(Problem(format!(
        "{format} would have {bytes} bytes, more than the 4 GiB that the format can hold: take every {every}th frame, or fewer frames, or .usdc, which has no limit"
    )))
}

pub(super) fn le_floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

pub(super) fn le_points(points: &[Vec3]) -> Vec<u8> {
    le_floats(points.iter().flat_map(|p| p.to_array()))
}

pub(super) fn le_words(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::{LARGEST, check_size};

    #[test]
    fn what_is_too_large_is_told_with_the_thinning_that_helps() {
        check_size(".npz", LARGEST, 2).unwrap();
        let error = check_size(".npz", 5 * LARGEST - 1, 2).unwrap_err();
        assert!(error.to_string().contains("every 10th frame"), "{error}");
    }
}

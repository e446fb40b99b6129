//! Slots as bytes, to travel from the rank that moves them to the one that writes checkpoints.

use std::sync::Arc;

use glam::Vec3;
use selvedge_data::Section;

use crate::slot::Slot;

/// The bytes of slots.
pub(crate) fn pack_slots(slots: &[Slot]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let put = |bytes: &mut Vec<u8>, number: usize| bytes.extend((number as u64).to_le_bytes());
    for slot in slots {
        let Section {
            trajectory,
            start,
            end,
        } = slot.section;
        let run = slot.run as usize;
        let rows = slot.history.first().map_or(0, |frame| frame.len());
        for number in [
            trajectory,
            start,
            end,
            slot.current,
            run,
            slot.history.len(),
            rows,
        ] {
            put(&mut bytes, number);
        }
        for point in slot.history.iter().flat_map(|frame| frame.iter()) {
            let numbers = point.to_array();
            bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
    }
    bytes
}

/// Slots from their bytes; none where these are of something else.
pub(crate) fn unpack_slots(mut bytes: &[u8]) -> Option<Vec<Slot>> {
    let mut slots = Vec::new();
    while !bytes.is_empty() {
        let mut numbers = [0_usize; 7];
        for number in &mut numbers {
            let (word, rest) = bytes.split_first_chunk::<8>()?;
            *number = usize::try_from(u64::from_le_bytes(*word)).ok()?;
            bytes = rest;
        }
        let [trajectory, start, end, current, run, frames, rows] = numbers;
        let points = frames.checked_mul(rows)?;
        let (history, rest) = bytes.split_at_checked(points.checked_mul(12)?)?;
        bytes = rest;
        let (words, _) = history.as_chunks::<4>();
        let numbers: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
        let points: Vec<Vec3> = numbers
            .as_chunks()
            .0
            .iter()
            .map(|p| Vec3::from_array(*p))
            .collect();
        slots.push(Slot {
            section: Section {
                trajectory,
                start,
                end,
            },
            current,
            run: u32::try_from(run).ok()?,
            history: points
                .chunks(rows.max(1))
                .map(|frame| Arc::new(frame.to_vec()))
                .collect(),
        });
    }
    Some(slots)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_come_back_and_what_is_cut_does_not() {
        let mut moving = Slot::new();
        moving.section.trajectory = 3;
        moving.section.end = 40;
        (moving.current, moving.run) = (17, 5);
        let point = |frame: i32, row: i32| Vec3::new(frame as f32, row as f32 / 3.0, -0.0);
        moving.history = (0..4)
            .map(|f| Arc::new((0..9).map(|r| point(f, r)).collect()))
            .collect();
        let slots = [Slot::new(), moving, Slot::new()];
        let bytes = pack_slots(&slots);
        assert_eq!(unpack_slots(&bytes).unwrap(), slots);
        let ends = [0, 56, 112 + 4 * 9 * 12];
        for cut in 0..bytes.len() {
            assert_eq!(
                unpack_slots(&bytes[..cut]).is_some(),
                ends.contains(&cut),
                "{cut}"
            );
        }
    }
}

//! The schedule from accelerations to the next positions. Its reference is
//! [`selvedge_model::advance`]: both lead to the same positions but for rounding.

use crate::cloths::features::FeatureSources;
use crate::kernels::motion::INTEGRATE;
use crate::schedule::plan::Region;
use crate::schedule::{Schedule, args};

/// Adds the way from normalised accelerations `output` `[vertices, 3]` to the next positions, which
/// go to the slot after the newest.
pub fn advance(schedule: &mut Schedule, from: FeatureSources<'_>, output: Region) {
    let FeatureSources {
        cloths,
        frames,
        normalizers,
    } = from;
    let arguments = args! {
        ..frames.ring(),
        output,
        shift: normalizers.acceleration.shift,
        spread: normalizers.acceleration.scale,
        numbers: frames.numbers,
        cloth_of: cloths.cloth_of,
        handle_of: cloths.handle_of,
        targets: frames.targets,
    };
    schedule.launch(&INTEGRATE, cloths.sizes.vertices, arguments);
}

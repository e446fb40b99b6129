//! The schedule from accelerations to the next positions, with the bounds of edge lengths. Its
//! reference is [`selvedge_model::advance`]: both lead to the same positions but for rounding.
//!
//! The edges are handled colour by colour, all edges of a colour at once; the processor handles
//! them by number. So the results differ where several edges are out of bounds. Where none is, both
//! leave every position as it is.

use crate::cloths::features::FeatureSources;
use crate::kernels::motion::{INTEGRATE, LIMIT_EDGES};
use crate::schedule::plan::Region;
use crate::schedule::{Schedule, args};

/// Adds the way from normalised accelerations `output` `[vertices, 3]` to the next positions, which
/// go to the slot after the newest. `changed` (`[cloths]`) is room for the bounds of edges, where
/// the spec has any.
pub fn advance(
    schedule: &mut Schedule,
    from: FeatureSources<'_>,
    output: Region,
    changed: Option<Region>,
) {
    let FeatureSources {
        cloths,
        frames,
        normalizers,
    } = from;
    let sizes = cloths.sizes;
    let arguments = args! {
        ..frames.ring(),
        output,
        shift: normalizers.acceleration.shift,
        spread: normalizers.acceleration.scale,
        numbers: frames.numbers,
        carries: frames.last,
        cloth_of: cloths.cloth_of,
        rest: cloths.rest,
        handle_of: cloths.handle_of,
        targets: frames.targets,
    };
    schedule.launch(&INTEGRATE, sizes.vertices, arguments);
    let Some(changed) = changed else { return };
    let arguments = args! {
        ..frames.ring(),
        edge_ends: cloths.edge_ends,
        edge_rest: cloths.edge_rest,
        inverse_mass: cloths.inverse_mass,
        colour_bounds: cloths.colour_bounds,
        colours: sizes.colours,
        changed,
    };
    schedule.launch(&LIMIT_EDGES, sizes.cloths, arguments);
}

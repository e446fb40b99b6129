//! Rigid motion of the last good frame with its handles, used without physics:
//! p = c + R (p₋ - c₋), with c₋ and c the centroids of the handles before and after, and R the turn
//! about the vertical that fits them best `[eq:guard-carry]`. Handles end at their targets exactly;
//! those that are let go are like any other vertex.

use glam::{DQuat, DVec3, Vec3};
use selvedge_cloth::{HandleTargets, Handles};

/// Carries the frame `from` `[m]`, `[vertices]`, with its handles to `targets`, and puts the result
/// into `to`.
pub(crate) fn carry(handles: &Handles, from: &[Vec3], targets: &HandleTargets, to: &mut Vec<Vec3>) {
    let held = targets.held(handles);
    let pairs = held.map(|(vertex, target)| (from[vertex.index()].as_dvec3(), target));
    let (before, after): (Vec<DVec3>, Vec<DVec3>) = pairs.unzip();
    let count = before.len().max(1) as f64;
    let [old, new] = [&before, &after].map(|held| held.iter().sum::<DVec3>() / count);
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (held, target) in before.iter().zip(&after) {
        let (d, e) = (*held - old, *target - new);
        cosine += d.x * e.x + d.z * e.z;
        sine += d.z * e.x - d.x * e.z;
    }
    let turn = DQuat::from_rotation_y(sine.atan2(cosine));
    to.clear();
    to.extend(
        from.iter()
            .map(|p| (new + turn * (p.as_dvec3() - old)).as_vec3()),
    );
    for (vertex, target) in targets.held(handles) {
        to[vertex.index()] = target.as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [Vec3; 4] = [
        Vec3::new(0.1, 1.0, -0.5),
        Vec3::new(-0.1, 1.1, 0.5),
        Vec3::new(0.3, 0.0, 0.4),
        Vec3::new(0.2, -0.1, -0.6),
    ];

    #[test]
    fn a_rigid_motion_of_the_handles_is_that_of_all() {
        let handles = Handles::new(&[0, 1], 4).unwrap();
        let mut carried = Vec::new();
        for angle in [-3.0, -1.2, 0.0, 0.4, 2.9] {
            let motion = |p: Vec3| {
                DQuat::from_rotation_y(angle) * p.as_dvec3() + DVec3::new(0.5, -2.0, 0.25)
            };
            let targets = handles.of(&FRAME).map(motion).collect();
            let targets = HandleTargets::at_frame_end(targets).unwrap();
            carry(&handles, &FRAME, &targets, &mut carried);
            for (found, from) in carried.iter().zip(FRAME) {
                // Positions of a few metres in f32.
                assert!(found.as_dvec3().distance(motion(from)) < 1e-6, "{angle}");
            }
        }
    }

    #[test]
    fn one_handle_moves_all_and_none_moves_nothing() {
        let mut carried = Vec::new();
        let one = Handles::new(&[2], 4).unwrap();
        let target = HandleTargets::at_frame_end(vec![DVec3::new(1.3, 0.0, 0.4)]).unwrap();
        carry(&one, &FRAME, &target, &mut carried);
        for (found, from) in carried.iter().zip(FRAME) {
            assert!(found.distance(from + Vec3::X) < 1e-6);
        }
        let none = HandleTargets::at_frame_end(Vec::new()).unwrap();
        carry(&Handles::new(&[], 4).unwrap(), &FRAME, &none, &mut carried);
        assert_eq!(carried, FRAME);
        // One that is let go leads nothing.
        let free = target.releasing(vec![true]).unwrap();
        carry(&one, &FRAME, &free, &mut carried);
        assert_eq!(carried, FRAME);
    }
}

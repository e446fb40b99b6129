//! A baseline: the rest pose as a rigid body that follows its handles, translated with their
//! centroid and turned by their yaw. Whoever predicts less well than this has learned nothing of
//! the motion of cloth.
//!
//! p = c + R (p₀ - c₀), with p₀ the rest pose, c₀ and c the centroids of the handles at rest and
//! now, and R the turn about the vertical that fits the handles best (the yaw of the local frame).

use glam::Vec3;
use selvedge_cloth::{
    Cloth, HandleTargets, Handles, Snapshot, StepError, Stepper, Topology, VertexId,
    check_targets_hold,
};
use selvedge_model::{LocalFrame, Yaw};

/// A rigid rest pose that follows its handles.
pub struct RigidRest {
    topology: Topology,
    handles: Handles,
    frame: LocalFrame,
    /// The rest pose about its handles' centroid, in its own local frame `[m]`, `[vertices]`.
    local: Vec<Vec3>,
    positions: Vec<Vec3>,
    yaw: Yaw,
    frames_done: usize,
}

impl RigidRest {
    /// Starts in the rest pose of `cloth`.
    pub fn new(cloth: &Cloth) -> Self {
        let held = cloth.handles().select(cloth.rest_positions());
        let frame = LocalFrame::new(&held);
        let (yaw, center) = (frame.rest_yaw(), centroid(&held));
        let to_local = |p: &Vec3| yaw.to_local(*p - center);
        Self {
            topology: cloth.topology().clone(),
            handles: cloth.handles().clone(),
            local: cloth.rest_positions().iter().map(to_local).collect(),
            positions: cloth.rest_positions().to_vec(),
            frame,
            yaw,
            frames_done: 0,
        }
    }
}

impl Stepper for RigidRest {
    fn topology(&self) -> &Topology {
        &self.topology
    }

    fn handles(&self) -> &Handles {
        &self.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn frame(&self) -> usize {
        self.frames_done
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_targets_hold(self, targets)?;
        let held: Vec<Vec3> = targets.end().iter().map(|p| p.as_vec3()).collect();
        let (yaw, center) = (self.frame.yaw(&held, self.yaw), centroid(&held));
        let place = |local: &Vec3| center + yaw.to_world(*local);
        if let Some(vertex) = self.local.iter().position(|p| !place(p).is_finite()) {
            return Err(StepError::NonFinite {
                frame: self.frames_done + 1,
                vertex: VertexId(vertex as u32),
            });
        }
        for (position, local) in self.positions.iter_mut().zip(&self.local) {
            *position = place(local);
        }
        self.yaw = yaw;
        self.frames_done += 1;
        Ok(())
    }

    fn snapshot(&self) -> Option<Snapshot> {
        let state: State = (self.positions.clone(), self.yaw, self.frames_done);
        Some(Snapshot::of(state))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let vertices = self.positions.len();
        let state: &State =
            snapshot.get(self.frames_done, |state: &State| state.0.len() == vertices)?;
        (self.positions, self.yaw, self.frames_done) = state.clone();
        Ok(())
    }
}

/// Positions `[m]`, `[vertices]`, the yaw and the number of the frame.
type State = (Vec<Vec3>, Yaw, usize);

/// The mean of `positions`; the origin where there are none.
fn centroid(positions: &[Vec3]) -> Vec3 {
    positions.iter().sum::<Vec3>() / positions.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::{HandlesEnd, check};
    use glam::{DVec3, Vec2};
    use selvedge_cloth::ClothArrays;

    /// Two triangles, held at vertices 0 and 1.
    fn cloth() -> Cloth {
        let rest_positions = vec![
            Vec3::new(0.1, 1.0, -0.5),
            Vec3::new(-0.1, 1.1, 0.5),
            Vec3::new(0.3, 0.0, 0.4),
            Vec3::new(0.2, -0.1, -0.6),
        ];
        let arrays = ClothArrays {
            rest_positions,
            material_coordinates: vec![Vec2::ZERO; 4],
            vertex_mass: vec![1.0; 4],
            face_area: vec![1.0; 2],
        };
        let topology = Topology::new(4, &[[0, 2, 1], [0, 3, 2]]).unwrap();
        Cloth::new(topology, Handles::new(&[0, 1], 4).unwrap(), arrays).unwrap()
    }

    #[test]
    fn a_rigid_rest_pose_conforms() {
        let make = || RigidRest::new(&cloth());
        check(make, HandlesEnd::Elsewhere);
    }

    #[test]
    fn a_rigid_motion_of_the_handles_moves_the_whole_rest_pose_so() {
        let cloth = cloth();
        let mut stepper = RigidRest::new(&cloth);
        assert_eq!(stepper.positions(), cloth.rest_positions());
        for step in 1..=24 {
            let turn = glam::DQuat::from_rotation_y(0.3 * f64::from(step));
            let shift = DVec3::new(0.4, -0.2, 1.5) * f64::from(step);
            let moved = |p: Vec3| turn * p.as_dvec3() + shift;
            let targets = cloth.handles().select(cloth.rest_positions());
            let targets = targets.into_iter().map(moved).collect();
            let targets = HandleTargets::at_frame_end(targets).unwrap();
            stepper.step(&targets).unwrap();
            for (found, rest) in stepper.positions().iter().zip(cloth.rest_positions()) {
                // Positions up to 40 m in f32: half a unit in the last place is 2e-6 m, and a yaw
                // from handles so placed has the same error over their distance of 1 m.
                assert!(found.as_dvec3().distance(moved(*rest)) < 2e-5);
            }
        }
        assert_eq!(stepper.frame(), 24);
    }

    #[test]
    fn targets_of_another_number_are_refused() {
        let mut stepper = RigidRest::new(&cloth());
        let targets = HandleTargets::at_frame_end(vec![DVec3::ZERO]).unwrap();
        assert!(stepper.step(&targets).is_err());
        assert_eq!(stepper.frame(), 0);
    }
}

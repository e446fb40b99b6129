//! A stepper with every defect that the check must find.
#![allow(clippy::unwrap_used, reason = "a failing helper fails its test")]

mod conformance;

use conformance::{HandlesEnd, check};
use glam::Vec3;
use selvedge_cloth::{
    HandleTargets, Handles, Snapshot, StepError, Stepper, Topology, VertexId, check_target_count,
    check_targets_hold,
};

/// A defect of a [`Carrier`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Defect {
    None,
    NoCount,
    NoRange,
    NamesFrameLeft,
    MovesOnFailure,
    RemembersFailure,
    MissesTargets,
    KeepsFrame,
    LosesVertex,
    LosesFiniteness,
    GoesBackAnywhere,
    GoesBackInPart,
}

/// A square whose vertices all follow the first handle.
struct Carrier {
    topology: Topology,
    handles: Handles,
    positions: Vec<Vec3>,
    frame: usize,
    failures: usize,
    defect: Defect,
}

fn carrier(defect: Defect) -> Carrier {
    Carrier {
        topology: Topology::new(4, &[[0, 2, 1], [0, 3, 2]]).unwrap(),
        handles: Handles::new(&[0, 1], 4).unwrap(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y],
        frame: 0,
        failures: 0,
        defect,
    }
}

impl Carrier {
    fn check(&self, targets: &HandleTargets) -> Result<(), StepError> {
        if self.defect != Defect::NoCount {
            check_target_count(self, targets)?;
            check_targets_hold(self, targets)?;
        }
        let is_far = targets.end().iter().any(|p| !p.as_vec3().is_finite());
        if is_far && self.defect != Defect::NoRange {
            return Err(StepError::NonFinite {
                frame: self.frame + usize::from(self.defect != Defect::NamesFrameLeft),
                vertex: VertexId(0),
            });
        }
        Ok(())
    }
}

impl Stepper for Carrier {
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
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        if let Err(error) = self.check(targets) {
            self.failures += usize::from(self.defect == Defect::RemembersFailure);
            if self.defect == Defect::MovesOnFailure {
                self.positions[3] += Vec3::X;
            }
            return Err(error);
        }
        self.positions[2].y += 0.001 * (self.failures + 1) as f32;
        let places = targets.end().iter().map(|p| p.as_vec3());
        for (vertex, place) in self.handles.vertices().iter().zip(places) {
            self.positions[vertex.index()] = place;
        }
        match self.defect {
            Defect::MissesTargets => self.positions[1].z += 1e-6,
            Defect::LosesVertex => self.positions.truncate(3),
            Defect::LosesFiniteness => self.positions[3].x = f32::INFINITY,
            _ => (),
        }
        self.frame += usize::from(self.defect != Defect::KeepsFrame);
        Ok(())
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Snapshot::of((self.positions.clone(), self.frame)))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let found = snapshot.get(self.frame, |_: &(Vec<Vec3>, usize)| true);
        if found.is_err() && self.defect == Defect::GoesBackAnywhere {
            return Ok(());
        }
        (self.positions, self.frame) = found?.clone();
        if self.defect == Defect::GoesBackInPart {
            self.positions[2] += Vec3::Y;
        }
        Ok(())
    }
}

/// What the check says of a stepper with this defect.
fn found(defect: Defect) -> String {
    let checked = std::panic::catch_unwind(|| check(|| carrier(defect), HandlesEnd::AtTargets));
    let Err(said) = checked else {
        return String::new();
    };
    match said.downcast::<String>() {
        Ok(said) => *said,
        Err(said) => (*said.downcast::<&str>().unwrap()).to_owned(),
    }
}

#[test]
fn every_defect_is_found_and_named() {
    assert_eq!(found(Defect::None), "");
    let defects = [
        (Defect::NoCount, "3 targets for 2 handles"),
        (Defect::NoRange, "a vertex is not finite"),
        (Defect::NamesFrameLeft, "the frame that the error names"),
        (Defect::MovesOnFailure, "the cloth is not as it was"),
        (Defect::RemembersFailure, "the motion is another"),
        (Defect::MissesTargets, "handle 1 is at"),
        (Defect::KeepsFrame, "the frame count"),
        (Defect::LosesVertex, "positions"),
        (Defect::LosesFiniteness, "a vertex is not finite"),
        (Defect::GoesBackAnywhere, "what is no snapshot of it"),
        (Defect::GoesBackInPart, "the cloth is not as it was"),
    ];
    for (defect, words) in defects {
        let breach = found(defect);
        assert!(breach.contains(words), "{defect:?}: {breach}");
    }
}

#[test]
fn a_stepper_that_misses_its_targets_passes_where_that_is_known() {
    check(|| carrier(Defect::MissesTargets), HandlesEnd::Elsewhere);
}

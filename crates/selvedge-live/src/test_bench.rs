//! Movers that anyone can predict, for the tests of this crate: what nobody holds falls by [`FALL`] per
//! frame; a handle goes where it is told.

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    Cloth, Environment, HandlePath, HandleSchedule, HandleTargets, Handles, Motion, RecordedMotion,
    StepError, Stepper, Topology, check_target_count,
};
use selvedge_data::Provenance;
use serde_json::Value;

use crate::order::{Bench, Hold, LiveStepper, MoverKind, Order, Start};
use crate::test_cloth::{CORNERS, cloth};

/// How far what is free falls in a frame `[m]`.
pub(crate) const FALL: f32 = 0.01;

/// How far the scene's own motion goes along x in a frame `[m]`, and for how many frames.
pub(crate) const PACE: f64 = 0.01;
pub(crate) const FRAMES: usize = 12;

/// Where handles go along x before the model fails `[m]`.
pub(crate) const END_OF_MODEL: f64 = 0.205;

/// Asks for a scene.
pub(crate) fn order(scene: &str) -> Order {
    Order {
        scene: scene.to_owned(),
        mesh: None,
        material: None,
        model: String::new(),
    }
}

/// Makes the movers.
pub(crate) struct TestBench {
    cloth: Cloth,
    /// When the scene's own motion lets handles go.
    pub(crate) schedule: HandleSchedule,
    /// How many of its frames have passed at the start.
    pub(crate) start_frame: usize,
}

impl TestBench {
    pub(crate) fn new() -> Self {
        Self {
            cloth: cloth(),
            schedule: HandleSchedule::default(),
            start_frame: 0,
        }
    }
}

impl Bench for TestBench {
    fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    fn frame_rate(&self) -> f64 {
        60.0
    }

    fn environment(&self) -> Environment {
        Environment::default()
    }

    fn scene_path(&self) -> Result<HandlePath, String> {
        let start: Vec<DVec3> = CORNERS[..2].iter().map(|p| p.as_dvec3()).collect();
        let after = |frame: usize| DVec3::X * (PACE * frame as f64);
        let places = |frame| -> Vec<DVec3> { start.iter().map(|p| *p + after(frame)).collect() };
        let positions = (0..=FRAMES).map(places).collect();
        let motion = Motion::Recorded(RecordedMotion { positions });
        let path = motion.bind(&start, 60.0).map_err(|e| e.to_string())?;
        Ok(path.scheduled(self.schedule.clone()))
    }

    fn start_frame(&self) -> usize {
        self.start_frame
    }

    fn remarks(&self) -> &[String] {
        &[]
    }

    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        hold: &Hold,
    ) -> Result<Box<dyn LiveStepper>, String> {
        let passed = Vec3::X * (PACE * self.start_frame as f64) as f32;
        let positions = match start {
            Start::Beginning => CORNERS.map(|p| p + passed).to_vec(),
            Start::Frames(frames) => frames.last().unwrap().clone(),
        };
        Ok(Box::new(Puppet::new(kind, &self.cloth, hold, positions)))
    }

    fn provenance(&self, hold: &Hold, _: Vec<Vec<DVec3>>) -> Result<Provenance, String> {
        Ok(Provenance {
            frame_rate: 60.0,
            scene: Value::from(hold.environment.wind.x),
            made_by: "test".to_owned(),
        })
    }
}

/// Moves the cloth. As of the simulator, a handle that takes hold again does so of its vertex where that is,
/// and one that is made anew knows nothing of it.
struct Puppet {
    kind: MoverKind,
    cloth: Cloth,
    positions: Vec<Vec3>,
    frame: usize,
    /// Where each handle was told to be `[m]`, whether it held, and how far from it, `[handles]`.
    told: Vec<Vec3>,
    held: Vec<bool>,
    offsets: Vec<Vec3>,
}

impl Puppet {
    fn new(kind: MoverKind, cloth: &Cloth, hold: &Hold, positions: Vec<Vec3>) -> Self {
        let handles = hold.handles.clone();
        Self {
            kind,
            told: handles.select(&positions),
            held: vec![true; handles.len()],
            offsets: vec![Vec3::ZERO; handles.len()],
            cloth: cloth.clone().with_handles(handles).unwrap(),
            positions,
            frame: 0,
        }
    }
}

impl Stepper for Puppet {
    fn topology(&self) -> &Topology {
        self.cloth.topology()
    }

    fn handles(&self) -> &Handles {
        self.cloth.handles()
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        if let Some(lost) = targets.end().iter().position(|p| !p.as_vec3().is_finite()) {
            let vertex = self.cloth.handles().vertices()[lost];
            let frame = self.frame + 1;
            return Err(StepError::NonFinite { frame, vertex });
        }
        let is_far = targets.end().iter().any(|target| target.x > END_OF_MODEL);
        if self.kind == MoverKind::Model && is_far {
            return Err(StepError::Solve {
                frame: self.frame + 1,
                cause: "too far".to_owned(),
            });
        }
        let before = self.positions.clone();
        for position in &mut self.positions {
            position.y -= FALL;
        }
        for (handle, vertex) in self.cloth.handles().vertices().iter().enumerate() {
            let (vertex, target) = (vertex.index(), targets.end()[handle].as_vec3());
            if targets.holds(handle) {
                if !self.held[handle] {
                    self.offsets[handle] = before[vertex] - self.told[handle];
                }
                self.positions[vertex] = target + self.offsets[handle];
            }
            self.told[handle] = target;
            self.held[handle] = targets.holds(handle);
        }
        self.frame += 1;
        Ok(())
    }
}

impl LiveStepper for Puppet {
    fn changed(&self, hold: &Hold) -> Result<Box<dyn LiveStepper>, String> {
        let positions = self.positions.clone();
        Ok(Box::new(Self::new(self.kind, &self.cloth, hold, positions)))
    }
}

#[test]
fn puppets_conform() {
    use selvedge_cloth::conformance::{HandlesEnd, check};

    let cloth = cloth();
    let hold = Hold {
        handles: cloth.handles().clone(),
        environment: Environment::default(),
    };
    for kind in [MoverKind::Physics, MoverKind::Model] {
        let make = || Puppet::new(kind, &cloth, &hold, CORNERS.to_vec());
        assert_eq!(check(make, HandlesEnd::AtTargets), Ok(()));
    }
}

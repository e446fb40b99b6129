//! A cloth of two triangles and movers that anyone can predict, for the tests of this crate, inside
//! it and from outside: what nobody holds falls, and a handle goes where it is told.

use std::ops::ControlFlow;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use glam::{DVec3, Vec2, Vec3};
use selvedge_cloth::{
    Cloth, ClothArrays, Environment, HandlePath, HandleSchedule, HandleTargets, Handles, Motion,
    RecordedMotion, StepError, Stepper, Topology, check_target_count,
};
use selvedge_data::Provenance;
use selvedge_live::{
    Body, BodyKind, Catalogue, Influences, LiveError, LiveStepper, MoverKind, Movers, Order,
    ReadyCloth, Start, Workshop,
};
use serde_json::Value;

/// Positions of the mesh `[m]`; the first two vertices are handles.
pub(crate) const CORNERS: [Vec3; 4] = [
    Vec3::ZERO,
    Vec3::new(0.0, 0.0, 1.0),
    Vec3::new(0.0, -1.0, 0.0),
    Vec3::new(0.0, -1.0, 1.0),
];

/// The way of the scene's own motion along x in a frame `[m]`, and its frames.
pub(crate) const PACE: f64 = 0.01;
const FRAMES: usize = 12;

/// The place of a handle along x beyond which the model fails `[m]`.
const END_OF_MODEL: f64 = 0.205;
/// The place of a handle along x beyond which something stands in for the model `[m]`.
const STAND_IN: f32 = 0.15;

pub(crate) fn cloth() -> Cloth {
    let arrays = ClothArrays {
        rest_positions: CORNERS.to_vec(),
        material_coordinates: CORNERS.map(|p| Vec2::new(p.z, p.y)).to_vec(),
        vertex_mass: vec![0.1; 4],
        face_area: vec![0.5; 2],
    };
    let topology = Topology::new(4, &[[0, 2, 1], [1, 2, 3]]).unwrap();
    Cloth::new(topology, Handles::new(&[0, 1], 4).unwrap(), arrays).unwrap()
}

/// Orders a scene.
pub(crate) fn order(scene: &str) -> Order {
    Order {
        scene: scene.to_owned(),
        mesh: None,
        material: None,
        model: String::new(),
        touches: false,
    }
}

/// Makes the test cloth ready. The scene "none" it has not, and "slow" it never has ready.
#[derive(Default)]
pub(crate) struct TestWorkshop {
    /// The time that a step takes.
    pub(crate) cost: Duration,
    /// The fall of a free vertex in a frame `[m]`.
    pub(crate) fall: f32,
    /// Hears that "slow" is begun with.
    pub(crate) begun: Option<mpsc::Sender<()>>,
}

impl Workshop for TestWorkshop {
    fn catalogue(&self) -> Catalogue {
        Catalogue::default()
    }

    fn prepare(
        &mut self,
        order: &Order,
        progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    ) -> Result<Box<ReadyCloth>, LiveError> {
        if order.scene == "none" {
            return Err(LiveError::new("there is no scene \"none\""));
        }
        if let Some(begun) = self.begun.take() {
            begun.send(()).unwrap();
        }
        let mut go_on = || progress(format!("{} half way", order.scene)).is_continue();
        while go_on() {
            if order.scene != "slow" {
                let cloth = TestCloth {
                    cost: self.cost,
                    fall: self.fall,
                    ..TestCloth::default()
                };
                return Ok(Box::new(cloth.ready()));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(LiveError::new("it was stopped"))
    }
}

/// The cloth. By default its free vertices stay where they are, and steps take no time.
#[derive(Clone, Default)]
pub(crate) struct TestCloth {
    /// The times at which the scene's own motion lets handles go.
    pub(crate) schedule: HandleSchedule,
    /// Frames of that motion that have passed at the start.
    pub(crate) start_frame: usize,
    /// The fall of a free vertex in a frame `[m]`.
    pub(crate) fall: f32,
    /// The time that a step takes.
    pub(crate) cost: Duration,
    /// The bodies: each has the points of the ball.
    pub(crate) bodies: Vec<Body>,
    /// Momentum that each body receives in a frame `[N s]`.
    pub(crate) push: DVec3,
}

/// Points of a body `[m]`, their middle at (0, -5, 0), and the place of a body along x beyond which
/// it has no room.
const BODY: [Vec3; 3] = [
    Vec3::new(0.1, -5.0, 0.0),
    Vec3::new(-0.05, -5.0, 0.0866),
    Vec3::new(-0.05, -5.0, -0.0866),
];
pub(crate) const WALL: f64 = 0.5;

#[allow(dead_code, reason = "the tests from outside have none")]
pub(crate) fn body(kind: BodyKind) -> Body {
    Body {
        name: "wedge".to_owned(),
        kind,
        points: 3,
        faces: vec![[0, 1, 2]],
    }
}

impl TestCloth {
    /// The cloth, ready to be moved.
    pub(crate) fn ready(self) -> ReadyCloth {
        ReadyCloth {
            cloth: Arc::new(cloth()),
            frame_rate: 60.0,
            environment: Environment::default(),
            scene_path: scene_path().scheduled(self.schedule.clone()),
            start_frame: self.start_frame,
            remarks: Vec::new(),
            bodies: self.bodies.clone(),
            movers: Box::new(self),
        }
    }
}

/// The way of the handles along the scene's own motion.
fn scene_path() -> HandlePath {
    let start: Vec<DVec3> = CORNERS[..2].iter().map(|p| p.as_dvec3()).collect();
    let after = |frame: usize| DVec3::X * (PACE * frame as f64);
    let places = |frame| -> Vec<DVec3> { start.iter().map(|p| *p + after(frame)).collect() };
    let positions = (0..=FRAMES).map(places).collect();
    let motion = Motion::Recorded(RecordedMotion { positions });
    motion.bind(&start, 60.0).unwrap()
}

impl Movers for TestCloth {
    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        influences: &Influences,
    ) -> Result<Box<dyn LiveStepper>, LiveError> {
        let passed = Vec3::X * (PACE * self.start_frame as f64) as f32;
        let positions = match start {
            Start::Beginning => CORNERS.map(|p| p + passed).to_vec(),
            Start::Frames(frames) => frames.last().unwrap().clone(),
        };
        let shifts = vec![DVec3::ZERO; self.bodies.len()];
        let stepper = ScriptedStepper::new(kind, self.clone(), influences, positions);
        Ok(Box::new(ScriptedStepper { shifts, ..stepper }))
    }

    fn provenance(
        &self,
        influences: &Influences,
        _: Vec<Vec<DVec3>>,
    ) -> Result<Provenance, LiveError> {
        Ok(Provenance {
            frame_rate: 60.0,
            scene: Value::from(influences.environment.wind.x),
            made_by: "test".to_owned(),
        })
    }
}

/// Moves the cloth. As in the simulator, a handle that is attached again holds its vertex where
/// the vertex is, and a stepper that is made anew knows nothing of it.
struct ScriptedStepper {
    kind: MoverKind,
    of: TestCloth,
    cloth: Cloth,
    positions: Vec<Vec3>,
    frame: usize,
    /// Distances of the bodies from their own paths `[m]`, `[bodies]`, and those of the last frame
    /// where they had no room in it.
    shifts: Vec<DVec3>,
    blocked: Option<Vec<DVec3>>,
    led: Vec<DVec3>,
}

impl ScriptedStepper {
    fn new(kind: MoverKind, of: TestCloth, influences: &Influences, positions: Vec<Vec3>) -> Self {
        let handles = influences.handles.clone();
        Self {
            kind,
            of,
            cloth: cloth().with_handles(handles).unwrap(),
            positions,
            frame: 0,
            shifts: Vec::new(),
            blocked: None,
            led: Vec::new(),
        }
    }
}

impl Stepper for ScriptedStepper {
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
        std::thread::sleep(self.of.cost);
        let led = std::mem::replace(&mut self.led, self.shifts.clone());
        self.blocked = None;
        if led.iter().any(|shift| shift.x > WALL) {
            self.blocked = Some(self.shifts.clone());
        } else if led.len() == self.shifts.len() {
            self.shifts = led;
        }
        let is_far = targets.end().iter().any(|target| target.x > END_OF_MODEL);
        if self.kind == MoverKind::Model && is_far {
            return Err(StepError::Solve {
                frame: self.frame + 1,
                cause: "too far".to_owned(),
            });
        }
        for position in &mut self.positions {
            position.y -= self.of.fall;
        }
        for (handle, vertex) in self.cloth.handles().vertices().iter().enumerate() {
            if targets.holds(handle) {
                self.positions[vertex.index()] = targets.end()[handle].as_vec3();
            }
        }
        self.frame += 1;
        Ok(())
    }
}

impl LiveStepper for ScriptedStepper {
    fn stand_in(&self) -> Option<&'static str> {
        (self.kind == MoverKind::Model && self.positions[0].x > STAND_IN).then_some("a stand-in")
    }

    fn lead_body(&mut self, number: usize, offset: DVec3) {
        self.led.resize(self.shifts.len(), DVec3::ZERO);
        self.led[number] = offset;
    }

    fn put_body(&mut self, number: usize, offset: DVec3) -> Result<(), LiveError> {
        if offset.x > WALL {
            return Err(LiveError::new("the wall is there"));
        }
        self.shifts[number] = offset;
        Ok(())
    }

    fn body_points(&self) -> Vec<Vec3> {
        let all = self.shifts.iter();
        all.flat_map(|shift| BODY.map(|p| p + shift.as_vec3()))
            .collect()
    }

    fn blocked(&self) -> Option<Vec<DVec3>> {
        self.blocked.clone()
    }

    fn impulses(&self) -> Vec<DVec3> {
        vec![self.of.push; self.shifts.len()]
    }

    fn gaps(&self) -> Option<Vec<f32>> {
        (!self.shifts.is_empty()).then(|| vec![0.25; self.positions.len()])
    }

    fn changed(&self, influences: &Influences) -> Result<Box<dyn LiveStepper>, LiveError> {
        let (of, positions) = (self.of.clone(), self.positions.clone());
        Ok(Box::new(Self {
            shifts: self.shifts.clone(),
            ..Self::new(self.kind, of, influences, positions)
        }))
    }
}

#[test]
fn puppets_conform() {
    use crate::conformance::{HandlesEnd, check};

    let influences = Influences {
        handles: cloth().handles().clone(),
        environment: Environment::default(),
    };
    for kind in [MoverKind::Physics, MoverKind::Model] {
        let make =
            || ScriptedStepper::new(kind, TestCloth::default(), &influences, CORNERS.to_vec());
        check(make, HandlesEnd::AtTargets);
    }
}

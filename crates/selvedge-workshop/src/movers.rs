//! The physics and the learned model as the viewer drives them: they go on in the same motion when
//! what holds the cloth, or the wind, changes.

use std::collections::VecDeque;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge::machine::{Machine, Mover};
use selvedge::rounded;
use selvedge_cloth::{Cloth, HandleTargets, Rigid, Scene, Squeezed, StepError, Stepper};
use selvedge_guard::{Correction, Guard, Replacement};
use selvedge_live::{Influences, LiveError, LiveStepper};
use selvedge_model::{ClothGraph, Model};
use selvedge_sim::{Checkpoint, Simulator};

/// The scene under these influences.
fn under(scene: &Scene, influences: &Influences) -> Scene {
    Scene {
        handles: influences.handles.clone(),
        environment: influences.environment,
        ..scene.clone()
    }
}

/// The simulator, with the scene that it was made from.
pub(super) struct LivePhysics {
    scene: Arc<Scene>,
    simulator: Simulator,
    /// True where a person leads the handles, not the scene.
    by_hand: bool,
    /// True where the last step had no room for what was led.
    was_blocked: bool,
}

impl LivePhysics {
    /// Starts in `state`.
    pub(super) fn start(
        scene: &Arc<Scene>,
        influences: &Influences,
        state: &Checkpoint,
    ) -> Result<Self, LiveError> {
        let held = under(scene, influences);
        let mut simulator = Simulator::from_checkpoint(&held, state).map_err(LiveError::new)?;
        simulator.set_squeezed(Squeezed::Stop);
        Ok(Self {
            scene: Arc::clone(scene),
            simulator,
            by_hand: true,
            was_blocked: false,
        })
    }

    /// What the scene says of cloth without room. A hand is stopped before anything is let through.
    fn squeezed(&self) -> Squeezed {
        let contact = self.scene.contact;
        contact.map_or_else(Squeezed::default, |contact| contact.squeezed)
    }

    /// A step in which handles and bodies that are led stay where they are.
    fn step_still(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let still = HandleTargets::at_frame_end(self.simulator.handle_places())
            .and_then(|still| still.releasing(targets.let_go()))
            .map_err(|error| error.at(self.simulator.frame() + 1))?;
        let led = self.simulator.obstacle_leads();
        self.lead_bodies(&self.simulator.obstacle_offsets());
        let stepped = self.simulator.step(&still);
        if stepped.is_err() {
            self.lead_bodies(&led);
        }
        stepped
    }

    /// Leads all bodies there, away from their own paths, `[obstacles]`.
    fn lead_bodies(&mut self, offsets: &[Rigid]) {
        for (number, offset) in offsets.iter().enumerate() {
            self.lead(number, *offset);
        }
    }

    /// Leads a body; a scene without contact has none to lead.
    fn lead(&mut self, number: usize, offset: impl Into<Rigid>) {
        let _ = self.simulator.lead_obstacle(number, offset);
    }
}

impl Stepper for LivePhysics {
    selvedge_cloth::delegate_stepper!(self: self.simulator);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.was_blocked = false;
        let Err(error) = self.simulator.step(targets) else {
            return Ok(());
        };
        let has_no_room = matches!(
            error,
            StepError::Contact { .. } | StepError::Overstretched { .. }
        );
        if !self.by_hand || self.scene.contact.is_none() || !has_no_room {
            return Err(error);
        }
        if self.step_still(targets).is_ok() {
            self.was_blocked = true;
            return Ok(());
        }
        // Bodies on their own ways leave no room. The first error says what was in the way.
        self.simulator.set_squeezed(self.squeezed());
        let stepped = self.simulator.step(targets).map_err(|_| error);
        self.simulator.set_squeezed(Squeezed::Stop);
        stepped
    }
}

impl LiveStepper for LivePhysics {
    fn changed(&self, influences: &Influences) -> Result<Box<dyn LiveStepper>, LiveError> {
        let mut state = self.simulator.checkpoint();
        // What holds it, or blows, is another: a cloth that rested does so no more.
        if let Some(contact) = &mut state.contact {
            contact.still.clear();
        }
        if *self.simulator.handles() != influences.handles {
            // Another system: the state before belongs to the old one.
            state.previous = None;
        }
        Ok(Box::new(Self::start(&self.scene, influences, &state)?))
    }

    fn samples(&self) -> usize {
        self.scene.physics.substeps as usize
    }

    fn led_by_hand(&mut self, by_hand: bool) {
        self.by_hand = by_hand;
        let squeezed = if by_hand { Squeezed::Stop } else { self.squeezed() };
        self.simulator.set_squeezed(squeezed);
    }

    fn lead_body(&mut self, number: usize, offset: DVec3) {
        self.lead(number, offset);
    }

    fn put_body(&mut self, number: usize, offset: DVec3) -> Result<(), LiveError> {
        let put = self.simulator.put_obstacle(number, offset);
        put.map_err(|_| LiveError::new("the cloth is there: throw from farther away"))
    }

    fn body_points(&self) -> Vec<Vec3> {
        rounded(&self.simulator.obstacle_points())
    }

    fn blocked(&self) -> Option<Vec<DVec3>> {
        let places = self
            .was_blocked
            .then(|| self.simulator.obstacle_offsets())?;
        Some(places.iter().map(|place| place.by).collect())
    }

    fn impulses(&self) -> Vec<DVec3> {
        self.simulator.obstacle_impulses()
    }

    fn gaps(&self) -> Option<Vec<f32>> {
        let gaps = self.simulator.vertex_gaps()?;
        Some(gaps.into_iter().map(|gap| gap as f32).collect())
    }
}

/// A model, and the machine that runs it.
#[derive(Clone)]
pub(super) struct ModelOnMachine {
    pub(super) model: Arc<Model>,
    pub(super) machine: Machine,
}

/// A model under a guard, with the last frames, from which it goes on when its graph changes.
pub(super) struct LiveModel {
    model: ModelOnMachine,
    scene: Arc<Scene>,
    cloth: Arc<Cloth>,
    stepper: Guard<Mover>,
    /// As many as the model looks at, oldest first.
    recent: VecDeque<Vec<Vec3>>,
}

impl LiveModel {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. The rest
    /// pose that the model compares with stays that of the scene's own handles in the scene's own
    /// wind.
    pub(super) fn start(
        model: &ModelOnMachine,
        scene: &Arc<Scene>,
        cloth: &Arc<Cloth>,
        influences: &Influences,
        frames: &[&[Vec3]],
    ) -> Result<Self, LiveError> {
        let held = Cloth::clone(cloth).with_handles(influences.handles.clone());
        let held = held.map_err(LiveError::new)?;
        let held_scene = under(scene, influences);
        let graph = ClothGraph::of_scene(&held, &held_scene).map_err(LiveError::new)?;
        let stepper = model.machine.start(&model.model, graph, frames);
        let stepper = stepper.map_err(LiveError::new)?;
        let (known, settings) = (Arc::new(held_scene), Correction::default());
        let stepper = Guard::new(stepper, &held, scene.frame_rate, Some(known), settings);
        let needed = model.model.spec().history();
        let first = frames.len().saturating_sub(needed);
        Ok(Self {
            model: model.clone(),
            scene: Arc::clone(scene),
            cloth: Arc::clone(cloth),
            stepper: stepper.map_err(LiveError::new)?,
            recent: frames[first..].iter().map(|frame| frame.to_vec()).collect(),
        })
    }
}

impl Stepper for LiveModel {
    selvedge_cloth::delegate_stepper!(self: self.stepper);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.stepper.step(targets)?;
        if self.recent.len() >= self.model.model.spec().history() {
            self.recent.pop_front();
        }
        self.recent.push_back(self.stepper.positions().to_vec());
        Ok(())
    }
}

impl LiveStepper for LiveModel {
    fn stand_in(&self) -> Option<&'static str> {
        match self.stepper.trust().verdict.replaced_by()? {
            Replacement::Physics => Some("the solver in its place"),
            Replacement::Carry => Some("carried by its handles"),
            Replacement::Nothing => None,
        }
    }

    fn body_points(&self) -> Vec<Vec3> {
        let time = self.stepper.frame() as f64 / self.scene.frame_rate;
        let points = self.scene.obstacles.iter();
        let points: Vec<DVec3> = points.flat_map(|o| o.positions_at(time)).collect();
        rounded(&points)
    }

    fn changed(&self, influences: &Influences) -> Result<Box<dyn LiveStepper>, LiveError> {
        let frames: Vec<&[Vec3]> = self.recent.iter().map(Vec::as_slice).collect();
        let (scene, cloth) = (&self.scene, &self.cloth);
        Ok(Box::new(Self::start(
            &self.model,
            scene,
            cloth,
            influences,
            &frames,
        )?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneWorkshop;
    use crate::conformance::{HandlesEnd, check};
    use selvedge_live::{MoverKind, Order, ReadyCloth, Start, Workshop};
    use std::ops::ControlFlow;

    /// The cloth of the default scene, and its handles.
    fn ready() -> (Box<ReadyCloth>, Influences) {
        let mut workshop = SceneWorkshop::new("default", &[], Machine::Cpu).unwrap();
        let order = Order {
            model: "paper".to_owned(),
            ..workshop.first_order()
        };
        let ready = workshop
            .prepare(&order, &mut |_| ControlFlow::Continue(()))
            .unwrap();
        let influences = Influences {
            handles: ready.cloth.handles().clone(),
            environment: ready.environment,
        };
        (ready, influences)
    }

    /// The handles of the default scene after `frame` frames of a slow pull to the front and up.
    fn pulled(start: &[Vec3], frame: usize) -> HandleTargets {
        let pull = 0.004 * frame as f64 * DVec3::new(1.0, 0.5, 0.0);
        let targets = start.iter().map(|p| p.as_dvec3() + pull).collect();
        HandleTargets::at_frame_end(targets).unwrap()
    }

    /// A mover that is changed to the very hold it has goes on as the one that is left alone: the
    /// largest distance of a vertex over ten frames after ten `[m]`.
    fn difference(kind: MoverKind) -> f32 {
        let (ready, influences) = ready();
        let mut one = ready
            .movers
            .start(kind, Start::Beginning, &influences)
            .unwrap();
        let start = influences.handles.select(one.positions());
        for frame in 1..=10 {
            one.step(&pulled(&start, frame)).unwrap();
        }
        let mut other = one.changed(&influences).unwrap();
        assert_eq!(other.positions(), one.positions());
        for frame in 11..=20 {
            one.step(&pulled(&start, frame)).unwrap();
            other.step(&pulled(&start, frame)).unwrap();
        }
        let pairs = one.positions().iter().zip(other.positions());
        pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f32::max)
    }

    #[test]
    fn movers_conform() {
        let (ready, influences) = ready();
        for kind in [MoverKind::Model, MoverKind::Physics] {
            let make = || {
                ready
                    .movers
                    .start(kind, Start::Beginning, &influences)
                    .unwrap()
            };
            // The physics of the viewer holds by springs.
            let end = match kind {
                MoverKind::Physics => HandlesEnd::Elsewhere,
                _ => HandlesEnd::AtTargets,
            };
            check(make, end);
        }
    }

    #[test]
    fn models_and_physics_go_on_from_where_they_are() {
        assert_eq!(difference(MoverKind::Model), 0.0, "bit for bit");
        // Handles are stiff springs: what is lost is by how little they lag behind their paths.
        let lost = difference(MoverKind::Physics);
        assert!(lost < 1e-6, "{lost} m");
    }

    #[test]
    fn a_model_that_is_shaken_keeps_its_edges() {
        let (ready, influences) = ready();
        let mut stepper = ready
            .movers
            .start(MoverKind::Model, Start::Beginning, &influences)
            .unwrap();
        let start = influences.handles.select(stepper.positions());
        let material = ready.cloth.material_coordinates();
        let mut worst = 0.0_f32;
        for frame in 0..60 {
            // To and fro by half a metre, at eight times the speed of any motion learned from.
            let way = 0.25 * f64::sin(0.8 * f64::from(frame)) * DVec3::new(1.0, 0.3, 0.2);
            let targets = start.iter().map(|p| p.as_dvec3() + way).collect();
            let targets = HandleTargets::at_frame_end(targets).unwrap();
            stepper.step(&targets).unwrap();
            for edge in stepper.topology().edges() {
                let [a, b] = edge.vertices.map(|v| v.index());
                let length = stepper.positions()[a].distance(stepper.positions()[b]);
                worst = worst.max(length / material[a].distance(material[b]) - 1.0);
            }
        }
        // The guard's bound, 1.28, and what its sweeps leave.
        assert!(worst < 0.29, "{worst}");
    }
}

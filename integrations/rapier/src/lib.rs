//! Rigid bodies of [Rapier](rapier3d_f64) that the cloth moves, stops and carries.
//!
//! A [`World`] steps Rapier, leads the bodies of a cloth's scene to where its bodies went, steps the
//! cloth, and gives the bodies the impulses that they received. A body that answers a frame late would be
//! thrown: so the cloth is stepped again, from the same state, until body and cloth agree on the impulse.
//! What is left at the end is given as well: cloth and bodies together lose no momentum. Heavy bodies on
//! cloth that lies on a floor are thrown by that; [`World::most_steps`] has what they need.

use rapier3d_f64::prelude::{PhysicsWorld, Pose, RigidBody, RigidBodyHandle, Rotation, Vector};
use selvedge::glam::{DQuat, DVec3};
use selvedge::{HandleTargets, Impulse, Rigid, Run, StepError};

/// Steps of the cloth in a frame, at most, at first.
const MOST: usize = 12;
/// How far a body may be from where the impulse of the last step would have it `[m]`.
const NEAR: f64 = 2e-6;
/// Earlier changes of a step from which the next is guessed, at most.
const KEPT: usize = 12;

/// A cloth, and rigid bodies that it meets.
pub struct World {
    /// The cloth.
    pub run: Run,
    /// The rigid bodies. A step is as long as a frame of the cloth.
    pub rapier: PhysicsWorld,
    /// Steps of the cloth in a frame, at most; 12 at first. With 1 a body goes by what it received in the frame
    /// before, and is put right after it: for heavy bodies on cloth that lies on a floor, in scenes of 1000
    /// frames per second and more, so that none goes far of the fabric's thickness in one.
    pub most_steps: usize,
    bodies: Vec<Body>,
    /// Changes of the impulses that were given, and what these did to those received, scaled, from new
    /// to old.
    changes: Vec<[Vec<f64>; 2]>,
    steps: usize,
}

struct Body {
    /// Number in the scene.
    number: usize,
    handle: RigidBodyHandle,
    begin: Rigid,
    /// What it was given in this frame.
    given: Impulse,
}

impl World {
    /// A cloth, and for each of these numbers of bodies in its scene the body that leads it; where that
    /// stands now is where the scene has it.
    #[must_use]
    pub fn new(run: Run, mut rapier: PhysicsWorld, bodies: &[(usize, RigidBodyHandle)]) -> Self {
        rapier.integration_parameters.dt = 1.0 / run.scene().built().frame_rate;
        let body = |(number, handle): &(usize, RigidBodyHandle)| Body {
            number: *number,
            handle: *handle,
            begin: inverse(&place(&rapier.bodies[*handle])),
            given: Impulse::ZERO,
        };
        Self {
            bodies: bodies.iter().map(body).collect(),
            run,
            rapier,
            most_steps: MOST,
            changes: Vec::new(),
            steps: 0,
        }
    }

    /// Steps of the cloth that the last frame took.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Moves all by a frame, the handles of the cloth along the motion of its scene.
    ///
    /// # Errors
    /// [`StepError`] of the cloth, which is as it was; the bodies have gone on.
    pub fn step(&mut self) -> Result<(), StepError> {
        let targets = self.run.next_targets(self.run.samples())?;
        self.step_to(&targets)
    }

    /// The same, with the handles led to `targets`.
    ///
    /// # Errors
    /// As for [`Self::step`].
    pub fn step_to(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let dt = self.rapier.integration_parameters.dt;
        // What the last frame gave is the guess.
        for body in &self.bodies {
            push(&mut self.rapier.bodies[body.handle], body.given, 0.0);
        }
        self.rapier.step();
        let may_repeat = self.most_steps > 1;
        let before = may_repeat.then(|| self.run.snapshot()).flatten();
        let mut last: Option<[Vec<f64>; 2]> = None;
        self.steps = 0;
        loop {
            for body in &self.bodies {
                let now = place(&self.rapier.bodies[body.handle]);
                self.run
                    .lead_obstacle(body.number, now.after(&body.begin))?;
            }
            self.run.step_to(targets)?;
            self.steps += 1;
            let given: Vec<f64> = self.scaled(|body| body.given);
            let lacks: Vec<f64> = self.scaled(|body| self.lack(body));
            if let Some([before, lacked]) = last {
                let change = [difference(&given, &before), difference(&lacks, &lacked)];
                self.changes.insert(0, change);
                self.changes.truncate(KEPT);
            }
            // Scaled impulses are velocities times the root of the mass.
            let far = |body: &Body| {
                let rigid = &self.rapier.bodies[body.handle];
                let lack = self.lack(body);
                let (mass, size) = scales(rigid);
                dt * (lack.linear.length() + about(rigid, lack).length() / size) / mass
            };
            let is_far = self.bodies.iter().any(|body| far(body) > NEAR);
            if !is_far || self.steps >= self.most_steps {
                break;
            }
            let Some(before) = &before else {
                break;
            };
            let next = guess(&given, &lacks, &self.changes);
            self.run.restore(before)?;
            for (number, next) in next.chunks_exact(6).enumerate() {
                let body = &self.bodies[number];
                let rigid = &mut self.rapier.bodies[body.handle];
                let more = unscaled(rigid, next);
                let more = Impulse {
                    linear: more.linear - body.given.linear,
                    angular: more.angular - about(rigid, body.given),
                };
                let more = Impulse {
                    angular: more.angular + com(rigid).cross(more.linear),
                    ..more
                };
                push(rigid, more, dt);
                self.bodies[number].given += more;
            }
            last = Some([given, lacks]);
        }
        for number in 0..self.bodies.len() {
            let lack = self.lack(&self.bodies[number]);
            let body = &mut self.bodies[number];
            push(&mut self.rapier.bodies[body.handle], lack, 0.0);
            body.given += lack;
        }
        Ok(())
    }

    /// What a body received from the cloth in the last step beyond what it was given.
    fn lack(&self, body: &Body) -> Impulse {
        let received = self.run.impulses().get(body.number).copied();
        let received = received.unwrap_or_default();
        Impulse {
            linear: received.linear - body.given.linear,
            angular: received.angular - body.given.angular,
        }
    }

    /// Impulses of the bodies as numbers of one kind: about their middles, over the root of their mass and
    /// of their inertia. Bodies that nothing moves have none.
    fn scaled(&self, of: impl Fn(&Body) -> Impulse) -> Vec<f64> {
        let numbers = self.bodies.iter().flat_map(|body| {
            let rigid = &self.rapier.bodies[body.handle];
            let impulse = of(body);
            let (mass, size) = scales(rigid);
            let scaled = [
                impulse.linear / mass.sqrt(),
                about(rigid, impulse) / (mass.sqrt() * size),
            ];
            scaled.map(|vector| vector.to_array()).concat()
        });
        numbers.collect()
    }
}

/// The impulses that are likely to be received if they are given, after these were and lacked so
/// much: by least squares over earlier changes. Where those tell nothing, what was received.
fn guess(given: &[f64], lacks: &[f64], changes: &[[Vec<f64>; 2]]) -> Vec<f64> {
    let mut next: Vec<f64> = given.to_vec();
    let mut left = lacks.to_vec();
    // Of the lacks an orthonormal basis, and what to give for each of its vectors.
    let mut basis: Vec<[Vec<f64>; 2]> = Vec::new();
    for [by, lack] in changes {
        let (mut by, mut lack) = (by.clone(), lack.clone());
        let whole = dot(&lack, &lack).sqrt();
        for [own, unit] in &basis {
            let part = dot(&lack, unit);
            add(&mut lack, unit, -part);
            add(&mut by, own, -part);
        }
        let length = dot(&lack, &lack).sqrt();
        if length > 1e-6 * whole {
            let unit = |vector: Vec<f64>| vector.iter().map(|v| v / length).collect();
            basis.push([unit(by), unit(lack)]);
        }
    }
    for [by, unit] in &basis {
        let part = dot(&left, unit);
        add(&mut left, unit, -part);
        add(&mut next, by, -part);
    }
    add(&mut next, &left, 1.0);
    next
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], what: &[f64], times: f64) {
    to.iter_mut().zip(what).for_each(|(to, w)| *to += w * times);
}

/// Mass, and radius of gyration; infinite of what nothing moves.
fn scales(rigid: &RigidBody) -> (f64, f64) {
    let mass = rigid.mass();
    if !rigid.is_dynamic() || mass <= 0.0 {
        return (f64::INFINITY, 1.0);
    }
    let inertia = rigid.mass_properties().local_mprops.principal_inertia();
    (
        mass,
        (inertia.to_array().iter().sum::<f64>() / (3.0 * mass)).sqrt(),
    )
}

/// The inverse of the scaling of impulses; its angular part is about the middle of the body.
fn unscaled(rigid: &RigidBody, numbers: &[f64]) -> Impulse {
    let (mass, size) = scales(rigid);
    if mass.is_infinite() {
        return Impulse::ZERO;
    }
    Impulse {
        linear: DVec3::from_slice(&numbers[..3]) * mass.sqrt(),
        angular: DVec3::from_slice(&numbers[3..]) * (mass.sqrt() * size),
    }
}

/// Gives an impulse, with which the body has gone for `time` `[s]` already.
fn push(rigid: &mut RigidBody, impulse: Impulse, time: f64) {
    if !rigid.is_dynamic() {
        return;
    }
    let turn = about(rigid, impulse);
    let [linear, angular] = [rigid.linvel(), rigid.angvel()];
    rigid.apply_impulse(theirs(impulse.linear), true);
    rigid.apply_torque_impulse(theirs(turn), true);
    if time > 0.0 {
        let way = (rigid.linvel() - linear) * time;
        let turned = Rotation::from_scaled_axis((rigid.angvel() - angular) * time);
        let middle = rigid.center_of_mass();
        let at = rigid.position();
        let to = turned * (at.translation - middle) + middle + way;
        let pose = Pose::from_parts(to, turned * at.rotation);
        rigid.set_position(pose, true);
    }
}

/// The angular part of an impulse about the middle of a body.
fn about(rigid: &RigidBody, impulse: Impulse) -> DVec3 {
    impulse.about(com(rigid))
}

fn com(rigid: &RigidBody) -> DVec3 {
    DVec3::from_array(rigid.center_of_mass().to_array())
}

fn theirs(vector: DVec3) -> Vector {
    Vector::from_array(vector.to_array())
}

fn place(rigid: &RigidBody) -> Rigid {
    let pose = rigid.position();
    Rigid {
        turn: DQuat::from_array(pose.rotation.to_array()),
        by: DVec3::from_array(pose.translation.to_array()),
    }
}

fn inverse(place: &Rigid) -> Rigid {
    let turn = place.turn.inverse();
    Rigid {
        turn,
        by: turn * -place.by,
    }
}

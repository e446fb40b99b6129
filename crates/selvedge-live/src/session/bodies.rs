//! The bodies of a session: led by hand within limits of speed, and a ball that is thrown.
//!
//! A ball that flies feels the cloth: in each frame it takes what it gave in the one before, by its
//! mass. Other bodies go where they are led. One that has no way, because cloth between it and
//! another body or a handle has no room, stays where it is, and with it all that hands lead.

use glam::{DVec3, Vec3};

use super::Session;
use super::commands::NO_CLOTH;
use crate::body::BodyKind;
use crate::hand::{HandLimits, Hands};
use crate::live_cloth::LiveCloth;
use crate::mover::Reason;

/// Gravity of a ball that flies `[m/s²]`.
const GRAVITY: DVec3 = DVec3::new(0.0, -9.8, 0.0);
/// Parts of its speed that a ball keeps when it meets the floor: across it, and along it.
const BOUNCE: f64 = 0.45;
const ROLL: f64 = 0.85;
/// Mass of the ball `[kg]`: a volleyball's, which is about as large.
pub(super) const MASS: f64 = 0.27;
/// The fastest throw `[m/s]`.
const FASTEST: f64 = 10.0;
/// Way below which, and distance from the origin beyond which, a ball is out of play `[m]`.
const OUT: f64 = 12.0;

/// The bodies as they are led.
#[derive(Clone, Default)]
pub(super) struct Bodies {
    /// Distances from their own paths `[m]`, as hands.
    hands: Hands,
    flight: Option<Flight>,
    /// Number of the ball, its place on its own path and its radius, if there is one `[m]`.
    ball: Option<(usize, DVec3, f64)>,
    /// Height of the floor, where there is one `[m]`.
    floor: Option<f64>,
}

/// A ball that flies.
#[derive(Clone, Copy)]
struct Flight {
    /// Its middle `[m]`.
    place: DVec3,
    /// `[m/s]`
    velocity: DVec3,
}

impl Bodies {
    /// The bodies of a cloth at its beginning.
    pub(super) fn of(live: &LiveCloth) -> Self {
        let points = live.body_points();
        let bodies = &live.ready().bodies;
        let (mut first, mut ball, mut floor) = (0, None, None);
        for (number, body) in bodies.iter().enumerate() {
            let own = points.get(first..first + body.points).unwrap_or_default();
            first += body.points;
            let middle = middle(own);
            match body.kind {
                BodyKind::Ball => {
                    let radius = own.first().map_or(0.0, |p| p.as_dvec3().distance(middle));
                    ball = Some((number, middle, radius));
                }
                BodyKind::Floor => floor = Some(middle.y),
                BodyKind::Thing => {}
            }
        }
        Self {
            hands: Hands::at(&vec![DVec3::ZERO; bodies.len()]),
            flight: None,
            ball,
            floor,
        }
    }

    /// Moves all by a frame of `dt` `[s]`, after one in which they received these `impulses`
    /// `[N s]`; the offsets they come to `[m]`, `[bodies]`.
    fn advance(&mut self, limits: &HandLimits, dt: f64, impulses: &[DVec3]) -> Vec<DVec3> {
        self.hands.advance(limits, dt);
        if let (Some(flight), Some((number, own, radius))) = (&mut self.flight, self.ball) {
            let received = impulses.get(number).copied().unwrap_or_default();
            flight.velocity += GRAVITY * dt + received / MASS;
            flight.place += flight.velocity * dt;
            let least = self.floor.map_or(f64::NEG_INFINITY, |y| y + 1.02 * radius);
            if flight.place.y < least {
                flight.place.y = least;
                flight.velocity.y *= -BOUNCE;
                flight.velocity.x *= ROLL;
                flight.velocity.z *= ROLL;
            }
            self.hands.put(number, flight.place - own);
            if flight.place.length() > OUT {
                self.flight = None;
            }
        }
        self.hands.positions()
    }
}

/// The middle of points `[m]`.
fn middle(points: &[Vec3]) -> DVec3 {
    points.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / points.len().max(1) as f64
}

impl Session {
    /// Leads the bodies over the next frame, at `rate` frames per second.
    pub(super) fn lead_bodies(&mut self, rate: f64) {
        if let Some(live) = &mut self.showing.live {
            let (limits, impulses) = (&self.control.limits, live.impulses());
            let offsets = self.bodies.advance(limits, 1.0 / rate, &impulses);
            live.lead_bodies(&offsets);
        }
    }

    /// Has hands and bodies stay where they were, where they had no way in the last frame.
    pub(super) fn wait_where_blocked(&mut self) {
        let Some(live) = &self.showing.live else {
            return;
        };
        let Some(offsets) = live.blocked() else {
            return;
        };
        if let (Some(flight), Some((ball, own, _))) = (&mut self.bodies.flight, self.bodies.ball) {
            flight.place = own + offsets.get(ball).copied().unwrap_or_default();
            flight.velocity = DVec3::ZERO;
        }
        for (number, offset) in offsets.into_iter().enumerate() {
            self.bodies.hands.put(number, offset);
        }
        let places = live.places();
        for (handle, place) in places.into_iter().enumerate() {
            self.control.hands.put(handle, place);
        }
    }

    /// Leads a body so that the middle of its points goes to `goal` `[m]`.
    pub(super) fn lead_body(&mut self, number: usize, goal: DVec3) -> Result<(), Reason> {
        let live = self.showing.live.as_ref().ok_or(NO_CLOTH)?;
        let bodies = &live.ready().bodies;
        let kind = bodies.get(number).map(|body| body.kind);
        let first: usize = bodies.iter().take(number).map(|body| body.points).sum();
        let count = bodies.get(number).map_or(0, |body| body.points);
        let points = live.body_points();
        let middle = middle(points.get(first..first + count).unwrap_or_default());
        if !goal.is_finite() || goal.length() > OUT {
            return Err(format!("bodies stay within {OUT} m").into());
        }
        match kind {
            None => return Err("there is no such body here".into()),
            Some(BodyKind::Floor) => return Ok(()),
            Some(BodyKind::Ball) => self.bodies.flight = None,
            Some(BodyKind::Thing) => {}
        }
        self.check_physics()?;
        let positions = self.bodies.hands.positions();
        let offset = positions.get(number).copied().unwrap_or_default();
        self.bodies.hands.want(number, goal - (middle - offset));
        Ok(())
    }

    /// Throws the ball from `from` `[m]` with `velocity` `[m/s]`.
    pub(super) fn throw(&mut self, from: DVec3, velocity: DVec3) -> Result<(), Reason> {
        let Some((number, own, _)) = self.bodies.ball else {
            return Err("there is no ball here: it comes with contact (tick \"touches\")".into());
        };
        self.check_physics()?;
        let is_far = !from.is_finite() || !velocity.is_finite() || from.length() > OUT;
        if is_far || velocity.length() > FASTEST {
            return Err(format!(
                "the ball is thrown at no more than {FASTEST} m/s, and within {OUT} m"
            )
            .into());
        }
        let live = self.showing.live.as_mut().ok_or(NO_CLOTH)?;
        live.put_body(number, from - own)?;
        self.bodies.hands.put(number, from - own);
        self.bodies.flight = Some(Flight {
            place: from,
            velocity,
        });
        Ok(())
    }

    /// Checks that the physics alone moves the cloth: a model does not see bodies.
    fn check_physics(&self) -> Result<(), Reason> {
        let live = self.showing.live.as_ref().ok_or(NO_CLOTH)?;
        match live.mover() {
            crate::mover::Mover::Physics => Ok(()),
            _ => Err("a learned model does not see bodies: let the solver move the cloth".into()),
        }
    }
}

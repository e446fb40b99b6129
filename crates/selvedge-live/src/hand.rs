//! Hands: the way of the handles from their places to their goals, within limits of speed and of
//! acceleration.
//!
//! Each handle has a goal, and speeds up and brakes so that it comes to rest there; keys move all
//! handles together as one rigid body, goals and all. The default limits are those of the motions
//! that the paper trains on: 1 m in 1 s, eased, has a peak speed of π/2 m/s and a peak acceleration
//! of π²/2 m/s². A turn counts by the speed of the outermost handle; the acceleration towards its
//! axis is not limited.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::protocol::Push;

pub(crate) use self::reach::Reach;

mod reach;

/// The limits of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandLimits {
    /// The greatest speed `[m/s]`.
    pub speed: f64,
    /// The greatest acceleration `[m/s²]`.
    pub acceleration: f64,
}

impl Default for HandLimits {
    fn default() -> Self {
        Self {
            speed: PI / 2.0,
            acceleration: PI * PI / 2.0,
        }
    }
}

impl HandLimits {
    /// The limits nearest to these that a hand can have: 0.05 to 10 m/s and 0.5 to 100 m/s².
    pub fn clamped(speed: f64, acceleration: f64) -> Self {
        let within = |value: f64, low: f64, high: f64, other: f64| {
            if value.is_nan() { other } else { value.clamp(low, high) }
        };
        let default = Self::default();
        Self {
            speed: within(speed, 0.05, 10.0, default.speed),
            acceleration: within(acceleration, 0.5, 100.0, default.acceleration),
        }
    }
}

/// Rounds in which hands that are too far apart are brought back.
const PASSES: usize = 4;

/// One handle on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hand {
    position: DVec3,
    velocity: DVec3,
    goal: DVec3,
}

impl Hand {
    /// A hand that stands still at `position` `[m]`, its goal.
    fn still(position: DVec3) -> Self {
        Self {
            position,
            velocity: DVec3::ZERO,
            goal: position,
        }
    }
}

/// All handles on their ways.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hands {
    hands: Vec<Hand>,
    push: Push,
    /// Velocity of all together `[m/s]`, and how fast they turn about the vertical `[rad/s]`.
    drift: DVec3,
    spin: f64,
    /// The distance of the outermost from the middle when `spin` was chosen `[m]`.
    radius: f64,
}

impl Hands {
    /// Handles that stand still at `positions` `[m]`, their goals.
    pub fn at(positions: &[DVec3]) -> Self {
        Self {
            hands: positions.iter().copied().map(Hand::still).collect(),
            ..Self::default()
        }
    }

    /// Handles that have been led to `positions` `[m]`, their goals, within `dt` `[s]`. Their
    /// velocity stays.
    pub fn led_to(&self, positions: &[DVec3], dt: f64) -> Self {
        let mut led = Self::at(positions);
        for (hand, before) in led.hands.iter_mut().zip(&self.hands) {
            hand.velocity = (hand.position - before.position) / dt;
        }
        led
    }

    /// Positions `[m]`, `[handles]`.
    pub fn positions(&self) -> Vec<DVec3> {
        self.hands.iter().map(|hand| hand.position).collect()
    }

    /// Goals `[m]`, `[handles]`.
    pub fn goals(&self) -> Vec<DVec3> {
        self.hands.iter().map(|hand| hand.goal).collect()
    }

    /// Sets the goal of `handle` `[m]`.
    pub fn want(&mut self, handle: usize, goal: DVec3) {
        if let Some(hand) = self.hands.get_mut(handle) {
            hand.goal = goal;
        }
    }

    /// Puts `handle` at `position` `[m]`, its goal; it stands still.
    pub fn put(&mut self, handle: usize, position: DVec3) {
        if let Some(hand) = self.hands.get_mut(handle) {
            *hand = Hand::still(position);
        }
    }

    /// Pushes all of them from now on.
    pub fn push(&mut self, push: Push) {
        self.push = push;
    }

    /// Returns true where none of them moves or is about to.
    pub fn is_at_rest(&self) -> bool {
        let still = |hand: &Hand| hand.velocity == DVec3::ZERO && hand.goal == hand.position;
        self.push == Push::default()
            && self.drift == DVec3::ZERO
            && self.spin == 0.0
            && self.hands.iter().all(still)
    }

    /// Sets the goal of every handle to the place where it comes to rest if it brakes now.
    pub fn brake(&mut self, limits: &HandLimits) {
        self.push = Push::default();
        for hand in &mut self.hands {
            let speed = hand.velocity.length();
            hand.goal = hand.position + hand.velocity * (speed / (2.0 * limits.acceleration));
        }
    }

    /// Hands at `positions` `[m]`; a hand with a number in `kept` continues as the hand of that
    /// number.
    pub fn rearranged(&self, positions: &[DVec3], kept: &[Option<usize>]) -> Self {
        let mut changed = Self::at(positions);
        for (hand, before) in changed.hands.iter_mut().zip(kept) {
            if let Some(before) = before.and_then(|number| self.hands.get(number)) {
                *hand = *before;
            }
        }
        (changed.push, changed.drift) = (self.push, self.drift);
        (changed.spin, changed.radius) = (self.spin, self.radius);
        changed
    }

    /// Moves all hands by `dt` `[s]`.
    pub fn advance(&mut self, limits: &HandLimits, dt: f64) {
        let together = self.drive_together(limits, dt);
        // What the keys use up is not left for the way to the goals.
        let left = HandLimits {
            speed: (limits.speed - together).max(0.0),
            ..*limits
        };
        let center = self.center();
        let turn = DQuat::from_rotation_y(self.spin * dt);
        let carry = |p: DVec3| center + turn * (p - center) + self.drift * dt;
        for hand in &mut self.hands {
            hand.goal = carry(hand.goal);
            hand.position = carry(hand.position);
            hand.velocity = follow(hand, &left, dt);
            hand.position += hand.velocity * dt;
            if hand.position.distance_squared(hand.goal) < 1e-18 {
                hand.position = hand.goal;
            }
        }
    }

    /// Moves all hands by `dt` `[s]`; those that the cloth between them keeps resist: no two come
    /// farther apart than `reach` says, or than they are.
    pub(crate) fn advance_within(&mut self, limits: &HandLimits, dt: f64, reach: &Reach) {
        let before = self.positions();
        self.advance(limits, dt);
        for _ in 0..PASSES {
            for one in 0..self.hands.len() {
                for other in one + 1..self.hands.len() {
                    self.resist(one, other, &before, reach);
                }
            }
        }
        for (hand, before) in self.hands.iter_mut().zip(before) {
            let velocity = (hand.position - before) / dt;
            if velocity.length() < hand.velocity.length() {
                hand.velocity = velocity;
            }
        }
    }

    /// Brings two hands back that are farther apart than they can be; who has moved gives way.
    fn resist(&mut self, one: usize, other: usize, before: &[DVec3], reach: &Reach) {
        let apart = self.hands[other].position - self.hands[one].position;
        let distance = apart.length();
        let was = before[one].distance(before[other]);
        let excess = distance - reach.between(one, other).max(was);
        let moved = [one, other].map(|hand| self.hands[hand].position.distance(before[hand]));
        let all = moved[0] + moved[1];
        if excess > 0.0 && all > 0.0 {
            let back = apart * (excess / (distance * all));
            self.hands[one].position += back * moved[0];
            self.hands[other].position -= back * moved[1];
        }
    }

    /// Accelerates all of them as the keys push. Returns the speed of the fastest `[m/s]`.
    fn drive_together(&mut self, limits: &HandLimits, dt: f64) -> f64 {
        let reach = self.reach();
        if reach > self.radius {
            // Handles that have come apart, or one that is new, would be too fast at this spin.
            self.spin *= self.radius / reach;
        }
        self.radius = reach;
        let push = self.push;
        let turning = if reach > 0.0 { push.turn } else { 0.0 };
        // Both at once share the limits.
        let asked = push.direction.length().min(1.0) + turning.abs();
        let share = limits.speed / asked.max(1.0);
        let drift = push.direction.clamp_length_max(1.0) * share;
        let spin = if reach > 0.0 { turning * share / reach } else { 0.0 };
        let most = limits.acceleration * dt;
        let change = (drift - self.drift, spin - self.spin);
        let wanted = change.0.length() + change.1.abs() * reach;
        let part = if wanted > most { most / wanted } else { 1.0 };
        self.drift += change.0 * part;
        self.spin += change.1 * part;
        self.drift.length() + self.spin.abs() * reach
    }

    fn center(&self) -> DVec3 {
        let sum: DVec3 = self.hands.iter().map(|hand| hand.position).sum();
        sum / self.hands.len().max(1) as f64
    }

    /// Horizontal distance of the outermost handle from the middle of all `[m]`.
    fn reach(&self) -> f64 {
        let center = self.center();
        let distance = |hand: &Hand| (hand.position - center).with_y(0.0).length();
        let reach = self.hands.iter().map(distance).fold(0.0, f64::max);
        if reach > 1e-3 { reach } else { 0.0 }
    }
}

/// The velocity of a handle over the next `dt` `[s]`: towards its goal as fast as the limits let
/// it, and as it can still brake, s = -a dt/2 + √((a dt/2)² + 2 a d) at a distance d.
/// `[eq:hand-speed]`
fn follow(hand: &Hand, limits: &HandLimits, dt: f64) -> DVec3 {
    let way = hand.goal - hand.position;
    let distance = way.length();
    let half = 0.5 * limits.acceleration * dt;
    let braking = (half * half + 2.0 * limits.acceleration * distance).sqrt() - half;
    let speed = braking.min(limits.speed).min(distance / dt);
    let wanted = way.normalize_or_zero() * speed;
    let change = (wanted - hand.velocity).clamp_length_max(limits.acceleration * dt);
    hand.velocity + change
}

#[cfg(test)]
mod tests;

//! One frame of the cloth of a session: the handles go by hand or along a motion, the movers step,
//! and the recorder keeps the frame.
//!
//! A motion may release handles. Where one is attached again, or the motion ends, the hand is put
//! where the cloth has the vertex by then, and the rest of the path goes on from there.

use glam::DVec3;
use selvedge_cloth::motion::named;
use selvedge_cloth::{HandleTargets, Motion};

use super::Session;
use super::commands::NO_CLOTH;
use super::following::Following;
use crate::hand::{Hands, Reach};
use crate::mover::Reason;
use crate::recorder::Recorder;
use crate::state::Level;

/// The name of the motion that is the scene's own.
const SCENE_MOTION: &str = "scene";

impl Session {
    /// Follows the motion of that name: the scene's own from the start of the scene, another from
    /// the place where the handles come to rest.
    pub(super) fn follow(&mut self, name: String) -> Result<(), Reason> {
        if name == SCENE_MOTION {
            self.end_recording("the scene's own motion starts from its beginning: ");
        }
        let live = self.showing.live.as_mut().ok_or(NO_CLOTH)?;
        let following = if name == SCENE_MOTION {
            live.restart()?;
            let ready = live.ready();
            let (path, first) = (ready.scene_path.clone(), ready.start_frame);
            self.begin();
            Following::new(name, Some(path), first)
        } else {
            let rate = live.ready().frame_rate;
            // A trial: the path itself is bound where the handles come to rest.
            motion_called(&name)?.bind(&self.control.hands.positions(), rate)?;
            self.unfollow();
            self.control.hands.brake(&self.control.limits);
            Following::new(name, None, 0)
        };
        self.control.following = Some(following);
        self.writers.tell_soon();
        Ok(())
    }

    /// Ends the motion where it is; the handles brake.
    pub(super) fn unfollow(&mut self) {
        if let Some(following) = self.control.following.take() {
            if following.path.is_some() {
                if let Err(error) = self.take_hold(&following.place.free) {
                    self.notify(Level::Bad, error.to_string());
                }
                self.control.hands.brake(&self.control.limits);
            }
            self.writers.tell_soon();
        }
    }

    /// Hands whose handles were `free`, `[handles]`, are attached to the cloth where it is.
    fn take_hold(&mut self, free: &[bool]) -> Result<(), Reason> {
        let Some(live) = &mut self.showing.live else {
            return Ok(());
        };
        if !free.contains(&true) {
            return Ok(());
        }
        live.take_hold_again(free)?;
        let places = live.places();
        for (handle, (place, free)) in places.into_iter().zip(free).enumerate() {
            if *free {
                self.control.hands.put(handle, place);
            }
        }
        Ok(())
    }

    /// Moves the cloth by one frame.
    pub(super) fn move_cloth(&mut self) {
        if self.showing.live.is_none() {
            return;
        }
        let rate = self.showing.frame_rate();
        let place = self.control.following.as_ref().map(|f| f.place.clone());
        let before = (self.control.hands.clone(), place);
        let targets = match self.next_targets(rate) {
            Ok(targets) => targets,
            Err(error) => {
                self.unfollow();
                return self.notify(Level::Bad, error.to_string());
            }
        };
        self.lead_bodies(rate);
        let Some(live) = &mut self.showing.live else {
            return;
        };
        let led = self.control.following.as_ref();
        let by_hand = led.is_none_or(|following| following.path.is_none());
        let stopped = live.step(&targets, by_hand);
        if !live.is_moving() {
            // The mover that takes over makes this frame.
            self.control.hands = before.0;
            if let (Some(following), Some(place)) = (&mut self.control.following, before.1) {
                following.place = place;
            }
        }
        if let Some(recorder) = &mut self.recordings.recorder {
            recorder.keep(live);
        }
        self.wait_where_blocked();
        if let Some(stopped) = stopped {
            self.stop_recording();
            self.notify(Level::Bad, stopped);
        }
        let recorder = self.recordings.recorder.as_ref();
        if recorder.is_some_and(Recorder::is_full) {
            self.stop_recording();
        }
    }

    fn next_targets(&mut self, rate: f64) -> Result<HandleTargets, Reason> {
        self.begin_motion(rate)?;
        if let Some(over) = self
            .control
            .following
            .take_if(|following| following.is_over())
        {
            self.control.hands = Hands::at(&self.control.hands.positions());
            self.writers.tell_soon();
            self.take_hold(&over.place.free)?;
        }
        if let Some(targets) = self.follow_path(rate)? {
            return Ok(targets);
        }
        if let Some(live) = &self.showing.live {
            let handles = &live.influences().handles;
            let reach = self.control.reach.as_ref();
            let is_known = reach.is_some_and(|reach| reach.is_of(handles));
            if !is_known {
                self.control.reach = Some(Reach::of(&live.ready().cloth, handles));
            }
        }
        let (limits, dt) = (&self.control.limits, 1.0 / rate);
        match &self.control.reach {
            Some(reach) => self.control.hands.advance_within(limits, dt, reach),
            None => self.control.hands.advance(limits, dt),
        }
        let positions: Vec<DVec3> = self.control.hands.positions();
        Ok(HandleTargets::at_frame_end(positions)?)
    }

    /// Leads the hands by one frame along the path that they follow, if there is one.
    fn follow_path(&mut self, rate: f64) -> Result<Option<HandleTargets>, Reason> {
        let Some(live) = &mut self.showing.live else {
            return Ok(None);
        };
        let Some(following) = &mut self.control.following else {
            return Ok(None);
        };
        let Some(path) = &mut following.path else {
            return Ok(None);
        };
        let place = &mut following.place;
        path.follow(place.frame, &live.handle_places());
        let targets = path.targets(place.frame, live.samples())?;
        let before = std::mem::replace(&mut place.free, targets.let_go());
        let now = before.iter().zip(&place.free);
        live.take_hold_in_each(now.map(|(before, now)| *before && !now));
        place.frame += 1;
        self.control.hands = self.control.hands.led_to(targets.end(), 1.0 / rate);
        Ok(Some(targets))
    }

    /// Binds the motion that waits, once the handles are at rest.
    fn begin_motion(&mut self, rate: f64) -> Result<(), Reason> {
        if let Some(following) = &mut self.control.following
            && following.path.is_none()
            && self.control.hands.is_at_rest()
        {
            let motion = motion_called(&following.name)?;
            let path = motion.bind(&self.control.hands.positions(), rate)?;
            following.path = Some(path);
        }
        Ok(())
    }
}

fn motion_called(name: &str) -> Result<Motion, Reason> {
    named::by_name(name).ok_or_else(|| format!("there is no motion {name:?}").into())
}

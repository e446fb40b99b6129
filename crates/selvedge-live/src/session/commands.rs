//! The requests of a session: each is met, or its error told to the pages.

use glam::DVec3;
use selvedge_cloth::Handles;
use web_time::Instant;

use super::bodies::Bodies;
use super::{Request, Session};
use crate::hand::{HandLimits, Hands};
use crate::live_cloth::LiveCloth;
use crate::mover::{Mover, Reason};
use crate::order::Order;
use crate::player::{Player, Replay};
use crate::protocol::{ClientMessage, Command, Drag};
use crate::recorder::Recorder;
use crate::state::Level;
use crate::workshop::ReadyCloth;

/// The strongest wind that can be asked for `[m/s]`.
const STRONGEST_WIND: f64 = 30.0;
/// The slowest and the fastest time, in parts of real time.
const RATES: std::ops::RangeInclusive<f64> = 0.05..=4.0;
/// Handles that can be added by hand.
const MOST_HANDLES: usize = 256;
/// The answer to a request about a cloth before there is one.
pub(super) const NO_CLOTH: &str = "there is no cloth yet";

impl Session {
    /// Meets a request; an error is told to the pages.
    pub(super) fn take(&mut self, request: Request) {
        let done = match request {
            Request::Page(client, message) => self.hear(client, message),
            #[cfg(feature = "server")]
            Request::Close => Ok(()),
            Request::Viewers { count, gone } => {
                self.count_viewers(count, gone);
                Ok(())
            }
            Request::Progress(text) => {
                self.busy = Some(text);
                self.writers.tell_soon();
                Ok(())
            }
            Request::Prepared(order, Ok(ready)) => self.lay_out(order, ready),
            Request::Prepared(_, Err(error)) => {
                self.busy = None;
                Err(error.into())
            }
        };
        if let Err(error) = done {
            self.notify(Level::Bad, error.to_string());
        }
    }

    /// Meets the message of a page.
    fn hear(&mut self, client: u32, message: ClientMessage) -> Result<(), Reason> {
        match message {
            ClientMessage::Drag(drag) => self.drag(client, &drag),
            ClientMessage::Keys(push) => {
                if self.control.following.is_none() {
                    self.control.hands.push(push);
                    self.control.pusher = Some(client);
                }
                Ok(())
            }
            ClientMessage::Command(command) => {
                self.writers.tell_soon();
                self.command(command)
            }
            ClientMessage::Ready(_) => Ok(()),
        }
    }

    fn count_viewers(&mut self, count: usize, gone: Option<u32>) {
        if self.viewers == 0 {
            self.time.pace.restart(Instant::now());
        }
        self.viewers = count;
        // A page that went away holds no keys down.
        if gone.is_some() && gone == self.control.pusher {
            self.control.hands.push(Default::default());
            self.control.pusher = None;
        }
        self.writers.tell_soon();
    }

    fn command(&mut self, command: Command) -> Result<(), Reason> {
        match command {
            Command::Pause {} => self.time.running = false,
            Command::Resume {} => self.resume(),
            Command::Step {} => {
                self.time.running = false;
                self.advance();
            }
            Command::Reset {} => return self.reset(),
            Command::Order { order } => self.place_order(order),
            Command::Mover { mover } => return self.set_mover(mover),
            Command::Wind { wind } => return self.set_wind(DVec3::from_array(wind)),
            Command::Limits {
                speed,
                acceleration,
            } => self.control.limits = HandLimits::clamped(speed, acceleration),
            Command::Hold { vertices } => return self.hold(&vertices),
            Command::LetGo { vertices } => {
                return self.change_held(|held| held.retain(|v| !vertices.contains(v)));
            }
            Command::Motion { name } => return self.follow(name),
            Command::StopMotion {} => self.unfollow(),
            Command::Record {} => return self.record(),
            Command::StopRecording {} => self.stop_recording(),
            Command::Replay {} => {
                let replay = self.recordings.replay.clone();
                self.play(replay.ok_or("nothing has been recorded yet")?);
            }
            Command::Live {} => self.go_live(),
            Command::Seek { frame } => {
                if let Some(player) = &mut self.showing.player {
                    player.seek(frame);
                    self.publish_frame();
                }
            }
            Command::Rate { rate } => return self.set_rate(rate),
            Command::Body { number, middle } => {
                return self.lead_body(number, DVec3::from_array(middle));
            }
            Command::Throw { from, velocity } => {
                return self.throw(DVec3::from_array(from), DVec3::from_array(velocity));
            }
            Command::Drop {} => return self.change_held(Vec::clear),
            Command::Gaps { shown } => {
                self.shows_gaps = shown;
                self.publish_frame();
            }
        }
        Ok(())
    }

    fn resume(&mut self) {
        if !self.time.running {
            self.time.running = true;
            self.time.pace.restart(Instant::now());
        }
    }

    fn set_rate(&mut self, rate: f64) -> Result<(), Reason> {
        if !RATES.contains(&rate) {
            let (slowest, fastest) = (RATES.start(), RATES.end());
            return Err(format!(
                "time cannot go {rate} times as fast: {slowest} to {fastest} times are possible"
            )
            .into());
        }
        self.time.rate = rate;
        let frames = self.showing.frame_rate() * rate;
        self.time.pace.set_rate(frames, Instant::now());
        Ok(())
    }

    /// Has a cloth made ready.
    pub(super) fn place_order(&mut self, order: Order) {
        self.busy = Some("making the cloth ready".to_owned());
        self.writers.tell_soon();
        if self.orders.send(Some(order)).is_err() {
            self.busy = None;
            self.notify(
                Level::Bad,
                "the workshop has failed: start the program again",
            );
        }
    }

    /// Puts a cloth that is ready on the table.
    fn lay_out(&mut self, order: Order, ready: Box<ReadyCloth>) -> Result<(), Reason> {
        self.stop_recording();
        self.busy = None;
        let before = self.showing.live.as_ref();
        let mover = before.map_or(self.mover, LiveCloth::mover);
        let remarks = ready.remarks.join("; ");
        let (mut live, problem) = LiveCloth::new(ready, mover)?;
        if let (Some(before), true) = (before, order.scene == self.order.scene) {
            // Another mesh or material in the same wind.
            let wind = before.influences().environment.wind;
            if wind != live.influences().environment.wind {
                live.set_wind(wind)?;
            }
        }
        self.order = order;
        self.control.reach = None;
        (self.showing.player, self.showing.live) = (None, Some(live));
        self.begin();
        self.publish_cloth();
        match problem {
            Some(problem) => self.notify(Level::Bad, problem.to_string()),
            None if !remarks.is_empty() => self.notify(Level::Good, remarks),
            None => {}
        }
        Ok(())
    }

    /// Hands and bodies are those of the cloth on the table at its beginning.
    pub(super) fn begin(&mut self) {
        self.control.following = None;
        if let Some(live) = &self.showing.live {
            self.control.hands = Hands::at(&live.places());
            self.bodies = Bodies::of(live);
        }
    }

    fn reset(&mut self) -> Result<(), Reason> {
        if let Some(player) = &mut self.showing.player {
            player.seek(0);
            self.publish_frame();
            return Ok(());
        }
        self.stop_recording();
        let Some(live) = &mut self.showing.live else {
            return Ok(());
        };
        live.restart()?;
        self.begin();
        self.publish_frame();
        Ok(())
    }

    fn set_mover(&mut self, mover: Mover) -> Result<(), Reason> {
        self.mover = mover;
        self.stop_recording();
        if let Some(live) = &mut self.showing.live {
            live.set_mover(mover)?;
            self.publish_frame();
        }
        Ok(())
    }

    /// Changes the wind, of which `wind` is the velocity `[m/s]`.
    fn set_wind(&mut self, wind: DVec3) -> Result<(), Reason> {
        if !wind.is_finite() || wind.length() > STRONGEST_WIND {
            return Err(format!("the wind is at most {STRONGEST_WIND} m/s").into());
        }
        let Some(live) = &mut self.showing.live else {
            return Ok(());
        };
        if wind != live.influences().environment.wind {
            live.set_wind(wind)?;
            self.end_recording("a recording has the same wind from start to end: ");
        }
        Ok(())
    }

    fn drag(&mut self, client: u32, drag: &Drag) -> Result<(), Reason> {
        if self.showing.player.is_some() || self.showing.live.is_none() {
            return Ok(());
        }
        let vertices: Vec<u32> = drag.goals.iter().map(|(vertex, _)| *vertex).collect();
        self.hold(&vertices)?;
        self.unfollow();
        if let Some(live) = &self.showing.live {
            for (vertex, goal) in &drag.goals {
                let mut handles = live.influences().handles.vertices().iter();
                if let Some(handle) = handles.position(|v| v.0 == *vertex) {
                    self.control.hands.want(handle, *goal);
                }
            }
        }
        self.control.drag = [client, drag.number];
        Ok(())
    }

    /// Holds vertices that are not held yet.
    fn hold(&mut self, vertices: &[u32]) -> Result<(), Reason> {
        self.change_held(|held| {
            for vertex in vertices {
                if !held.contains(vertex) {
                    held.push(*vertex);
                }
            }
        })
    }

    /// Changes the list of the vertices that are held, if there is a cloth.
    fn change_held(&mut self, change: impl FnOnce(&mut Vec<u32>)) -> Result<(), Reason> {
        let Some(live) = &self.showing.live else {
            return Ok(());
        };
        let handles = live.influences().handles.vertices().iter();
        let held: Vec<u32> = handles.map(|v| v.0).collect();
        let mut all = held.clone();
        change(&mut all);
        if all == held {
            return Ok(());
        }
        if all.len() > held.len().max(MOST_HANDLES) {
            return Err(format!("{MOST_HANDLES} handles are the most").into());
        }
        let handles = Handles::new(&all, live.ready().cloth.vertex_count())?;
        self.unfollow();
        let Some(live) = &mut self.showing.live else {
            return Ok(());
        };
        let kept = all.iter().map(|v| held.iter().position(|w| w == v));
        let kept: Vec<Option<usize>> = kept.collect();
        live.set_handles(handles, &kept)?;
        let places = live.places();
        self.control.hands = self.control.hands.rearranged(&places, &kept);
        self.end_recording("a recording has the same handles from start to end: ");
        self.writers.tell_soon();
        self.publish_frame();
        Ok(())
    }

    fn record(&mut self) -> Result<(), Reason> {
        if self.showing.player.is_some() {
            return Err("a recording is being played: go back to the cloth first".into());
        }
        if self.recordings.recorder.is_some() {
            return Err("a recording is under way: end it before the next".into());
        }
        let live = self.showing.live.as_ref().ok_or(NO_CLOTH)?;
        self.recordings.recorder = Some(Recorder::new(live));
        self.resume();
        Ok(())
    }

    /// Ends a recording, if there is one, and writes it.
    pub(super) fn stop_recording(&mut self) {
        self.end_recording("");
    }

    /// As [`Self::stop_recording`]; `why` goes before the notice of it.
    pub(super) fn end_recording(&mut self, why: &str) {
        let recorder = self.recordings.recorder.take();
        let (Some(recorder), Some(live)) = (recorder, &self.showing.live) else {
            return;
        };
        let frames = recorder.state().frames;
        let written = recorder.finish(live);
        let written = written.and_then(|tracks| self.recordings.destination.write(tracks));
        match written {
            Ok(written) => {
                let files = written.files.iter();
                let names: Vec<String> = files.map(|file| file.display().to_string()).collect();
                self.recordings.replay = Some(written.replay);
                self.recordings.files = written.files;
                let names = names.join(" and ");
                let wrote = format!("{why}wrote {frames} frames to {names}");
                self.notify(Level::Good, wrote);
            }
            Err(error) => self.notify(Level::Bad, error.to_string()),
        }
    }

    /// Plays a replay; the cloth on the table waits.
    pub(super) fn play(&mut self, replay: Replay) {
        self.stop_recording();
        self.showing.player = Some(Player::new(replay));
        self.resume();
        self.publish_cloth();
    }

    /// Returns from a recording to the cloth on the table.
    fn go_live(&mut self) {
        if self.showing.player.take().is_some() {
            self.resume();
            match &self.showing.live {
                Some(_) => self.publish_cloth(),
                None => self.place_order(self.order.clone()),
            }
        }
    }
}

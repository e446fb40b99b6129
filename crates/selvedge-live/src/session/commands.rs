//! What a session does when it is asked.

use glam::DVec3;
use selvedge_cloth::Handles;

use super::{Request, Session};
use crate::hand::{Hands, Limits};
use crate::order::{Bench, Mover, Order};
use crate::player::{Player, Tape};
use crate::protocol::{ClientMessage, Command, Drag};
use crate::recorder::{self, Recorder};
use crate::stage::Stage;
use crate::state::Level;

/// The strongest wind that can be asked for `[m/s]`.
const STRONGEST_WIND: f64 = 30.0;
/// The slowest and the fastest time, in parts of real time.
const RATES: std::ops::RangeInclusive<f64> = 0.05..=4.0;
/// Handles that can be added by hand.
const MOST_HANDLES: usize = 256;

impl Session {
    /// Does what is asked; what cannot be done is told to the pages.
    pub(super) fn take(&mut self, request: Request) {
        let done = match request {
            Request::Page(client, ClientMessage::Drag(drag)) => self.drag(client, &drag),
            Request::Page(client, ClientMessage::Keys(push)) => {
                if self.following.is_none() {
                    self.hands.push(push);
                    self.pusher = Some(client);
                }
                Ok(())
            }
            Request::Page(_, ClientMessage::Command(command)) => {
                self.tell_soon = true;
                self.command(command)
            }
            Request::Page(_, ClientMessage::Ready(_)) | Request::Close => Ok(()),
            Request::Viewers { count, gone } => {
                if self.viewers == 0 {
                    self.pace.restart(std::time::Instant::now());
                }
                self.viewers = count;
                // A page that went away holds no keys down.
                if gone.is_some() && gone == self.pusher {
                    self.hands.push(Default::default());
                    self.pusher = None;
                }
                self.tell_soon = true;
                Ok(())
            }
            Request::Progress(text) => {
                self.busy = Some(text);
                self.tell_soon = true;
                Ok(())
            }
            Request::Prepared(order, Ok(bench)) => self.lay_out(order, bench),
            Request::Prepared(_, Err(error)) => {
                self.busy = None;
                Err(error)
            }
        };
        if let Err(problem) = done {
            self.notify(Level::Bad, problem);
        }
    }

    fn command(&mut self, command: Command) -> Result<(), String> {
        match command {
            Command::Pause => self.running = false,
            Command::Resume => self.resume(),
            Command::Step => {
                self.running = false;
                self.advance();
            }
            Command::Reset => return self.reset(),
            Command::Order { order } => self.place_order(order),
            Command::Mover { mover } => return self.set_mover(mover),
            Command::Wind { wind } => return self.set_wind(wind),
            Command::Limits {
                speed,
                acceleration,
            } => self.limits = Limits::clamped(speed, acceleration),
            Command::Hold { vertices } => return self.hold(&vertices),
            Command::LetGo { vertices } => return self.let_go(&vertices),
            Command::Motion { name } => return self.follow(name),
            Command::StopMotion => self.unfollow(),
            Command::Record => return self.record(),
            Command::StopRecording => self.stop_recording(),
            Command::Replay => {
                let tape = self.replay.clone().ok_or("nothing has been recorded yet")?;
                self.play(tape);
            }
            Command::Live => self.go_live(),
            Command::Seek { frame } => {
                if let Some(player) = &mut self.player {
                    player.seek(frame);
                    self.publish_frame();
                }
            }
            Command::Rate { rate } if RATES.contains(&rate) => {
                self.rate = rate;
                let frames = self.frame_rate() * rate;
                self.pace.set_rate(frames, std::time::Instant::now());
            }
            Command::Rate { rate } => return Err(format!("time cannot go {rate} times as fast")),
        }
        Ok(())
    }

    fn resume(&mut self) {
        if !self.running {
            self.running = true;
            self.pace.restart(std::time::Instant::now());
        }
    }

    /// Has a cloth made ready.
    pub(super) fn place_order(&mut self, order: Order) {
        self.busy = Some("making the cloth ready".to_owned());
        self.tell_soon = true;
        if !self.orders.send(order) {
            self.busy = None;
            self.notify(
                Level::Bad,
                "the workshop has failed: start the program again",
            );
        }
    }

    /// Puts a cloth that is ready on the table.
    fn lay_out(&mut self, order: Order, bench: Box<dyn Bench>) -> Result<(), String> {
        self.stop_recording();
        self.busy = None;
        let mover = self.stage.as_ref().map_or(self.mover, Stage::mover);
        let remarks = bench.remarks().join("; ");
        let (mut stage, problem) = Stage::new(bench, mover)?;
        if let (Some(before), true) = (&self.stage, order.scene == self.order.scene) {
            // Another mesh or material in the same wind.
            let wind = before.hold().environment.wind;
            if wind != stage.hold().environment.wind {
                stage.set_wind(wind)?;
            }
        }
        self.order = order;
        self.following = None;
        self.hands = Hands::at(&stage.places(&stage.hold().handles));
        self.stage = Some(stage);
        self.player = None;
        self.publish_cloth();
        match problem {
            Some(problem) => self.notify(Level::Bad, problem),
            None if !remarks.is_empty() => self.notify(Level::Good, remarks),
            None => {}
        }
        Ok(())
    }

    fn reset(&mut self) -> Result<(), String> {
        if let Some(player) = &mut self.player {
            player.seek(0);
            self.publish_frame();
            return Ok(());
        }
        self.stop_recording();
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        let mover = stage.mover();
        stage.restart(mover)?;
        self.following = None;
        self.hands = Hands::at(&stage.places(&stage.hold().handles));
        self.publish_frame();
        Ok(())
    }

    fn set_mover(&mut self, mover: Mover) -> Result<(), String> {
        self.mover = mover;
        self.stop_recording();
        if let Some(stage) = &mut self.stage {
            stage.set_mover(mover)?;
            self.publish_frame();
        }
        Ok(())
    }

    fn set_wind(&mut self, wind: [f64; 3]) -> Result<(), String> {
        let wind = DVec3::from_array(wind);
        if !wind.is_finite() || wind.length() > STRONGEST_WIND {
            return Err(format!("the wind is at most {STRONGEST_WIND} m/s"));
        }
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        if wind != stage.hold().environment.wind {
            stage.set_wind(wind)?;
            self.end_recording("a recording has the same wind from start to end: ");
        }
        Ok(())
    }

    fn drag(&mut self, client: u32, drag: &Drag) -> Result<(), String> {
        if self.player.is_some() || self.stage.is_none() {
            return Ok(());
        }
        let vertices: Vec<u32> = drag.goals.iter().map(|(vertex, _)| *vertex).collect();
        self.hold(&vertices)?;
        self.unfollow();
        if let Some(stage) = &self.stage {
            for (vertex, goal) in &drag.goals {
                let mut handles = stage.hold().handles.vertices().iter();
                if let Some(handle) = handles.position(|v| v.0 == *vertex) {
                    self.hands.want(handle, *goal);
                }
            }
        }
        self.drag = [client, drag.number];
        Ok(())
    }

    /// Holds vertices that are not held yet.
    fn hold(&mut self, vertices: &[u32]) -> Result<(), String> {
        let Some(stage) = &self.stage else {
            return Ok(());
        };
        let held: Vec<u32> = stage
            .hold()
            .handles
            .vertices()
            .iter()
            .map(|v| v.0)
            .collect();
        let mut all = held.clone();
        for vertex in vertices {
            if !all.contains(vertex) {
                all.push(*vertex);
            }
        }
        if all.len() == held.len() {
            return Ok(());
        }
        if all.len() > MOST_HANDLES {
            return Err(format!("{MOST_HANDLES} handles are the most"));
        }
        self.set_handles(&all, &held)
    }

    fn let_go(&mut self, vertices: &[u32]) -> Result<(), String> {
        let Some(stage) = &self.stage else {
            return Ok(());
        };
        let held: Vec<u32> = stage
            .hold()
            .handles
            .vertices()
            .iter()
            .map(|v| v.0)
            .collect();
        let kept: Vec<u32> = held
            .iter()
            .copied()
            .filter(|v| !vertices.contains(v))
            .collect();
        if kept.len() == held.len() {
            return Ok(());
        }
        self.set_handles(&kept, &held)
    }

    /// Goes on with the vertices `all` held, where `held` were before.
    fn set_handles(&mut self, all: &[u32], held: &[u32]) -> Result<(), String> {
        let Some(stage) = &self.stage else {
            return Ok(());
        };
        let vertices = stage.bench().cloth().topology().vertex_count();
        let handles = Handles::new(all, vertices).map_err(|error| error.to_string())?;
        self.unfollow();
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        let kept: Vec<Option<usize>> = all
            .iter()
            .map(|v| held.iter().position(|w| w == v))
            .collect();
        stage.set_handles(handles, &kept)?;
        let places = stage.places(&stage.hold().handles);
        self.hands = self.hands.rearranged(&places, &kept);
        self.end_recording("a recording has the same handles from start to end: ");
        self.tell_soon = true;
        self.publish_frame();
        Ok(())
    }

    fn record(&mut self) -> Result<(), String> {
        if self.player.is_some() {
            return Err("a recording is being played: go back to the cloth first".to_owned());
        }
        if self.recorder.is_some() {
            return Err("a recording is under way: end it before the next".to_owned());
        }
        let stage = self.stage.as_ref().ok_or("there is no cloth yet")?;
        self.recorder = Some(Recorder::new(stage));
        self.resume();
        Ok(())
    }

    /// Ends a recording, if there is one, and writes it.
    pub(super) fn stop_recording(&mut self) {
        self.end_recording("");
    }

    /// As [`Self::stop_recording`]; `why` goes before what is told of it.
    pub(super) fn end_recording(&mut self, why: &str) {
        let (Some(recorder), Some(stage)) = (self.recorder.take(), &self.stage) else {
            return;
        };
        let frames = recorder.state().frames;
        let written = recorder
            .finish(stage)
            .and_then(|tracks| recorder::write(tracks, &self.folder));
        match written {
            Ok((tape, files)) => {
                let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
                self.replay = Some(tape);
                self.recorded = files;
                let names = names.join(" and ");
                self.notify(
                    Level::Good,
                    format!("{why}wrote {frames} frames to {names}"),
                );
            }
            Err(problem) => self.notify(Level::Bad, problem),
        }
    }

    /// Plays a tape; the cloth on the table waits.
    pub(super) fn play(&mut self, tape: Tape) {
        self.stop_recording();
        self.player = Some(Player::new(tape));
        self.resume();
        self.publish_cloth();
    }

    /// Back from a recording to the cloth on the table.
    fn go_live(&mut self) {
        if self.player.take().is_some() {
            self.resume();
            match self.stage {
                Some(_) => self.publish_cloth(),
                None => self.place_order(self.order.clone()),
            }
        }
    }
}

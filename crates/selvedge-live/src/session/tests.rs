//! A session by itself: frames are made when a test says so, without a clock or a socket.

use std::sync::mpsc;
use std::time::Duration;

use glam::{DVec3, Vec3};
use selvedge_cloth::Release;
use selvedge_data::Trajectory;
use serde_json::Value;

use super::*;
use crate::protocol::{Command, Drag};
use crate::test_cloth::{CORNERS, PACE, TestCloth, TestWorkshop, order};

/// The fall of a free vertex in a frame `[m]`.
const FALL: f32 = 0.01;

/// A cloth whose free vertices fall.
fn falling() -> TestCloth {
    TestCloth {
        fall: FALL,
        ..TestCloth::default()
    }
}

fn opening(scene: &str, mover: Mover) -> Opening {
    Opening {
        order: order(scene),
        mover,
        replay: None,
    }
}

fn destination() -> Destination {
    Destination::Folder(std::env::temp_dir())
}

/// A session with the cloth `ready` on the table.
pub(super) fn session(ready: TestCloth, mover: Mover) -> Session {
    let (writers, _) = SlotWriters::new();
    let (orders, _) = watch::channel(None);
    let mut session = Session::new(opening("corners", mover), destination(), orders, writers);
    session.take(Request::Prepared(
        order("corners"),
        Ok(Box::new(ready.ready())),
    ));
    session
}

pub(super) fn ask(session: &mut Session, command: Command) {
    session.take(Request::Page(1, ClientMessage::Command(command)));
}

fn play_scene(session: &mut Session) {
    let name = "scene".to_owned();
    ask(session, Command::Motion { name });
}

fn drag(session: &mut Session, goals: &[(u32, DVec3)]) {
    let (number, goals) = (1, goals.to_vec());
    let drag = Drag { number, goals };
    session.take(Request::Page(1, ClientMessage::Drag(drag)));
}

fn blow(session: &mut Session, x: f64) {
    let wind = [x, 0.0, 0.0];
    ask(session, Command::Wind { wind });
}

/// Positions of the cloth of that number `[m]`, `[vertices]`.
fn track(session: &Session, number: usize) -> Vec<Vec3> {
    session.showing.live.as_ref().unwrap().positions()[number].to_vec()
}

/// Frames of the recording under way, which is given up.
fn recorded_frames(session: &mut Session) -> usize {
    let recorder = session.recordings.recorder.take().unwrap();
    recorder.state().frames
}

pub(super) fn assert_told(session: &Session, what: &str) {
    let text = &session.writers.notice().unwrap().text;
    assert!(text.contains(what), "{text}");
}

#[test]
fn another_mover_takes_over_where_the_one_before_has_stopped() {
    let mut session = session(falling(), Mover::Model);
    let corner = CORNERS[3].as_dvec3();
    // Within the length of the cloth between the handles, which a hand cannot pull apart.
    drag(&mut session, &[(0, 0.4 * DVec3::X), (3, corner)]);
    (0..60).for_each(|_| session.advance());
    assert_told(&session, "too far");
    let before = track(&session, 0);
    assert!(before[0].x > 0.1);
    let mover = Mover::Physics;
    ask(&mut session, Command::Mover { mover });
    assert_eq!(track(&session, 0), before);
    session.advance();
    let after = track(&session, 0);
    // The next frame of the drag, no faster than a hand may be.
    let way = f64::from(after[0].distance(before[0]));
    let most = session.control.limits.speed / 60.0;
    assert!(way > 0.01 && way < most, "{way}");
    assert_eq!(after[3], CORNERS[3]);
    (0..120).for_each(|_| session.advance());
    assert!(track(&session, 0)[0].distance(0.4 * Vec3::X) < 1e-5);
}

#[test]
fn hands_go_by_the_cloth_that_moves_where_the_other_has_stopped() {
    let mut session = session(falling(), Mover::Both);
    drag(&mut session, &[(0, DVec3::X)]);
    (0..60).for_each(|_| session.advance());
    let apart = track(&session, 0)[3].distance(track(&session, 1)[3]);
    assert!(apart > 10.0 * FALL, "{apart} m");
    let vertices = vec![3];
    ask(&mut session, Command::Hold { vertices });
    let held = track(&session, 1)[3];
    assert_eq!(session.control.hands.positions()[2], held.as_dvec3());
    (0..10).for_each(|_| session.advance());
    assert_eq!(track(&session, 1)[3], held);
}

#[test]
fn a_handle_that_a_motion_has_let_go_stays_where_it_is() {
    // For three frames or for good; the motion stopped by hand while it is free, after that, or
    // never.
    for (to, stop) in [(Some(0.1), 99), (None, 99), (Some(0.1), 5), (Some(0.1), 8)] {
        let mut ready = falling();
        let (handles, from) = (vec![1], 0.05);
        let release = Release { handles, from, to };
        ready.schedule.releases.push(release);
        let mut session = session(ready, Mover::Physics);
        play_scene(&mut session);
        for frame in 0..40 {
            match frame {
                9 => blow(&mut session, 1.0),
                20 => blow(&mut session, 2.0),
                30 => drag(&mut session, &[(3, CORNERS[3].as_dvec3())]),
                _ => {}
            }
            if frame == stop {
                ask(&mut session, Command::StopMotion {});
            }
            let before = track(&session, 0)[1];
            session.advance();
            let way = track(&session, 0)[1].distance(before);
            // It falls or is led, a hundredth of a metre either way.
            let when = format!("frame {frame}, {to:?}, {stop}");
            assert!(way < 1.01 * FALL, "{way} m in {when}");
        }
        assert!(session.control.following.is_none());
        let there = track(&session, 0)[1].as_dvec3();
        assert!(session.control.hands.positions()[1].distance(there) < 1e-6);
        assert!(there.y < -0.019, "{there}");
    }
}

#[test]
fn the_motion_of_a_scene_goes_on_from_where_the_scene_starts() {
    let mut ready = falling();
    ready.start_frame = 4;
    let mut session = session(ready, Mover::Physics);
    play_scene(&mut session);
    session.advance();
    let way = f64::from(track(&session, 0)[0].x);
    assert!((way - 5.0 * PACE).abs() < 1e-6, "{way} m");
    let following = session.control.following.as_ref().unwrap().state();
    assert_eq!((following.frame, following.frames), (5, 12));
}

#[test]
fn a_recording_ends_where_the_wind_changes() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = session(falling(), Mover::Physics);
    session.recordings.destination = Destination::Folder(folder.path().to_owned());
    ask(&mut session, Command::Record {});
    (0..3).for_each(|_| session.advance());
    // The wind that blows already.
    blow(&mut session, 0.0);
    assert!(session.recordings.recorder.is_some());
    blow(&mut session, 3.0);
    assert!(session.recordings.recorder.is_none());
    assert_told(&session, "the same wind from start to end: wrote 4 frames");
    let recorded = Trajectory::read(&session.recordings.files[0]).unwrap();
    assert_eq!(recorded.provenance().scene, Value::from(0.0));
}

#[test]
fn a_recording_is_not_begun_twice() {
    let mut session = session(falling(), Mover::Physics);
    ask(&mut session, Command::Record {});
    (0..3).for_each(|_| session.advance());
    ask(&mut session, Command::Record {});
    assert_told(&session, "under way");
    assert_eq!(recorded_frames(&mut session), 4);
}

#[test]
fn a_vertex_that_is_not_there_ends_nothing() {
    let mut session = session(falling(), Mover::Physics);
    play_scene(&mut session);
    ask(&mut session, Command::Record {});
    session.advance();
    let vertices = vec![9];
    ask(&mut session, Command::Hold { vertices });
    assert_told(&session, "vertex 9");
    drag(&mut session, &[(9, DVec3::X)]);
    session.advance();
    let following = session.control.following.as_ref().unwrap().state();
    assert_eq!(following.frame, 2);
    assert_eq!(recorded_frames(&mut session), 3);
}

#[test]
fn what_stands_in_for_a_model_is_told_for_half_a_second() {
    let stand_in = |session: &Session| session.state().tracks[0].stand_in;
    let mut session = session(falling(), Mover::Model);
    session.advance();
    assert_eq!(stand_in(&session), None);
    drag(&mut session, &[(0, 0.18 * DVec3::X)]);
    (0..30).for_each(|_| session.advance());
    assert_eq!(stand_in(&session), Some("a stand-in"));
    drag(&mut session, &[(0, DVec3::ZERO)]);
    (0..60).for_each(|_| session.advance());
    assert_eq!(stand_in(&session), None);
}

#[test]
fn an_order_that_a_later_one_overtakes_is_stopped() {
    let opening = opening("slow", Mover::Physics);
    let (begun, has_begun) = mpsc::channel();
    let workshop = Box::new(TestWorkshop {
        begun: Some(begun),
        ..TestWorkshop::default()
    });
    let running = start(workshop, opening, std::env::temp_dir()).unwrap();
    has_begun.recv_timeout(Duration::from_secs(20)).unwrap();
    let order = order("quick");
    let later = ClientMessage::Command(Command::Order { order });
    let port = running.port();
    port.requests.send(Request::Page(1, later)).unwrap();
    let started = Instant::now();
    while port.readers.cloth.borrow().generation == 0 {
        assert!(started.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(5));
    }
    running.close();
}

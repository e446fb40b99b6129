//! Bodies of a session: led within limits, thrown, blocked.

use glam::DVec3;
use selvedge_data::Trajectory;

use super::tests::{ask, assert_told, session};
use super::*;
use crate::body::BodyKind;
use crate::protocol::Command;
use crate::test_cloth::{TestCloth, WALL, body};

/// A session with a thing and a ball beside the cloth.
fn with_bodies(mover: Mover) -> Session {
    let bodies = vec![body(BodyKind::Thing), body(BodyKind::Ball)];
    session(
        TestCloth {
            bodies,
            ..TestCloth::default()
        },
        mover,
    )
}

/// The middle of the body of that number `[m]`.
fn middle(session: &Session, number: usize) -> DVec3 {
    let points = session.showing.live.as_ref().unwrap().body_points();
    let own = &points[3 * number..3 * number + 3];
    own.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / 3.0
}

fn lead(session: &mut Session, number: usize, middle: DVec3) {
    let middle = middle.to_array();
    ask(session, Command::Body { number, middle });
}

fn throw(session: &mut Session, from: DVec3, velocity: DVec3) {
    let (from, velocity) = (from.to_array(), velocity.to_array());
    ask(session, Command::Throw { from, velocity });
}

#[test]
fn a_body_goes_where_it_is_led_within_the_limits() {
    let mut session = with_bodies(Mover::Physics);
    let start = middle(&session, 0);
    let goal = start + DVec3::new(0.0, 0.3, 0.2);
    lead(&mut session, 0, goal);
    let most = session.control.limits.speed / 60.0;
    let mut before = start;
    for _ in 0..120 {
        session.advance();
        let now = middle(&session, 0);
        assert!(now.distance(before) <= most + 1e-6);
        before = now;
    }
    assert!(before.distance(goal) < 1e-5, "{before}");
    // The ball has stayed.
    assert!(middle(&session, 1).distance(start) < 1e-6);
    ask(&mut session, Command::Reset {});
    assert!(middle(&session, 0).distance(start) < 1e-6);
    session.advance();
    assert!(middle(&session, 0).distance(start) < 1e-6);
}

#[test]
fn a_ball_flies_as_balls_do() {
    let mut session = with_bodies(Mover::Physics);
    let (from, velocity) = (DVec3::new(-2.0, 1.0, 0.0), DVec3::new(0.0, 2.0, 1.0));
    throw(&mut session, from, velocity);
    assert!(middle(&session, 1).distance(from) < 1e-5);
    for frame in 1..=30 {
        session.advance();
        let time = f64::from(frame) / 60.0;
        let mut wanted = from + velocity * time;
        // Velocity first, then place: half a frame more of falling.
        wanted.y -= 0.5 * 9.8 * time * (time + 1.0 / 60.0);
        let now = middle(&session, 1);
        assert!(now.distance(wanted) < 1e-5, "{now} {wanted}");
    }
}

#[test]
fn a_ball_takes_what_it_gives_by_its_mass() {
    // The cloth takes a twentieth of the throw in each frame.
    let push = DVec3::Z * (-5.0 * bodies::MASS / 20.0);
    let cloth = TestCloth {
        bodies: vec![body(BodyKind::Ball)],
        push,
        ..TestCloth::default()
    };
    let mut sees = session(cloth, Mover::Physics);
    throw(&mut sees, DVec3::new(-2.0, 1.0, 0.0), DVec3::Z * 5.0);
    let mut way = 0.0;
    for frame in 1..=30 {
        sees.advance();
        way += 5.0 * (1.0 - f64::from(frame) / 20.0) / 60.0;
        assert!((middle(&sees, 0).z - way).abs() < 1e-5, "{frame}");
    }
    assert!(way < 0.6);
}

#[test]
fn what_has_no_room_stays_and_can_be_led_elsewhere() {
    let mut session = with_bodies(Mover::Physics);
    let start = middle(&session, 0);
    lead(&mut session, 0, start + DVec3::X * 2.0);
    (0..240).for_each(|_| session.advance());
    let at = middle(&session, 0);
    assert!(at.x > 0.8 * WALL && at.x <= WALL + 1e-5, "{at}");
    lead(&mut session, 0, start);
    (0..240).for_each(|_| session.advance());
    assert!(middle(&session, 0).distance(start) < 1e-5);
}

#[test]
fn what_cannot_be_thrown_or_led_is_told() {
    let mut sees = with_bodies(Mover::Physics);
    throw(&mut sees, DVec3::X * 2.0, DVec3::ZERO);
    assert_told(&sees, "the wall is there");
    throw(&mut sees, DVec3::ZERO, DVec3::X * 50.0);
    assert_told(&sees, "at no more than 10 m/s");
    throw(&mut sees, DVec3::X * 1e9, DVec3::ZERO);
    assert_told(&sees, "within 12 m");
    lead(&mut sees, 0, DVec3::X * 1e9);
    assert_told(&sees, "within 12 m");
    lead(&mut sees, 7, DVec3::ZERO);
    assert_told(&sees, "no such body");
    let mut blind = with_bodies(Mover::Model);
    throw(&mut blind, DVec3::ZERO, DVec3::ZERO);
    assert_told(&blind, "does not see bodies");
    let mut bare = session(TestCloth::default(), Mover::Physics);
    throw(&mut bare, DVec3::ZERO, DVec3::ZERO);
    assert_told(&bare, "no ball here");
}

#[test]
fn a_cloth_is_dropped_and_gaps_are_told_where_they_are_wanted() {
    let mut session = with_bodies(Mover::Physics);
    assert!(session.state().touches && !session.state().gaps);
    ask(&mut session, Command::Gaps { shown: true });
    assert!(session.state().gaps);
    assert_eq!(session.showing.gaps(), [vec![0.25; 4]]);
    ask(&mut session, Command::Drop {});
    let live = session.showing.live.as_ref().unwrap();
    assert!(live.influences().handles.is_empty());
    session.advance();
}

#[test]
fn a_recording_keeps_the_bodies_and_a_ball_that_was_thrown() {
    for thrown in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let mut session = with_bodies(Mover::Physics);
        session.recordings.destination = Destination::Folder(folder.path().to_owned());
        let start = middle(&session, 0);
        lead(&mut session, 0, start + DVec3::Y * 0.3);
        if thrown {
            throw(&mut session, DVec3::new(-2.0, 1.0, 0.0), DVec3::Z * 5.0);
        }
        ask(&mut session, Command::Record {});
        let mut seen = vec![session.showing.live.as_ref().unwrap().body_points()];
        for _ in 0..5 {
            session.advance();
            seen.push(session.showing.live.as_ref().unwrap().body_points());
        }
        ask(&mut session, Command::StopRecording {});
        let recorded = Trajectory::read(&session.recordings.files[0]).unwrap();
        let tracks = recorded.obstacles();
        assert_eq!(tracks.len(), 1 + usize::from(thrown));
        assert!(tracks.iter().all(|track| !track.is_still()));
        assert_eq!(recorded.frame_count(), seen.len());
        for (number, track) in tracks.iter().enumerate() {
            for (frame, seen) in seen.iter().enumerate() {
                let own = &seen[3 * number..3 * number + 3];
                assert_eq!(&track.frame(frame)[..], own, "frame {frame}");
            }
        }
    }
}

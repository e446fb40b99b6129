//! A session as pages see it: hands, time, recordings, several pages at once.

use std::cell::Cell;
use std::time::Duration;

use crate::common::{CORNERS, quick, served};
use glam::Vec3;
use selvedge_data::Trajectory;

#[test]
fn a_dragged_handle_goes_there_and_the_frame_says_whose_drag_it_follows() {
    let served = quick();
    let mut page = served.ready_page();
    let goal = Vec3::new(0.1, 0.0, 0.0);
    page.drag(41, 0, goal);
    let frame = page.frame(|frame| frame.drag[1] == 41);
    assert!(frame.drag[0] > 0);
    let there = page.frame(|frame| frame.tracks[0][0].distance(goal) < 1e-6);
    assert_eq!(there.tracks[0][1], CORNERS[1]);
    served.close();
}

#[test]
fn any_vertex_can_be_taken_hold_of_and_let_go() {
    let served = quick();
    let mut page = served.ready_page();
    page.drag(1, 3, CORNERS[3] + Vec3::X * 0.05);
    let held = page.frame(|frame| frame.handles == [0, 1, 3]);
    assert_eq!(held.tracks.len(), 1);
    page.frame(|frame| (frame.tracks[0][3].x - 0.05).abs() < 1e-6);
    page.command(r#"{"do":"let-go","vertices":[3]}"#);
    page.frame(|frame| frame.handles == [0, 1]);
    page.command(r#"{"do":"reset"}"#);
    page.frame(|frame| frame.tracks[0] == CORNERS);
    served.close();
}

#[test]
fn two_movers_share_the_hands_and_another_can_join_in_mid_motion() {
    let served = quick();
    let mut page = served.ready_page();
    page.drag(1, 0, Vec3::new(0.2, 0.0, 0.0));
    page.frame(|frame| frame.tracks[0][0].x > 0.1);
    page.command(r#"{"do":"mover","mover":"both"}"#);
    let both = page.frame(|frame| frame.tracks.len() == 2);
    for (one, other) in both.tracks[0].iter().zip(&both.tracks[1]) {
        // f32 positions of about a metre that were moved a few frames apart.
        assert!(one.distance(*other) < 1e-5, "{both:?}");
    }
    page.command(r#"{"do":"mover","mover":"model"}"#);
    page.frame(|frame| frame.tracks.len() == 1);
    served.close();
}

#[test]
fn time_stops_and_goes_on_by_single_frames() {
    let served = quick();
    let mut page = served.ready_page();
    page.command(r#"{"do":"pause"}"#);
    page.state(|state| state["running"] == false);
    // Each step after a drag of its own: a frame from before the pause may be on its way yet.
    let mut step = |drag: u32| {
        page.drag(drag, 0, CORNERS[0]);
        page.command(r#"{"do":"step"}"#);
        let stepped = page.frame(|frame| frame.drag[1] == drag).number;
        // Time in which a dozen frames would be made; a state comes every 0.2 s.
        page.state(|_| true);
        page.state(|_| true);
        stepped
    };
    let one = step(1);
    assert_eq!(step(2), one + 1);
    served.close();
}

#[test]
fn a_recording_is_a_trajectory_that_can_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let served = served(Duration::ZERO, folder.path().join("made"));
    let mut page = served.ready_page();
    page.frame(|_| true);
    page.command(r#"{"do":"record"}"#);
    page.drag(1, 1, Vec3::new(0.3, 0.0, 1.0));
    page.frame(|frame| frame.tracks[0][1].x > 0.2);
    page.command(r#"{"do":"stop-recording"}"#);
    let state = page.state(|state| state["can_replay"] == true);
    let file = state["recorded"][0].as_str().unwrap();
    let trajectory = Trajectory::read(file.as_ref()).unwrap();
    assert_eq!(trajectory.frame(0), CORNERS);
    let last = trajectory.frame(trajectory.frame_count() - 1);
    assert!(last[1].x > 0.2);

    page.command(r#"{"do":"replay"}"#);
    page.state(|state| state["show"]["kind"] == "recording");
    page.command(r#"{"do":"pause"}"#);
    // A busy page may have missed the first frame.
    page.command(r#"{"do":"seek","frame":0}"#);
    page.frame(|frame| frame.tracks[0] == CORNERS);
    let last_frame = trajectory.frame_count() - 1;
    page.command(&format!(r#"{{"do":"seek","frame":{last_frame}}}"#));
    page.frame(|frame| frame.tracks[0] == last);
    // Hands do not move what is recorded; the cloth is where it was when they come back to it.
    page.drag(2, 0, Vec3::ONE);
    page.command(r#"{"do":"live"}"#);
    page.frame(|frame| frame.tracks[0][0] == CORNERS[0] && frame.tracks[0][1].x > 0.2);
    served.close();
}

#[test]
fn a_recording_that_is_under_way_is_written_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let served = served(Duration::ZERO, folder.path().to_owned());
    let mut page = served.ready_page();
    page.frame(|_| true);
    page.command(r#"{"do":"record"}"#);
    page.state(|state| state["recording"]["frames"].as_u64() > Some(3));
    served.close();
    let file = folder.path().join("recording-1-physics.safetensors");
    assert!(Trajectory::read(&file).unwrap().frame_count() > 3);
}

#[test]
fn a_page_that_goes_harms_nobody() {
    let served = quick();
    let mut one = served.ready_page();
    let mut other = served.ready_page();
    other.state(|state| state["viewers"] == 2);
    one.drag(1, 0, Vec3::new(0.1, 0.0, 0.0));
    // It was heard: a connection that is dropped with frames unread is reset, and what it has sent
    // and nobody has read yet is lost with it.
    one.frame(|frame| frame.drag[1] == 1);
    drop(one);
    other.state(|state| state["viewers"] == 1);
    other.frame(|frame| (frame.tracks[0][0].x - 0.1).abs() < 1e-6);
    served.close();
}

#[test]
fn keys_that_are_down_stay_down_until_their_own_page_goes() {
    let served = quick();
    let mut one = served.ready_page();
    one.keys(Vec3::X);
    one.frame(|frame| frame.tracks[0][0].x > 0.01);
    let mut other = served.ready_page();
    let start = other.frame(|_| true).tracks[0][0].x;
    // 1.57 m/s: braking takes a quarter of a metre.
    other.frame(|frame| frame.tracks[0][0].x > start + 0.5);
    drop(one);
    other.state(|state| state["viewers"] == 1);
    let before = Cell::new(f32::NEG_INFINITY);
    // They come to rest.
    other.frame(|frame| {
        let now = frame.tracks[0][0].x;
        before.replace(now) == now
    });
    served.close();
}

#[test]
fn steps_that_are_too_slow_slow_time_and_say_so() {
    let served = served(Duration::from_millis(50), std::env::temp_dir());
    let mut page = served.ready_page();
    let state = page.state(|state| state["kept"].as_f64() < Some(0.9));
    // At most 20 frames of 60 in a second; the machine may be busy, too.
    assert!(
        state["kept"].as_f64() <= Some(20.0 / 60.0 + 0.02),
        "{state}"
    );
    assert!(state["tracks"][0]["step_ms"].as_f64() >= Some(50.0));
    served.close();
}

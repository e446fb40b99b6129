//! The clock of a session: one frame per 1/rate seconds, and slower time where a frame takes
//! longer.
//!
//! A few slow frames are made up for by those that follow. A frame that is later than that is not made up for by a burst
//! of others: time itself slows, evenly, and [`Pace::kept`] says by how much.

use std::time::Duration;

use web_time::Instant;

/// The time of the next frame, and the share of frames that came on time.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    period: Duration,
    due: Instant,
    /// The frames of the second before, and since when they are counted.
    since: Instant,
    frames: u32,
    kept: f64,
}

/// The rate of a session before its first cloth `[1/s]`: the default of scenes.
pub(crate) use selvedge_cloth::DEFAULT_FRAME_RATE;

/// A frame may be so late and the next still comes on time: nine frames of 60 a second. A cloth
/// that falls on a table has some ten frames of 25 to 45 ms in its first second in a browser.
const GRACE: Duration = Duration::from_millis(150);

impl Pace {
    pub(crate) fn new(frames_per_second: f64, now: Instant) -> Self {
        let mut pace = Self {
            period: Duration::ZERO,
            due: now,
            since: now,
            frames: 0,
            kept: 1.0,
        };
        pace.set_rate(frames_per_second, now);
        pace
    }

    pub(crate) fn set_rate(&mut self, frames_per_second: f64, now: Instant) {
        let period = Duration::from_secs_f64(1.0 / frames_per_second.clamp(0.1, 1e5));
        if period != self.period {
            self.period = period;
            self.restart(now);
        }
    }

    /// Time begins anew, as after a pause.
    pub(crate) fn restart(&mut self, now: Instant) {
        (self.due, self.since, self.frames, self.kept) = (now, now, 0, 1.0);
    }

    /// The time until the next frame is due; zero, if it is.
    pub(crate) fn wait(&self, now: Instant) -> Duration {
        self.due.saturating_duration_since(now)
    }

    /// A frame that was due has been made.
    pub(crate) fn made(&mut self, now: Instant) {
        self.due += self.period;
        if now > self.due + GRACE {
            self.due = now;
        }
        self.frames += 1;
        let over = now.saturating_duration_since(self.since);
        if over >= Duration::from_secs(1) {
            let expected = over.as_secs_f64() / self.period.as_secs_f64();
            self.kept = (f64::from(self.frames) / expected).min(1.0);
            (self.since, self.frames) = (now, 0);
        }
    }

    /// Frames of the last second in parts of those that it should have had, at most 1.
    pub(crate) fn kept(&self) -> f64 {
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_keep_the_rate_or_slow_time_and_say_so() {
        // Five seconds. Quick steps make 300 frames, and the one at the start; slow ones 25 of 60.
        let (quick, slow) = ((4, 300..=301, 0.98..=1.01), (40, 124..=126, 0.397..=0.436));
        for (cost_ms, made, share) in [quick, slow] {
            let start = Instant::now();
            let (mut now, mut frames) = (start, 0);
            let mut pace = Pace::new(60.0, now);
            while now.duration_since(start) < Duration::from_secs(5) {
                now += pace.wait(now) + Duration::from_millis(cost_ms);
                pace.made(now);
                frames += 1;
            }
            assert!(made.contains(&frames), "{cost_ms} ms: {frames}");
            let kept = pace.kept();
            assert!(share.contains(&kept), "{cost_ms} ms: {kept}");
        }
    }

    #[test]
    fn a_few_slow_frames_are_made_up_for() {
        let start = Instant::now();
        let mut pace = Pace::new(60.0, start);
        let mut now = start;
        // Nine frames of 30 ms, then quick ones: 60 in a second all the same.
        for frame in 0..60 {
            now += pace.wait(now) + Duration::from_millis(if frame < 9 { 30 } else { 5 });
            pace.made(now);
        }
        let over = now.duration_since(start);
        assert!(over < Duration::from_millis(1000), "{over:?}");
    }

    #[test]
    fn a_hitch_is_not_made_up_for() {
        let start = Instant::now();
        let mut pace = Pace::new(60.0, start);
        let late = start + Duration::from_secs(3);
        pace.made(late);
        pace.made(late);
        assert!(!pace.wait(late).is_zero());
    }
}

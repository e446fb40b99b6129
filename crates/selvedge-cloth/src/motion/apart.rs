//! Handles that move separately: towards each other and apart again, and forward one after the
//! other.
//!
//! Between the outer handles, as far as they are from each other, d: the first moves by a d, the
//! last by -a d, those between them in proportion to their place on the line; forward is the
//! horizontal normal of the line, y × d, by f of its length. So all distances along the line shrink
//! alike, to no less than 0.6 of what they were, and none grows.

use glam::DVec3;

use super::error::{MotionError, value_error};
use super::written::{Keyframe, KeyframeGroup, KeyframeMotion, Motion};

/// Seconds after the still start, approach a of either outer handle, and forward f of the first and
/// the last.
const PLACES: [(f64, f64, [f64; 2]); 5] = [
    (1.0, 0.2, [0.0, 0.0]),
    (2.0, 0.1, [0.0, 0.3]),
    (3.0, 0.0, [0.3, 0.3]),
    (4.0, 0.2, [0.0, 0.0]),
    (5.0, 0.0, [0.0, 0.0]),
];
/// Still before and after `[s]`.
const BEFORE: f64 = 0.5;
const AFTER: f64 = 3.0;

/// The motion for handles that start at `start` `[m]`, `[handles]`; the first and the last are the
/// outer ones. It lasts 8.5 s.
///
/// # Errors
/// [`MotionError`] where there are fewer than two handles, or the outer ones are above each other.
pub fn apart(start: &[DVec3]) -> Result<Motion, MotionError> {
    let [first, .., last] = start else {
        return Err(MotionError::TooFewHandles {
            what: "moving handles apart",
            needed: 2,
            found: start.len(),
        });
    };
    let line = *last - *first;
    let forward = DVec3::Y.cross(line);
    if !(forward.is_finite() && forward.length() > 1e-9) {
        let expected = "such that the first and the last are beside each other";
        return Err(value_error(
            "handles",
            expected,
            format!("{first} and {last}"),
        ));
    }
    let groups = start.iter().enumerate().map(|(handle, point)| {
        let place = (*point - *first).dot(line) / line.length_squared();
        let keyframe = |&(time, approach, [of_first, of_last]): &(f64, f64, [f64; 2])| Keyframe {
            time: BEFORE + time,
            translation: approach * (1.0 - 2.0 * place) * line
                + (of_first * (1.0 - place) + of_last * place) * forward,
            rotation_deg: 0.0,
        };
        let still = Keyframe {
            time: BEFORE,
            translation: DVec3::ZERO,
            rotation_deg: 0.0,
        };
        KeyframeGroup {
            handles: vec![handle],
            axis: DVec3::Y,
            keyframes: std::iter::once(still)
                .chain(PLACES.iter().map(keyframe))
                .collect(),
        }
    });
    Ok(Motion::Keyframes(KeyframeMotion {
        duration: BEFORE + PLACES[PLACES.len() - 1].0 + AFTER,
        groups: groups.collect(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::named;

    #[test]
    fn on_a_line_of_one_metre_it_is_the_motion_of_that_name() {
        let line = [DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 0.5)];
        let named = named::by_name("apart").unwrap().bind(&line, 60.0).unwrap();
        let made = apart(&line).unwrap().bind(&line, 60.0).unwrap();
        assert_eq!(made.frame_count(), named.frame_count());
        for frame in 0..=made.frame_count() {
            let time = frame as f64 / 60.0;
            for (a, b) in made.at(time).iter().zip(named.at(time)) {
                assert!(a.distance(b) < 1e-15, "{time}");
            }
        }
    }

    #[test]
    fn distances_on_any_line_are_between_0_6_and_1_of_what_they_were() {
        let across = DVec3::new(0.3, 0.0, -1.1);
        let line: Vec<DVec3> = (0..5)
            .map(|k| DVec3::new(0.2, 0.7, 0.1) + f64::from(k * k) / 16.0 * across)
            .collect();
        let path = apart(&line).unwrap().bind(&line, 60.0).unwrap();
        let (mut least, mut most) = (f64::MAX, 0.0_f64);
        for frame in 0..=path.frame_count() {
            let now = path.at(frame as f64 / 60.0);
            for (a, b) in (0..5).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let ratio = now[a].distance(now[b]) / line[a].distance(line[b]);
                (least, most) = (least.min(ratio), most.max(ratio));
            }
        }
        assert!(
            (least - 0.6).abs() < 1e-12 && (most - 1.0).abs() < 1e-12,
            "{least} {most}"
        );
    }

    #[test]
    fn handles_that_have_no_line_are_an_error() {
        assert!(apart(&[DVec3::ZERO]).is_err());
        let error = apart(&[DVec3::ZERO, DVec3::Y]).unwrap_err().to_string();
        assert!(error.contains("beside each other"), "{error}");
    }
}

//! Handles that move separately: towards each other and apart again, and forward one after the
//! other.
//!
//! Between the outer handles, as far as they are from each other, d: the first moves by a d, the
//! last by -a d, those between them in proportion to their place on the line; forward is the
//! horizontal normal of the line, y × d, by f of its length. So all distances along the line shrink
//! alike, to no less than 0.6 of what they were, and none grows.

use glam::DVec3;

use super::bounds::too_few_handles;
use super::written::{Keyframe, KeyframeGroup, KeyframeMotion, Motion};
use crate::error::{SceneError, must};

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
/// [`SceneError`] where there are fewer than two handles, or the outer ones are above each other.
pub fn apart(start: &[DVec3]) -> Result<Motion, SceneError> {
    let [first, .., last] = start else {
        let error = too_few_handles("moving handles apart", start.len());
        return Err(error.of("motion"));
    };
    let line = *last - *first;
    let forward = DVec3::Y.cross(line);
    if !(forward.is_finite() && forward.length() > 1e-9) {
        let expected = "such that the first and the last are beside each other";
        let error = must("handles", expected, format!("{first} and {last}"));
        return Err(error.of("motion"));
    }
    Ok(along_line(start, line, forward))
}

/// The motion for handles along `line` from the first of `start` on `[m]`, forward along `forward`.
pub(super) fn along_line(start: &[DVec3], line: DVec3, forward: DVec3) -> Motion {
    let groups = start.iter().enumerate().map(|(handle, point)| {
        let place = (*point - start[0]).dot(line) / line.length_squared();
        let keyframe = |(time, approach, [of_first, of_last]): (f64, f64, [f64; 2])| Keyframe {
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
            keyframes: [&[still][..], &PLACES.map(keyframe)].concat(),
        }
    });
    Motion::Keyframes(KeyframeMotion {
        duration: BEFORE + PLACES[PLACES.len() - 1].0 + AFTER,
        groups: groups.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_on_any_line_are_between_0_6_and_1_of_what_they_were() {
        let across = DVec3::new(0.3, 0.0, -1.1);
        let line: Vec<DVec3> = (0..5)
            .map(|k| DVec3::new(0.2, 0.7, 0.1) + f64::from(k * k) / 16.0 * across)
            .collect();
        let path = apart(&line).unwrap().bind(&line, 60.0).unwrap();
        assert_eq!(path.frame_count(), 30 + 300 + 180);
        assert_eq!(path.at(8.5), line);
        let (mut least, mut most) = (f64::MAX, 0.0_f64);
        for frame in 0..=path.frame_count() {
            let now = path.at(frame as f64 / 60.0);
            for (a, b) in (0..5).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let ratio = now[a].distance(now[b]) / line[a].distance(line[b]);
                (least, most) = (least.min(ratio), most.max(ratio));
            }
        }
        assert!((least - 0.6).abs() < 1e-12, "{least}");
        assert!((most - 1.0).abs() < 1e-12, "{most}");
    }

    #[test]
    fn handles_that_have_no_line_are_an_error() {
        assert!(apart(&[DVec3::ZERO]).is_err());
        let error = apart(&[DVec3::ZERO, DVec3::Y]).unwrap_err().to_string();
        assert!(error.contains("beside each other"), "{error}");
    }
}

//! The stage around a run: the camera, the floor under the cloth, and the light that casts the
//! shadow.

use glam::{Vec2, Vec3};

use super::camera::{Camera, View};
use crate::{Run, ViewError};

/// A camera, the floor in its view, and the part of the floor that shadows can reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    pub(crate) camera: Camera,
    /// Height of the floor `[m]`.
    pub(crate) floor: f32,
    /// Unit vector towards the light that casts the shadow.
    pub(crate) shadow_light: Vec3,
    /// Corners of the rectangle (x, z) that holds every shadow `[m]`.
    pub(crate) shadow_low: Vec2,
    pub(crate) shadow_high: Vec2,
}

impl Stage {
    /// The stage that holds all `runs` in pictures of `aspect` (width over height).
    pub fn of_runs(runs: &[&Run<'_>], view: View, aspect: f32) -> Result<Self, ViewError> {
        view.check()?;
        check(runs)?;
        let points = || {
            let runs = runs.iter();
            runs.flat_map(|run| (0..run.frames().len()).flat_map(|frame| seen(run, frame)))
        };
        let frames = 0..runs.iter().map(|run| run.frames().len()).max().unwrap_or(0);
        let floor = floor_of(runs, frames, points());
        let camera = view.fit(points().flat_map(|p| [p, grounded(p, floor)]), aspect);
        Ok(Self::around(camera, floor, points()))
    }

    /// One stage per frame of `frames`, for pictures of `aspect` beside each other. The camera goes
    /// along with the cloth over the floor, at one distance from which each of the frames fits into
    /// its picture: the cloth is as large as it can be, and equally large in all pictures.
    pub(crate) fn following(
        runs: &[&Run<'_>],
        frames: &[usize],
        view: View,
        aspect: f32,
    ) -> Result<Vec<Self>, ViewError> {
        check(runs)?;
        for run in runs {
            let count = run.frames().len();
            if let Some(&frame) = frames.iter().find(|&&frame| frame >= count) {
                return Err(ViewError::no_frame(frame, count));
            }
        }
        let of_frame = |frame: usize| {
            let runs = runs.iter();
            runs.flat_map(move |run| seen(run, frame))
        };
        let points = frames.iter().flat_map(|&frame| of_frame(frame));
        let floor = floor_of(runs, frames.iter().copied(), points);
        let places: Vec<Vec3> = frames.iter().map(|&f| middle(of_frame(f))).collect();
        let moved = frames.iter().zip(&places).flat_map(|(&frame, &place)| {
            of_frame(frame).flat_map(move |p| [p - place, grounded(p, floor) - place])
        });
        let camera = view.fit(moved, aspect);
        let stages = frames
            .iter()
            .zip(&places)
            .map(|(&frame, &place)| Self::around(camera.moved_by(place), floor, of_frame(frame)));
        Ok(stages.collect())
    }

    /// The stage of a camera over a floor, with the shadow of `points`.
    fn around(camera: Camera, floor: f32, points: impl Iterator<Item = Vec3>) -> Self {
        let level = Vec3::Y.cross(camera.right).normalize_or(Vec3::X) * -1.0;
        let shadow_light = (Vec3::Y + 0.22 * level - 0.16 * camera.right).normalize();
        let (mut shadow_low, mut shadow_high) = (Vec2::MAX, Vec2::MIN);
        for point in points {
            let place = cast(point, shadow_light, floor);
            shadow_low = shadow_low.min(place);
            shadow_high = shadow_high.max(place);
        }
        Self {
            camera,
            floor,
            shadow_light,
            shadow_low,
            shadow_high,
        }
    }
}

fn check(runs: &[&Run<'_>]) -> Result<(), ViewError> {
    if runs.is_empty() {
        return Err(ViewError::no_panels());
    }
    Ok(())
}

/// The points of a frame that a picture holds: the cloth, and the bodies beside it.
fn seen(run: &Run<'_>, frame: usize) -> impl Iterator<Item = Vec3> {
    let cloth = run.frames()[frame].iter().copied();
    cloth.chain(run.body_points(frame))
}

/// The height of the floor `[m]`: of a body that is one, where nothing is below it; else of what
/// stands lowest, where that is a body; else a little below all `points`.
fn floor_of(
    runs: &[&Run<'_>],
    frames: impl Iterator<Item = usize>,
    points: impl Iterator<Item = Vec3>,
) -> f32 {
    let (lowest, highest) = points.fold((f32::MAX, f32::MIN), |(low, high), point| {
        (low.min(point.y), high.max(point.y))
    });
    let own = runs.iter().filter_map(|run| run.floor()).reduce(f32::min);
    let mut bodies = frames.flat_map(|frame| {
        let there = runs.iter().filter(move |run| frame < run.frames().len());
        there.flat_map(move |run| run.body_points(frame))
    });
    let under = if bodies.any(|point| point.y <= lowest) {
        lowest
    } else {
        lowest - (0.06 * (highest - lowest)).max(0.01)
    };
    own.filter(|floor| *floor <= lowest + 1e-2).unwrap_or(under)
}

/// The place on the floor under `point` `[m]`.
fn grounded(point: Vec3, floor: f32) -> Vec3 {
    Vec3::new(point.x, floor, point.z)
}

/// The middle of the box around `points` at height 0 `[m]`.
fn middle(points: impl Iterator<Item = Vec3>) -> Vec3 {
    let (low, high) = points.fold((Vec3::MAX, Vec3::MIN), |(low, high), point| {
        (low.min(point), high.max(point))
    });
    grounded(0.5 * low + 0.5 * high, 0.0)
}

/// The place (x, z) `[m]` on the floor where the light from `towards_light` throws `point`.
pub(crate) fn cast(point: Vec3, towards_light: Vec3, floor: f32) -> Vec2 {
    let fall = (point.y - floor) / towards_light.y;
    let place = point - fall * towards_light;
    Vec2::new(place.x, place.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::camera::MARGIN;
    use proptest::prelude::*;
    use selvedge_cloth::Topology;

    proptest! {
        #[test]
        fn the_stage_contains_every_point_and_touches_the_margin(
            points in prop::collection::vec(prop::array::uniform3(-3.0_f32..3.0), 6),
            azimuth in -229.0_f32..229.0,
            elevation in 0.0_f32..69.0,
            aspect in 0.5_f32..2.5,
        ) {
            let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
            let points: Vec<Vec3> = points.into_iter().map(Vec3::from_array).collect();
            let run = Run::new(&topology, points.chunks(3), &[], 60.0).unwrap();
            let view = View { azimuth, elevation };
            let whole = Stage::of_runs(&[&run], view, aspect).unwrap();
            let both = Stage::following(&[&run], &[0, 1], view, aspect).unwrap();
            let reach_in = |stage: &Stage, points: &[Vec3]| {
                let grounded = points.iter().map(|p| grounded(*p, stage.floor));
                points.iter().copied().chain(grounded).fold(0.0_f32, |farthest, point| {
                    let seen = stage.camera.project(point);
                    let reach = (2.0 * seen.x - 1.0).abs().max((2.0 * seen.y - 1.0).abs());
                    if seen.depth > 0.0 { farthest.max(reach) } else { f32::INFINITY }
                })
            };
            // Some point is at the margin: the camera is no farther away than it must be. Rounding
            // of coordinates around 10 m leaves about 1e-5.
            let margin = 1.0 - MARGIN;
            prop_assert!((reach_in(&whole, &points) - margin).abs() < 1e-4);
            let reaches = [0, 1].map(|k| reach_in(&both[k], &points[3 * k..3 * k + 3]));
            prop_assert!((reaches[0].max(reaches[1]) - margin).abs() < 1e-4, "{:?}", reaches);
        }
    }

    #[test]
    fn a_camera_that_follows_sees_the_same_cloth_at_the_same_place() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let start = [Vec3::ZERO, Vec3::Y, Vec3::Z];
        let gone = start.map(|point| point + Vec3::new(2.0, 0.0, -1.0));
        let run = Run::new(&topology, [&start[..], &gone[..]], &[], 60.0).unwrap();
        let stages = Stage::following(&[&run], &[0, 1], View::default(), 1.0).unwrap();
        for (before, after) in start.iter().zip(gone) {
            let [p, q] = [
                stages[0].camera.project(*before),
                stages[1].camera.project(after),
            ];
            assert!((p.x - q.x).abs() < 1e-5 && (p.y - q.y).abs() < 1e-5);
        }
        let error = Stage::following(&[&run], &[2], View::default(), 1.0).unwrap_err();
        assert!(error.to_string().contains("has only 2 frames"), "{error}");
    }
}

//! One triangle on the screen: barycentric weights, and what they interpolate.
//!
//! Weights are linear over the screen, bᵢ = area(opposite edge, p) / area, and so is 1/depth. A
//! value times 1/depth is interpolated linearly, and then divided by 1/depth: this is perspective.

use std::ops::Range;

use glam::{Vec2, Vec3, Vec3A};

use crate::raster::camera::Camera;
use crate::raster::shade::{Point, Shader};

#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenVertex {
    /// In samples from the top left corner.
    pub(super) place: Vec2,
    /// 1/depth `[1/m]`; 0 behind the camera.
    pub(super) nearness: f32,
    pub(super) normal: Vec3A,
    pub(super) sun: f32,
    pub(super) relief: f32,
    pub(super) value: f32,
}

impl ScreenVertex {
    /// A vertex at `position` `[m]` with `normal`, on a screen of `extent` samples, which the part
    /// `sun` of the key light reaches.
    pub(super) fn new(
        camera: &Camera,
        extent: [usize; 2],
        position: Vec3,
        normal: Vec3,
        sun: f32,
    ) -> Self {
        let [width, height] = extent.map(|side| side as f32);
        let seen = camera.project(position);
        let ahead = seen.depth > 1e-6;
        Self {
            place: Vec2::new(seen.x * width, seen.y * height),
            nearness: if ahead { seen.depth.recip() } else { 0.0 },
            normal: normal.into(),
            sun,
            relief: 0.0,
            value: 0.0,
        }
    }
}

/// A triangle on the screen, ready to be filled. Weights are barycentric, one per corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    places: [Vec2; 3],
    /// True when its front is seen.
    front: bool,
    /// Change of the weights per sample to the right and down `[1/sample]`.
    pub(super) across: Vec3A,
    down: Vec3A,
    pub(super) nearness: Vec3A,
    /// Normals times nearness, towards the visible side.
    normals: [Vec3A; 3],
    sun: Vec3A,
    /// Positive on a ridge of the visible side.
    relief: Vec3A,
    values: Vec3A,
}

impl Triangle {
    /// `None` for a triangle that reaches behind the camera or is seen edge-on.
    pub(super) fn new(corners: [ScreenVertex; 3]) -> Option<Self> {
        let places = corners.map(|corner| corner.place);
        let [a, b, c] = places;
        // Twice the signed area; y runs down, so that the front has a negative one.
        let doubled_area = (b - a).perp_dot(c - a);
        let nearness = Vec3A::from_array(corners.map(|corner| corner.nearness));
        if nearness.min_element() <= 0.0 || doubled_area.abs() < 1e-9 {
            return None;
        }
        let front = doubled_area < 0.0;
        let sign = if front { 1.0 } else { -1.0 };
        Some(Self {
            places,
            front,
            across: Vec3A::new(b.y - c.y, c.y - a.y, a.y - b.y) / doubled_area,
            down: Vec3A::new(c.x - b.x, a.x - c.x, b.x - a.x) / doubled_area,
            nearness,
            normals: corners.map(|corner| corner.normal * (sign * corner.nearness)),
            sun: Vec3A::from_array(corners.map(|corner| corner.sun)),
            relief: Vec3A::from_array(corners.map(|corner| corner.relief)) * sign,
            values: Vec3A::from_array(corners.map(|corner| corner.value * corner.nearness)),
        })
    }

    /// The tint of the side that is seen.
    pub(super) fn tint(&self, shader: &Shader) -> Vec3A {
        if self.front {
            shader.front
        } else {
            shader.back
        }
    }

    pub(super) fn bounds(&self, width: usize, height: usize) -> Option<[Range<usize>; 2]> {
        bounds(self.places, 0.0, width, height)
    }

    /// The weights at `sample`; none is negative inside.
    #[inline]
    pub(super) fn weights(&self, sample: Vec2) -> Vec3A {
        // Measured from a corner, so that large coordinates cost no accuracy.
        let offset = sample - self.places[0];
        Vec3A::X + self.across * offset.x + self.down * offset.y
    }

    /// The part of `columns` in which no weight is negative, give or take one column, in a row
    /// that starts with weights `start`.
    #[inline]
    pub(super) fn span(&self, start: Vec3A, columns: &Range<usize>) -> Range<usize> {
        let (mut first, mut last) = (columns.start as f32, columns.end as f32);
        for (weight, slope) in start.to_array().into_iter().zip(self.across.to_array()) {
            let zero = -weight / slope;
            if slope > 0.0 {
                first = first.max(zero - 0.5);
            } else if slope < 0.0 {
                last = last.min(zero + 1.5);
            }
        }
        first as usize..last as usize
    }

    /// The surface at `weights`, seen from its visible side.
    #[inline]
    pub(super) fn point_at(&self, weights: Vec3A) -> Point {
        let [a, b, c] = self.normals;
        let [u, v, w] = weights.to_array();
        let normal = a * u + b * v + c * w;
        Point {
            // Three opposite normals could cancel: the floor of the length keeps this finite.
            normal: normal * normal.length_squared().max(1e-20).sqrt().recip(),
            sun: weights.dot(self.sun),
            relief: weights.dot(self.relief),
        }
    }

    /// The value at `weights`.
    #[inline]
    pub(super) fn value_at(&self, weights: Vec3A, nearness: f32) -> f32 {
        weights.dot(self.values) / nearness
    }
}

/// The columns and rows of samples whose middles can lie within `reach` of a triangle.
pub(super) fn bounds(
    corners: [Vec2; 3],
    reach: f32,
    width: usize,
    height: usize,
) -> Option<[Range<usize>; 2]> {
    let [a, b, c] = corners;
    let low = a.min(b).min(c) - reach;
    let high = a.max(b).max(c) + reach;
    let range = |low: f32, high: f32, count: usize| {
        let first = (low - 0.5).ceil().max(0.0) as usize;
        let last = ((high + 0.5).floor().max(0.0) as usize).min(count);
        (first < last).then_some(first..last)
    };
    Some([range(low.x, high.x, width)?, range(low.y, high.y, height)?])
}

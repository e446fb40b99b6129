//! One triangle on the screen: barycentric weights, and what they interpolate.
//!
//! Weights are linear over the screen, bᵢ = area(opposite edge, p) / area, and so is 1/depth. A
//! value times 1/depth is interpolated linearly, and then divided by 1/depth: this is perspective.

use std::ops::Range;

use glam::{Vec2, Vec3, Vec3A};

use crate::raster::camera::Camera;
use crate::raster::shade::Point;
use crate::raster::sun::Sun;

#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenVertex {
    /// In samples from the top left corner.
    pub(super) place: Vec2,
    /// 1/depth `[1/m]`; 0 behind the camera.
    pub(super) nearness: f32,
    pub(super) normal: Vec3A,
    /// Cosine of the normal and the direction to the camera.
    pub(super) facing: f32,
    /// Where the key light sees it, in cells.
    pub(super) lit: Vec3A,
    pub(super) relief: f32,
    pub(super) value: f32,
}

impl ScreenVertex {
    /// A vertex at `position` `[m]` with `normal`, on a screen of `extent` samples, at the place
    /// `lit` of the key light.
    pub(super) fn new(
        camera: &Camera,
        extent: [usize; 2],
        position: Vec3,
        normal: Vec3,
        lit: Vec3A,
    ) -> Self {
        let [width, height] = extent.map(|side| side as f32);
        let seen = camera.project(position);
        let ahead = seen.depth > 1e-6;
        Self {
            place: Vec2::new(seen.x * width, seen.y * height),
            nearness: if ahead { seen.depth.recip() } else { 0.0 },
            normal: normal.into(),
            facing: normal.dot((camera.position - position).normalize_or_zero()),
            lit,
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
    /// Normals, places of the light and places on the fabric `[m]`, times nearness.
    normals: [Vec3A; 3],
    lit: [Vec3A; 3],
    fabric: [Vec2; 3],
    relief: Vec3A,
    values: Vec3A,
    /// Samples per metre of the fabric; 0 where that is unknown.
    scale: f32,
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
        Some(Self {
            places,
            front: doubled_area < 0.0,
            across: Vec3A::new(b.y - c.y, c.y - a.y, a.y - b.y) / doubled_area,
            down: Vec3A::new(c.x - b.x, a.x - c.x, b.x - a.x) / doubled_area,
            nearness,
            normals: corners.map(|corner| corner.normal * corner.nearness),
            lit: corners.map(|corner| corner.lit * corner.nearness),
            fabric: [Vec2::ZERO; 3],
            relief: Vec3A::from_array(corners.map(|corner| corner.relief)),
            values: Vec3A::from_array(corners.map(|corner| corner.value * corner.nearness)),
            scale: 0.0,
        })
    }

    /// The same triangle with its corners at `places` on the fabric `[m]`.
    pub(super) fn on_fabric(mut self, places: [Vec2; 3]) -> Self {
        let area = |[a, b, c]: [Vec2; 3]| (b - a).perp_dot(c - a).abs();
        self.scale = (area(self.places) / area(places).max(1e-12)).sqrt();
        self.fabric = std::array::from_fn(|k| places[k] * self.nearness[k]);
        self
    }

    /// True when its front is seen: the side on which its corners are counter-clockwise.
    pub(super) fn is_front(&self) -> bool {
        self.front
    }

    /// The lightness of a plain weave of threads 4 mm wide, about 1; threads that the picture has
    /// no samples for blur into it.
    #[inline]
    pub(super) fn weave(&self, weights: Vec3A, nearness: f32) -> f32 {
        const THREAD: f32 = 0.004;
        const DEPTH: f32 = 0.24;
        let clear = (THREAD * self.scale * 0.2 - 0.6).clamp(0.0, 1.0);
        if clear == 0.0 {
            return 1.0;
        }
        let [a, b, c] = self.fabric;
        let [u, v, w] = weights.to_array();
        let place = (a * u + b * v + c * w) / (nearness * THREAD);
        let cell = place.floor();
        let is_warp = (cell.x + cell.y).rem_euclid(2.0) < 0.5;
        let across = if is_warp { place.x - cell.x } else { place.y - cell.y };
        // A thread is round: lightest in the middle; a parabola whose mean is 2/3.
        let height = 4.0 * across * (1.0 - across) - 2.0 / 3.0;
        1.0 + DEPTH * clear * height
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

    /// The surface at `weights`, seen from its visible side, in the light of `sun`.
    #[inline]
    pub(super) fn point_at(&self, weights: Vec3A, nearness: f32, sun: &Sun) -> Point {
        let sign = if self.front { 1.0 } else { -1.0 };
        let [u, v, w] = weights.to_array();
        let mix = |[a, b, c]: [Vec3A; 3]| a * u + b * v + c * w;
        let normal = mix(self.normals);
        // Three opposite normals could cancel: the floor of the length keeps this finite.
        let normal = normal * (sign * normal.length_squared().max(1e-20).sqrt().recip());
        Point {
            normal,
            sun: sun.open(mix(self.lit) / nearness, normal),
            relief: sign * weights.dot(self.relief),
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

//! The backdrop: a soft wall that runs into a floor, and the shadow that the cloth
//! throws onto it.
//!
//! The wall and the floor depend on the camera alone and are computed once. The shadow is drawn
//! into a small map of the floor, blurred three times by a box (nearly a Gaussian), and looked up
//! where a pixel sees the floor. What touches the floor throws a second shadow, darker and less
//! blurred.

use glam::{Vec2, Vec3, Vec3A};

use crate::Rgb;
use crate::image::colour::{Linear16, to_linear, to_linear16};
use crate::raster::stage::{Stage, cast};

const WALL_TOP: Rgb = [236, 238, 242];
const HORIZON: Rgb = [250, 249, 247];
const FLOOR_NEAR: Rgb = [222, 221, 222];
/// The part of the light that the middle of a full shadow takes away.
const SHADOW_DEPTH: f32 = 0.5;
/// Cells along the longer side of the shadow map.
const CELLS: usize = 288;
/// Radius of each of the three boxes, in cells; and of what touches the floor.
const BLUR_RADIUS: usize = 8;
const TOUCH_RADIUS: usize = 5;
/// Height up to which a thing touches the floor, in cells.
const TOUCH: f32 = 14.0;

/// The picture without the cloth, in linear light, and the place of the floor in each pixel.
#[derive(Clone, Debug)]
pub(crate) struct Backdrop {
    colours: Vec<Linear16>,
    /// Place in the shadow map `[cells]`; NaN where the pixel sees no part of it.
    places: Vec<Vec2>,
    shadow: ShadowMap,
}

impl Backdrop {
    pub(crate) fn new(stage: &Stage, size: [u32; 2]) -> Self {
        let [width, height] = size;
        let shadow = ShadowMap::new(stage);
        let count = width as usize * height as usize;
        let mut colours = Vec::with_capacity(count);
        let mut places = Vec::with_capacity(count);
        for row in 0..height {
            let y = (row as f32 + 0.5) / height as f32;
            for column in 0..width {
                let x = (column as f32 + 0.5) / width as f32;
                let ray = stage.camera.ray(x, y);
                colours.push(to_linear16(wall_and_floor(stage, ray)));
                places.push(shadow.place_seen(stage, ray));
            }
        }
        Self {
            colours,
            places,
            shadow,
        }
    }

    /// Casts the shadow of the faces of a frame `[m]`.
    pub(crate) fn cast_shadow(&mut self, faces: &[[Vec3; 3]]) {
        self.shadow.update(faces);
    }

    /// The colour of a pixel, in linear light.
    #[inline]
    pub(crate) fn colour(&self, pixel: usize) -> Linear16 {
        let colour = self.colours[pixel];
        let place = self.places[pixel];
        if place.x.is_nan() {
            return colour;
        }
        let dark = self.shadow.at(place);
        if dark <= 0.0 {
            return colour;
        }
        let left = 1.0 - SHADOW_DEPTH * dark;
        colour.map(|channel| (f32::from(channel) * left) as u16)
    }
}

/// The wall and the floor meet in a curve: the colour depends on the slope of the ray alone, and on
/// a pool of light around the middle of the picture.
fn wall_and_floor(stage: &Stage, ray: Vec3) -> Vec3A {
    let ray = ray.normalize_or_zero();
    let [top, horizon, near] = [WALL_TOP, HORIZON, FLOOR_NEAR].map(to_linear);
    let colour = if ray.y >= 0.0 {
        horizon.lerp(top, smooth(ray.y / 0.30))
    } else {
        horizon.lerp(near, smooth(-ray.y / 0.55))
    };
    let aside = ray.cross(stage.camera.backward).length_squared();
    (colour * (1.0 - 0.55 * aside)).into()
}

fn smooth(share: f32) -> f32 {
    let t = share.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The darkness of the floor, on a grid of square cells.
#[derive(Clone, Debug)]
struct ShadowMap {
    origin: Vec2,
    cell: f32,
    size: [usize; 2],
    light: Vec3,
    floor: f32,
    dark: Vec<f32>,
    /// The darkness of what touches the floor.
    touch: Vec<f32>,
    scratch: Vec<f32>,
}

impl ShadowMap {
    fn new(stage: &Stage) -> Self {
        let extent = stage.shadow_high - stage.shadow_low;
        let border = 3 * BLUR_RADIUS + 2;
        let cell = (extent.max_element() / (CELLS - 2 * border) as f32).max(1e-5);
        let cells = |length: f32| ((length / cell).ceil() as usize + 2 * border).min(CELLS + 2);
        let size = [cells(extent.x), cells(extent.y)];
        Self {
            origin: stage.shadow_low - Vec2::splat(border as f32 * cell),
            cell,
            size,
            light: stage.shadow_light,
            floor: stage.floor,
            dark: vec![0.0; size[0] * size[1]],
            touch: vec![0.0; size[0] * size[1]],
            scratch: vec![0.0; size[0] * size[1]],
        }
    }

    /// The place in the map `[cells]` where `ray` meets the floor, or NaN.
    fn place_seen(&self, stage: &Stage, ray: Vec3) -> Vec2 {
        let eye = stage.camera.position;
        let reach = (self.floor - eye.y) / ray.y;
        let met = eye + reach * ray;
        let place = (Vec2::new(met.x, met.z) - self.origin) / self.cell;
        let last = Vec2::new(self.size[0] as f32 - 1.0, self.size[1] as f32 - 1.0);
        let inside = reach > 0.0 && place.cmpge(Vec2::ZERO).all() && place.cmplt(last).all();
        if inside { place } else { Vec2::NAN }
    }

    fn update(&mut self, faces: &[[Vec3; 3]]) {
        self.dark.fill(0.0);
        self.touch.fill(0.0);
        for face in faces {
            let corners = face.map(|corner| {
                let place = cast(corner, self.light, self.floor);
                (place - self.origin) / self.cell
            });
            let height = face.map(|corner| corner.y - self.floor);
            let height = height.into_iter().fold(f32::MAX, f32::min) / self.cell;
            self.fill_triangle(corners, (1.0 - height / TOUCH).clamp(0.0, 1.0));
        }
        for _ in 0..3 {
            blur(&mut self.dark, &mut self.scratch, self.size, BLUR_RADIUS);
            blur(&mut self.touch, &mut self.scratch, self.size, TOUCH_RADIUS);
        }
        for (dark, touch) in self.dark.iter_mut().zip(&self.touch) {
            *dark += (1.0 - *dark) * 0.6 * touch;
        }
    }

    /// Darkens the cells whose middle lies in a triangle, and those under its corners, so that a
    /// sheet seen edge-on by the light still throws a line. `touch` is the part that touches.
    fn fill_triangle(&mut self, corners: [Vec2; 3], touch: f32) {
        let [a, b, c] = corners;
        let width = self.size[0];
        let mut darken = |x: usize, y: usize| {
            let at = y * width + x;
            self.dark[at] = 1.0;
            self.touch[at] = self.touch[at].max(touch);
        };
        let last = Vec2::new(width as f32 - 1.0, self.size[1] as f32 - 1.0);
        for corner in corners {
            let corner = corner.clamp(Vec2::ZERO, last);
            darken(corner.x.round() as usize, corner.y.round() as usize);
        }
        let low = a.min(b).min(c).clamp(Vec2::ZERO, last).ceil();
        let high = a.max(b).max(c).clamp(Vec2::ZERO, last).floor();
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let p = Vec2::new(x as f32, y as f32);
                let sides = [(a, b), (b, c), (c, a)].map(|(s, e)| (e - s).perp_dot(p - s));
                let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
                if inside {
                    darken(x, y);
                }
            }
        }
    }

    /// Bilinear look-up at `place` `[cells]`, which lies inside the map.
    #[inline]
    fn at(&self, place: Vec2) -> f32 {
        let (x, y) = (place.x as usize, place.y as usize);
        let share = place - Vec2::new(x as f32, y as f32);
        let first = y * self.size[0] + x;
        let second = first + self.size[0];
        let above = self.dark[first] + (self.dark[first + 1] - self.dark[first]) * share.x;
        let below = self.dark[second] + (self.dark[second + 1] - self.dark[second]) * share.x;
        above + (below - above) * share.y
    }
}

/// Replaces each cell by the mean of a square box of this `radius` around it.
fn blur(dark: &mut [f32], scratch: &mut [f32], [width, height]: [usize; 2], radius: usize) {
    for row in 0..height {
        let line = row * width..(row + 1) * width;
        blur_line(&dark[line.clone()], &mut scratch[line], [1, width], radius);
    }
    for column in 0..width {
        blur_line(
            &scratch[column..],
            &mut dark[column..],
            [width, height],
            radius,
        );
    }
}

/// Moving mean over `count` entries that lie `stride` apart; nothing lies outside.
fn blur_line(from: &[f32], to: &mut [f32], [stride, count]: [usize; 2], radius: usize) {
    let weight = 1.0 / (2 * radius + 1) as f32;
    let mut sum: f32 = (0..radius.min(count)).map(|k| from[k * stride]).sum();
    for k in 0..count {
        if k + radius < count {
            sum += from[(k + radius) * stride];
        }
        // What rounding leaves of a sum that was subtracted again must not tint the floor.
        to[k * stride] = if sum > 1e-4 { sum * weight } else { 0.0 };
        if k >= radius {
            sum -= from[(k - radius) * stride];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Run;
    use selvedge_cloth::Topology;

    #[test]
    fn a_moving_mean_keeps_the_sum_and_spreads_it_evenly() {
        let mut line = vec![0.0; 40];
        line[20] = 9.0;
        let mut blurred = vec![0.0; 40];
        blur_line(&line, &mut blurred, [1, 40], 4);
        for (k, &value) in blurred.iter().enumerate() {
            let expected = if (16..=24).contains(&k) { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-6, "{k}: {value}");
        }
    }

    #[test]
    fn the_shadow_lies_where_the_light_throws_it() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let corners = [
            Vec3::new(-1.0, 1.0, -1.0),
            Vec3::new(-1.0, 1.0, 1.0),
            Vec3::new(1.0, 1.5, 0.0),
        ];
        let run = Run::new(&topology, [&corners[..]], &[], 60.0).unwrap();
        let stage = Stage::of_runs(&[&run], crate::View::default(), 1.0).unwrap();
        let mut shadow = ShadowMap::new(&stage);
        shadow.update(&[corners]);
        let place = |point| (cast(point, shadow.light, shadow.floor) - shadow.origin) / shadow.cell;
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        // The blurs reach 24 cells; the centre lies farther inside, a place 0.9 m aside outside.
        assert!((shadow.at(place(centre)) - 1.0).abs() < 1e-3);
        assert_eq!(shadow.at(place(Vec3::new(0.9, 1.0, 0.9))), 0.0);
    }

    #[test]
    fn what_stands_on_the_floor_throws_a_darker_and_sharper_shadow_than_what_hangs() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, z)| Vec3::new(x, 0.3, z));
        let run = Run::new(&topology, [&corners[..]], &[], 60.0).unwrap();
        let stage = Stage::of_runs(&[&run], crate::View::default(), 1.0).unwrap();
        let mut shadow = ShadowMap::new(&stage);
        let mut sum_and_most = |height: f32| {
            let face = corners.map(|p| Vec3::new(0.2 * p.x, shadow.floor + height, 0.2 * p.z));
            shadow.update(&[face]);
            let most = shadow.dark.iter().copied().fold(0.0, f32::max);
            (shadow.dark.iter().sum::<f32>(), most)
        };
        let ([standing, dark], [hanging, pale]) =
            (sum_and_most(0.0).into(), sum_and_most(0.3).into());
        // The middle touches in full, which takes six tenths of the light that is left.
        assert!(dark > pale + 0.5 * (1.0 - pale), "{dark} {pale}");
        assert!(standing > hanging);
    }
}

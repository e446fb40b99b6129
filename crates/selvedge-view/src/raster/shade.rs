//! Light on cloth, in linear light: a warm key from the upper left of the viewer, a faint cool fill
//! from the right, a sky, a satin highlight and a trace of light at grazing angles.
//!
//! The key light falls only where the rest of the cloth leaves it free, and a little of it comes
//! through from the far side. Ridges are lighter than valleys. The lights hang on the camera, so
//! that a cloth is lit alike from everywhere. A point whose normal looks away is the back of the
//! cloth: it has the back's tint and the turned normal.

use glam::{Mat4, Vec3, Vec3A, Vec4};

use crate::Rgb;
use crate::image::colour::{to_linear, value_table};
use crate::raster::camera::Camera;

/// Indigo warp in front, ecru weft at the back. The page has the same: `web/src/theme.ts`.
const FRONT: Rgb = [58, 96, 158];
const BACK: Rgb = [214, 194, 160];
/// Bodies beside the cloth: neutral, as no cloth is.
const BODY: Rgb = [170, 168, 165];
/// The border of a cloth that is coloured by numbers: no hue that could be read as one.
const VALUE_BORDER: Rgb = [52, 52, 60];
pub(crate) const HANDLE: Rgb = [236, 124, 36];
/// Around handles.
pub(crate) const HANDLE_RING: Rgb = [255, 252, 246];

/// Light of the key, warm; of the fill from the other side, cool; and of the whole sky.
const KEY_LIGHT: Vec3A = Vec3A::new(1.42, 1.35, 1.24);
const FILL_LIGHT: Vec3A = Vec3A::new(0.20, 0.24, 0.30);
const SKY_LIGHT: Vec3A = Vec3A::new(0.68, 0.74, 0.86);

/// A point of the surface, as the shader needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    /// Unit normal, towards the viewer's side of the surface.
    pub(crate) normal: Vec3A,
    /// The part of the key light that reaches the point past the rest of the cloth, in [0, 1].
    pub(crate) sun: f32,
    /// In about [-1, 1], positive on a ridge of the visible side.
    pub(crate) relief: f32,
}

/// The tints and lights of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Shader {
    key: Vec3A,
    /// Takes a normal to its cosines with key, fill, eye and half-way vector: all in one product.
    cosines: Mat4,
    front: Vec3A,
    back: Vec3A,
    body: Vec3A,
    pub(crate) value_border: Vec3A,
}

impl Shader {
    pub(crate) fn new(camera: &Camera) -> Self {
        let [eye, right] = [camera.backward, camera.right].map(Vec3A::from);
        let level = Vec3A::new(eye.x, 0.0, eye.z).normalize_or(eye);
        let key = (-0.85 * right + 0.75 * Vec3A::Y + 0.12 * level).normalize();
        let fill = (0.9 * right + 0.1 * Vec3A::Y + 0.35 * level).normalize();
        let half = (key + eye).normalize_or(eye);
        let rows = [key, fill, eye, half].map(|direction| direction.extend(0.0));
        Self {
            key,
            cosines: Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(),
            front: to_linear(FRONT).into(),
            back: to_linear(BACK).into(),
            body: to_linear(BODY).into(),
            value_border: to_linear(VALUE_BORDER).into(),
        }
    }

    /// Takes the colour of a cloth, or the usual ones. Its back is half as far from ecru as its front.
    pub(crate) fn dye(&mut self, colour: Option<Rgb>) {
        let ecru = Vec3A::from(to_linear(BACK));
        (self.front, self.back) = match colour {
            None => (to_linear(FRONT).into(), ecru),
            Some(colour) => {
                let front = Vec3A::from(to_linear(colour));
                (front, front.midpoint(ecru))
            }
        };
    }

    /// The tint of a side of the cloth.
    pub(crate) fn side(&self, front: bool) -> Vec3A {
        if front { self.front } else { self.back }
    }

    /// Unit vector towards the key light.
    pub(crate) fn towards_sun(&self) -> Vec3 {
        self.key.into()
    }

    /// Light that a tint of the cloth sends to the viewer.
    #[inline]
    pub(crate) fn cloth(&self, tint: Vec3A, point: Point) -> Vec3A {
        let [x, y, z] = point.normal.to_array();
        let cosines: Vec4 =
            self.cosines.x_axis * x + self.cosines.y_axis * y + self.cosines.z_axis * z;
        // A little of the light that falls on the far side comes through.
        let through = (-cosines.x).max(0.0) * point.sun;
        let [key, fill, eye, half] = cosines.max(Vec4::ZERO).to_array();
        let key = key * point.sun;
        let sky = 0.5 + 0.5 * y;
        let shelter = (1.0 + 1.5 * point.relief).clamp(0.25, 1.6);
        let light = KEY_LIGHT * (key * (0.6 + 0.4 * shelter) + 0.16 * through)
            + FILL_LIGHT * fill
            + SKY_LIGHT * ((0.25 + 0.3 * sky) * shelter);
        let grazing = 1.0 - eye;
        let sheen = 0.12 * grazing * grazing * grazing;
        let satin = 0.09 * power16(half) * key;
        tint * light + Vec3A::splat(sheen * (0.25 + key) + satin)
    }

    /// Light that a body beside the cloth sends to the viewer, matte.
    #[inline]
    pub(crate) fn body(&self, Point { normal, sun, .. }: Point) -> Vec3A {
        let [x, y, z] = normal.to_array();
        let cosines: Vec4 =
            self.cosines.x_axis * x + self.cosines.y_axis * y + self.cosines.z_axis * z;
        let [key, fill, _, _] = cosines.max(Vec4::ZERO).to_array();
        let sky = 0.25 + 0.3 * (0.5 + 0.5 * y);
        self.body * (KEY_LIGHT * (key * sun) + FILL_LIGHT * fill + SKY_LIGHT * sky)
    }

    /// Light of a colour that stands for a number: shaded only so far that folds still show.
    #[inline]
    pub(crate) fn value(&self, tint: Vec3A, point: Point) -> Vec3A {
        let key = point.normal.dot(self.key).max(0.0) * point.sun;
        let shelter = (1.0 + point.relief).clamp(0.5, 1.3);
        tint * ((0.45 + 0.55 * key) * shelter)
    }
}

#[inline]
fn power16(base: f32) -> f32 {
    let square = base * base;
    let fourth = square * square;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// The colours of the values of a field, in linear light at 256 steps of its range.
#[derive(Clone, Debug)]
pub(crate) struct ValueColours {
    table: Vec<Vec3A>,
    low: f32,
    per_step: f32,
}

impl ValueColours {
    pub(crate) fn new(range: [f32; 2]) -> Self {
        let [low, high] = range;
        Self {
            table: value_table(),
            low,
            per_step: 255.0 / (high - low),
        }
    }

    #[inline]
    pub(crate) fn tint(&self, value: f32) -> Vec3A {
        let step = (value - self.low) * self.per_step + 0.5;
        self.table[(step as usize).min(255)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::camera::View;

    #[test]
    fn values_outside_the_range_take_the_colours_of_its_ends() {
        let colours = ValueColours::new([2.0, 4.0]);
        let table = value_table();
        assert_eq!(colours.tint(-9.0), table[0]);
        assert_eq!(colours.tint(4.0), table[255]);
        assert_eq!(colours.tint(1e30), table[255]);
    }

    #[test]
    fn a_surface_that_faces_the_key_light_is_brighter_than_one_that_faces_away() {
        let shader = Shader::new(&View::default().fit([Vec3::ZERO], 1.0));
        let lit = |normal: Vec3A| {
            let point = Point {
                normal,
                sun: 1.0,
                relief: 0.0,
            };
            let cloth = shader.cloth(shader.front, point);
            let value = shader.value(Vec3A::ONE, point);
            [cloth.element_sum(), value.element_sum()]
        };
        let (bright, dark) = (lit(shader.key), lit(-shader.key));
        assert!(bright[0] > dark[0] && bright[1] > dark[1]);
    }
}

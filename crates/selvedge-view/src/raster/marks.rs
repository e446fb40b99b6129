//! Marks over the cloth: its border, its handles, and the way that each handle has just come.

use glam::{Vec2, Vec3, Vec3A};
use selvedge_cloth::{Topology, VertexId};

use super::camera::Camera;
use super::samples::Samples;
use super::shade::{HANDLE, HANDLE_RING, Shader, TRAIL};
use super::triangle::ScreenVertex;
use crate::Rgb;
use crate::image::colour::{Linear16, to_linear, to_linear16};

/// Width of the border, radius of handles, and width of a trail at the handle `[pixels]`, on a
/// picture 480 pixels high.
const BORDER_WIDTH: f32 = 2.4;
const HANDLE_RADIUS: f32 = 4.6;
const TRAIL_WIDTH: f32 = 6.0;
/// A handle shows through cloth that hides it by less than this part of its distance.
const HANDLE_LIFT: f32 = 0.01;
/// The border, likewise: enough to stand on its own cloth, too little to show through a fold.
const BORDER_LIFT: f32 = 0.002;

/// Draws marks of one width of lines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Marker {
    /// Samples per pixel of line width.
    pub(crate) scale: f32,
}

/// An end of a line on the screen, with the width of the line there `[samples]`.
#[derive(Clone, Copy, Debug)]
struct LineEnd {
    place: Vec2,
    nearness: f32,
    width: f32,
}

impl Marker {
    /// The farthest that a mark reaches from its vertices `[samples]`.
    pub(crate) fn reach(self) -> f32 {
        HANDLE_RADIUS * self.scale
    }

    /// Draws the boundary edges over the cloth.
    pub(crate) fn draw_border(
        self,
        samples: &mut Samples,
        topology: &Topology,
        vertices: &[ScreenVertex],
        shader: &Shader,
        tint: Vec3A,
    ) {
        for edge in topology.edges().iter().filter(|edge| edge.is_boundary()) {
            let [from, to] = edge.vertices.map(|vertex| vertices[vertex.index()]);
            let normal = (from.normal + to.normal).normalize_or_zero();
            let point = shader.facing(normal, 0.5 * (from.sun + to.sun));
            let light = to_linear16(shader.cloth(tint, point));
            let ends = [from, to].map(|end| LineEnd {
                place: end.place,
                nearness: end.nearness * (1.0 + BORDER_LIFT),
                width: BORDER_WIDTH * self.scale,
            });
            draw_line(samples, ends, light);
        }
    }

    /// Draws a disc in a ring over each handle.
    pub(crate) fn draw_handles(
        self,
        samples: &mut Samples,
        handles: &[VertexId],
        vertices: &[ScreenVertex],
    ) {
        let radius = HANDLE_RADIUS * self.scale;
        let [ring, disc] = [HANDLE_RING, HANDLE].map(flat);
        for handle in handles {
            let vertex = vertices[handle.index()];
            let nearness = vertex.nearness * (1.0 + HANDLE_LIFT);
            samples.fill_near([vertex.place; 3], radius, |sample| {
                let distance = sample.distance(vertex.place);
                let light = if distance <= 0.7 * radius { disc } else { ring };
                (distance <= radius && nearness > 0.0).then_some((nearness, light))
            });
        }
    }

    /// Draws a line along `way` `[m]`, from the oldest place of a handle to the present one; it
    /// grows from nothing to its full width.
    pub(crate) fn draw_trail(self, samples: &mut Samples, camera: &Camera, way: &[Vec3]) {
        let [width, height] = samples.extent().map(|side| side as f32);
        let light = flat(TRAIL);
        let last = way.len().saturating_sub(1).max(1) as f32;
        let ends = way.iter().enumerate().map(|(number, &place)| {
            let seen = camera.project(place);
            let ahead = seen.depth > 1e-6;
            LineEnd {
                place: Vec2::new(seen.x * width, seen.y * height),
                nearness: if ahead { seen.depth.recip() } else { 0.0 },
                width: TRAIL_WIDTH * self.scale * number as f32 / last,
            }
        });
        let ends: Vec<LineEnd> = ends.collect();
        for pair in ends.windows(2) {
            draw_line(samples, [pair[0], pair[1]], light);
        }
    }
}

/// A colour that is not lit.
fn flat(colour: Rgb) -> Linear16 {
    to_linear16(to_linear(colour).into())
}

/// Draws a line with round ends; none where an end is behind the camera.
fn draw_line(samples: &mut Samples, ends: [LineEnd; 2], light: Linear16) {
    let [from, to] = ends;
    if from.nearness <= 0.0 || to.nearness <= 0.0 {
        return;
    }
    let along = to.place - from.place;
    let stretch = along.length_squared().max(f32::MIN_POSITIVE).recip();
    let reach = 0.5 * from.width.max(to.width);
    samples.fill_near([from.place, to.place, to.place], reach, |sample| {
        let share = ((sample - from.place).dot(along) * stretch).clamp(0.0, 1.0);
        let off = sample.distance_squared(from.place + share * along);
        let nearness = from.nearness + share * (to.nearness - from.nearness);
        let radius = 0.5 * (from.width + share * (to.width - from.width));
        (off <= radius * radius).then_some((nearness, light))
    });
}

//! Marks over the cloth: its hems and its handles.

use glam::Vec3A;
use selvedge_cloth::{Topology, VertexId};

use super::samples::Samples;
use super::shade::{HANDLE, HANDLE_RING, Point, Shader};
use super::sun::Sun;
use super::triangle::ScreenVertex;
use crate::Rgb;
use crate::image::colour::{Linear16, to_linear, to_linear16};

/// Width of the hem and radius of handles `[pixels]`, on a picture 480 pixels high.
const BORDER_WIDTH: f32 = 1.3;
const HANDLE_RADIUS: f32 = 3.6;
/// A hem is this much lighter than the side of the cloth that it is seen on.
const HEM: f32 = 1.18;
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

impl Marker {
    /// The farthest that a mark reaches from its vertices `[samples]`.
    pub(crate) fn reach(self) -> f32 {
        HANDLE_RADIUS * self.scale
    }

    /// Draws the boundary edges over the cloth: in `tint`, or as hems.
    pub(crate) fn draw_border(
        self,
        samples: &mut Samples,
        topology: &Topology,
        vertices: &[ScreenVertex],
        (shader, sun): (&Shader, &Sun),
        tint: Option<Vec3A>,
    ) {
        for (number, edge) in topology.edges().iter().enumerate() {
            if !edge.is_boundary() {
                continue;
            }
            let [from, to] = edge.vertices.map(|vertex| vertices[vertex.index()]);
            let middle = vertices[topology.vertex_count() + number];
            let front = middle.facing > 0.0;
            let normal = if front { middle.normal } else { -middle.normal };
            let point = Point {
                normal,
                sun: sun.open(middle.lit, normal),
                relief: 0.0,
            };
            let own = HEM * shader.side(front);
            let light = to_linear16(shader.cloth(tint.unwrap_or(own), point));
            for ends in [[from, middle], [middle, to]] {
                draw_line(samples, ends, 0.5 * BORDER_WIDTH * self.scale, light);
            }
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
}

/// A colour that is not lit.
fn flat(colour: Rgb) -> Linear16 {
    to_linear16(to_linear(colour).into())
}

/// Draws a line of this `radius` with round ends, lifted off its cloth; none where an end is behind
/// the camera.
fn draw_line(samples: &mut Samples, ends: [ScreenVertex; 2], radius: f32, light: Linear16) {
    let [from, to] = ends;
    let [near, far] = ends.map(|end| end.nearness * (1.0 + BORDER_LIFT));
    if near <= 0.0 || far <= 0.0 {
        return;
    }
    let along = to.place - from.place;
    let stretch = along.length_squared().max(f32::MIN_POSITIVE).recip();
    samples.fill_near([from.place, to.place, to.place], radius, |sample| {
        let share = ((sample - from.place).dot(along) * stretch).clamp(0.0, 1.0);
        let off = sample.distance_squared(from.place + share * along);
        (off <= radius * radius).then_some((near + share * (far - near), light))
    });
}

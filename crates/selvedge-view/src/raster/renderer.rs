//! A z-buffered triangle raster: one frame of a run in front of its backdrop, as an [`Image`].
//!
//! Triangles are filled at `n × n` samples per pixel with barycentric weights
//! bᵢ = area(opposite edge, p) / area; 1/depth is linear in them, and so is anything times 1/depth,
//! which makes the interpolation of normals and values perspective. Samples are averaged in linear
//! light. Triangles that reach behind the camera are left out. A face of cloth is drawn as four, over
//! its corners and the middles of its bowed edges.

use glam::{Vec2, Vec3};
use selvedge_cloth::Topology;

use super::backdrop::Backdrop;
use super::camera::Camera;
use super::marks::Marker;
use super::props::Props;
use super::samples::Samples;
use super::shade::{Shader, ValueColours};
use super::stage::Stage;
use super::sun::Sun;
use super::surface::{Surface, bowed};
use super::triangle::{ScreenVertex, Triangle};
use crate::image::check_size;
use crate::motion::panel::check_panels;
use crate::{Image, Panel, ViewError};

/// The quarters of a face, over its corners (0) and the middles of its edges (1): `[1, k]` lies
/// between corners `k` and `k + 1`.
const QUARTERS: [[[usize; 2]; 3]; 4] = [
    [[0, 0], [1, 0], [1, 2]],
    [[1, 0], [0, 1], [1, 1]],
    [[1, 2], [1, 1], [0, 2]],
    [[1, 0], [1, 1], [1, 2]],
];

/// Longest edge of a body's face, as a part of how far away the camera is.
const LONGEST: f32 = 0.2;

/// Draws frames of one size from one stage; keeps its buffers between frames.
#[derive(Clone, Debug)]
pub struct Renderer {
    camera: Camera,
    shader: Shader,
    backdrop: Backdrop,
    size: [u32; 2],
    factor: u32,
    surface: Surface,
    sun: Sun,
    props: Props,
    /// Distance from the camera to the middle of what it sees on the floor `[m]`.
    distance: f32,
    /// The vertices, then the middles of the edges, `[vertices + edges]`.
    vertices: Vec<ScreenVertex>,
    samples: Samples,
}

impl Renderer {
    /// A renderer of pictures of `size` (width, height) `[pixels]`, with so many samples along each
    /// side of a pixel: 1 for a draft, 2 as a rule, 4 for stills.
    pub fn new(stage: &Stage, size: [u32; 2], samples: u32) -> Result<Self, ViewError> {
        check_size("picture", size)?;
        let sides = size.map(|side| side.saturating_mul(samples));
        check_size("supersampled picture", sides)?;
        let shader = Shader::new(&stage.camera);
        Ok(Self {
            camera: stage.camera,
            backdrop: Backdrop::new(stage, size),
            size,
            factor: samples,
            surface: Surface::default(),
            sun: Sun::new(shader.towards_sun()),
            shader,
            props: Props::default(),
            distance: distance_to(stage),
            vertices: Vec::new(),
            samples: Samples::new(size, samples),
        })
    }

    /// Draws one frame of a panel (without its label).
    pub fn render(&mut self, panel: &Panel<'_>, frame: usize) -> Result<Image, ViewError> {
        check_panels(std::slice::from_ref(panel))?;
        let frames = panel.run.frames();
        let Some(&positions) = frames.get(frame) else {
            return Err(ViewError::no_frame(frame, frames.len()));
        };
        self.shader.dye(panel.run.colour);
        let (topology, field) = (panel.run.topology(), panel.field);
        let values = field.map(|field| field.values()[frame].as_slice());
        let colours = field.map(|field| ValueColours::new(field.range()));

        self.surface.update(topology, positions);
        let longest = LONGEST * self.distance;
        self.props.update(panel.run.props(), frame, longest);
        let cloth = topology.faces().iter();
        let cloth = cloth.map(|face| face.map(|vertex| positions[vertex.index()]));
        let faces: Vec<[Vec3; 3]> = cloth.chain(self.props.faces.iter().copied()).collect();
        self.sun.update(&faces);
        self.backdrop.cast_shadow(&faces);
        self.place_vertices(topology, positions, values);
        let extent = self.samples.extent();
        self.props.place(&self.camera, &self.sun, extent);
        let scale = self.line_scale();
        let marker = Marker { scale };
        self.clear(marker.reach());
        self.fill_faces(topology, &panel.run.fabric, colours.as_ref());
        self.props.fill(&mut self.samples, &self.shader, &self.sun);
        let tint = field.map(|_| self.shader.value_border);
        let (samples, vertices) = (&mut self.samples, &self.vertices);
        marker.draw_border(samples, topology, vertices, (&self.shader, &self.sun), tint);
        marker.draw_handles(&mut self.samples, panel.run.handles(), &self.vertices);
        self.samples.resolve(&self.backdrop)
    }

    /// Empties the last picture, and bounds this one by the vertices.
    fn clear(&mut self, reach: f32) {
        let ahead = self.vertices.iter().filter(|v| v.nearness > 0.0);
        let places = ahead.map(|vertex| vertex.place).chain(self.props.places());
        self.samples.clear(places, reach);
    }

    fn place_vertices(&mut self, topology: &Topology, positions: &[Vec3], values: Option<&[f32]>) {
        let extent = self.samples.extent();
        let (normals, relief) = (&self.surface.normals, &self.surface.relief);
        let place = |position, normal| {
            let lit = self.sun.place(position);
            ScreenVertex::new(&self.camera, extent, position, normal, lit)
        };
        self.vertices.clear();
        for (vertex, &position) in positions.iter().enumerate() {
            self.vertices.push(ScreenVertex {
                relief: relief[vertex],
                value: values.map_or(0.0, |values| values[vertex]),
                ..place(position, normals[vertex])
            });
        }
        for edge in topology.edges() {
            let [a, b] = edge.vertices.map(|vertex| vertex.index());
            let (position, normal) = bowed([positions[a], positions[b]], [normals[a], normals[b]]);
            let [from, to] = [a, b].map(|end| self.vertices[end]);
            let mut middle = place(position, normal);
            if middle.nearness > 0.0 {
                // A valley is no deeper than its mesh: behind that there may be a body.
                let flat = self.camera.project(0.5 * (positions[a] + positions[b]));
                middle.nearness = middle.nearness.max(flat.depth.recip());
            }
            self.vertices.push(ScreenVertex {
                relief: 0.5 * (from.relief + to.relief),
                value: 0.5 * (from.value + to.value),
                ..middle
            });
        }
    }

    fn fill_faces(
        &mut self,
        topology: &Topology,
        fabric: &[[Vec2; 3]],
        colours: Option<&ValueColours>,
    ) {
        let (shader, sun) = (&self.shader, &self.sun);
        let first_edge = topology.vertex_count();
        for (number, face) in topology.faces().iter().enumerate() {
            let middles = topology.face_edges()[number].map(|edge| first_edge + edge.index());
            let points = [face.map(|vertex| vertex.index()), middles]
                .map(|points| points.map(|point| self.vertices[point]));
            let places = fabric
                .get(number)
                .map(|&[a, b, c]| [[a, b, c], [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)]]);
            for quarter in QUARTERS {
                let Some(triangle) = Triangle::new(quarter.map(|[of, k]| points[of][k])) else {
                    continue;
                };
                let triangle = match places {
                    Some(places) => triangle.on_fabric(quarter.map(|[of, k]| places[of][k])),
                    None => triangle,
                };
                let tint = shader.side(triangle.is_front());
                self.samples.fill(&triangle, |weights, nearness| {
                    let point = triangle.point_at(weights, nearness, sun);
                    match colours {
                        None => shader.cloth(tint * triangle.weave(weights, nearness), point),
                        Some(colours) => {
                            let tint = colours.tint(triangle.value_at(weights, nearness));
                            shader.value(tint, point)
                        }
                    }
                });
            }
        }
    }

    /// Samples per pixel of line width.
    fn line_scale(&self) -> f32 {
        let shorter = self.size[0].min(self.size[1]) as f32;
        (shorter / 480.0).clamp(0.6, 4.0) * self.factor as f32
    }
}

/// Distance from the camera to the middle of the shadows on the floor `[m]`.
fn distance_to(stage: &Stage) -> f32 {
    let middle = 0.5 * (stage.shadow_low + stage.shadow_high);
    let place = Vec3::new(middle.x, stage.floor, middle.y);
    stage.camera.position.distance(place).max(1e-3)
}

#[cfg(test)]
mod tests;

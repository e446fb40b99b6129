//! A z-buffered triangle raster: one frame of a run in front of its backdrop, as an [`Image`].
//!
//! Triangles are filled at `n × n` samples per pixel with barycentric weights
//! bᵢ = area(opposite edge, p) / area; 1/depth is linear in them, and so is anything times 1/depth,
//! which makes the interpolation of normals and values perspective. Samples are averaged in linear
//! light. Triangles that reach behind the camera are left out.

use glam::Vec3;
use selvedge_cloth::Topology;

use super::backdrop::Backdrop;
use super::camera::Camera;
use super::marks::Marker;
use super::props::Props;
use super::samples::Samples;
use super::shade::{Shader, ValueColours};
use super::stage::Stage;
use super::sun::Sun;
use super::surface::Surface;
use super::triangle::{ScreenVertex, Triangle};
use crate::image::check_size;
use crate::motion::panel::check_panels;
use crate::{Image, Panel, ViewError};

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
        self.shader.dye(panel.run.colour());
        let topology = panel.run.topology();
        let field = panel.field();
        let values = field.map(|field| field.values()[frame].as_slice());
        let colours = field.map(|field| ValueColours::new(field.range()));

        self.surface.update(topology, positions);
        self.props
            .update(panel.run.props(), frame, self.longest_face());
        self.sun.update(topology, positions, &self.props.faces);
        self.place_vertices(positions, values);
        self.props
            .place(&self.camera, &self.sun, self.samples.extent());
        self.backdrop
            .cast_shadow(topology, positions, &self.props.faces);
        let marker = Marker {
            scale: self.line_scale(),
        };
        self.clear(marker.reach());
        self.fill_faces(topology, colours.as_ref());
        self.props.fill(&mut self.samples, &self.shader);
        let tint = match field {
            None => self.shader.border,
            Some(_) => self.shader.value_border,
        };
        let (samples, vertices) = (&mut self.samples, &self.vertices);
        marker.draw_border(samples, topology, vertices, &self.shader, tint);
        marker.draw_handles(&mut self.samples, panel.run.handles(), &self.vertices);
        self.samples.resolve(&self.backdrop)
    }

    /// Empties the last picture, and bounds this one by the vertices.
    fn clear(&mut self, reach: f32) {
        let ahead = self.vertices.iter().filter(|v| v.nearness > 0.0);
        let vertices = ahead.map(|vertex| vertex.place);
        self.samples
            .clear(vertices.chain(self.props.places()), reach);
    }

    fn place_vertices(&mut self, positions: &[Vec3], values: Option<&[f32]>) {
        let extent = self.samples.extent();
        self.vertices.clear();
        for (vertex, &position) in positions.iter().enumerate() {
            let (normal, sun) = (self.surface.normals[vertex], self.sun.reach[vertex]);
            self.vertices.push(ScreenVertex {
                relief: self.surface.relief[vertex],
                value: values.map_or(0.0, |values| values[vertex]),
                ..ScreenVertex::new(&self.camera, extent, position, normal, sun)
            });
        }
    }

    fn fill_faces(&mut self, topology: &Topology, colours: Option<&ValueColours>) {
        let shader = &self.shader;
        for face in topology.faces() {
            let corners = face.map(|vertex| self.vertices[vertex.index()]);
            let Some(triangle) = Triangle::new(corners) else {
                continue;
            };
            match colours {
                None => {
                    let tint = triangle.tint(shader);
                    self.samples.fill(&triangle, |weights, _| {
                        shader.cloth(tint, triangle.point_at(weights))
                    });
                }
                Some(colours) => {
                    self.samples.fill(&triangle, |weights, nearness| {
                        let tint = colours.tint(triangle.value_at(weights, nearness));
                        shader.value(tint, triangle.point_at(weights))
                    });
                }
            }
        }
    }

    /// Longest edge of a body's face `[m]`: a part of how far away the camera is.
    fn longest_face(&self) -> f32 {
        0.2 * self.distance
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
    stage.camera.position().distance(place).max(1e-3)
}

#[cfg(test)]
mod tests;

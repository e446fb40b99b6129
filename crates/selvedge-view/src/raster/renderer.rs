//! A z-buffered triangle raster: one frame of a run in front of its backdrop, as an [`Image`].
//!
//! Triangles are filled at `n × n` samples per pixel with barycentric weights
//! bᵢ = area(opposite edge, p) / area; 1/depth is linear in them, and so is anything times 1/depth,
//! which makes the interpolation of normals and values perspective. The distance of a sample from
//! an edge, bᵢ · 2 area / length, draws the edge lines in the same pass. Samples are averaged in
//! linear light. Triangles that reach behind the camera are left out.

use std::ops::Range;

use glam::{Vec2, Vec3, Vec3A};
use selvedge_cloth::{Topology, VertexId};

use super::triangle::{Pen, ScreenVertex, Triangle, bounds};
use crate::image::check_size;
use crate::image::colour::{Encoder, Linear16, to_linear, to_linear16};
use crate::motion::run::check_panels;
use crate::raster::backdrop::Backdrop;
use crate::raster::camera::{Camera, Stage};
use crate::raster::shade::{HANDLE, HANDLE_RING, Shader, ValueColours};
use crate::raster::surface::Surface;
use crate::{Image, Panel, ViewError};

/// Samples along each side of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Supersampling {
    /// One sample per pixel: a draft.
    One,
    /// 2 × 2 samples.
    #[default]
    Two,
    /// 4 × 4 samples, for stills.
    Four,
}

impl Supersampling {
    fn factor(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }
}

/// Which edges of the mesh are drawn over the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EdgeLines {
    /// None.
    None,
    /// The border of the cloth.
    Border,
    /// The border, and faintly all other edges.
    #[default]
    All,
}

/// Draws frames of one size from one stage; keeps its buffers between frames.
#[derive(Clone, Debug)]
pub struct Renderer {
    camera: Camera,
    shader: Shader,
    backdrop: Backdrop,
    lines: EdgeLines,
    size: [u32; 2],
    factor: u32,
    encoder: Encoder,
    surface: Surface,
    vertices: Vec<ScreenVertex>,
    /// 1/depth of each sample `[1/m]`; 0 where no surface is.
    nearness: Vec<f32>,
    light: Vec<Linear16>,
    /// The columns and rows of samples that the last picture may have covered.
    touched: [Range<usize>; 2],
}

/// The border is this wide `[pixels]` on a picture 480 pixels high; handles have this radius.
const BORDER_WIDTH: f32 = 2.4;
const HANDLE_RADIUS: f32 = 4.6;
/// A handle shows through cloth that hides it by less than this part of its distance.
const HANDLE_LIFT: f32 = 0.01;
/// The border, likewise: enough to stand on its own cloth, too little to show through a fold.
const BORDER_LIFT: f32 = 0.002;

impl Renderer {
    /// A renderer of pictures of `size` (width, height) `[pixels]`.
    ///
    /// # Errors
    /// [`ViewError::Size`] or [`ViewError::TooManyPixels`] when it has no pixels, or more samples
    /// than an image may have pixels.
    pub fn new(
        stage: &Stage,
        size: [u32; 2],
        supersampling: Supersampling,
        lines: EdgeLines,
    ) -> Result<Self, ViewError> {
        check_size("picture", size)?;
        let factor = supersampling.factor();
        check_size("supersampled picture", size.map(|side| side * factor))?;
        let samples = size[0] as usize * size[1] as usize * (factor * factor) as usize;
        Ok(Self {
            camera: stage.camera,
            shader: Shader::new(&stage.camera),
            backdrop: Backdrop::new(stage, size),
            lines,
            size,
            factor,
            encoder: Encoder::new(),
            surface: Surface::default(),
            vertices: Vec::new(),
            nearness: vec![0.0; samples],
            light: vec![[0; 3]; samples],
            touched: [0..0, 0..0],
        })
    }

    /// Draws one frame of a panel (without its label).
    ///
    /// # Errors
    /// [`ViewError::FrameOutOfRange`], or what is wrong with the panel's values.
    pub fn render(&mut self, panel: &Panel<'_>, frame: usize) -> Result<Image, ViewError> {
        check_panels(std::slice::from_ref(panel))?;
        let frames = panel.run.frames();
        let Some(&positions) = frames.get(frame) else {
            return Err(ViewError::FrameOutOfRange {
                frame,
                frames: frames.len(),
            });
        };
        let topology = panel.run.topology();
        let field = panel.field();
        let values = field.map(|field| field.values()[frame].as_slice());
        let colours = field.map(|field| ValueColours::new(field.map(), field.range()));

        self.surface.update(topology, positions);
        self.place_vertices(positions, values);
        self.backdrop.cast_shadow(topology, positions);
        self.clear();
        self.fill_faces(topology, colours.as_ref());
        if self.lines != EdgeLines::None {
            let tint = match field {
                None => self.shader.border,
                Some(_) => self.shader.value_border,
            };
            self.fill_border(topology, tint);
        }
        self.fill_handles(panel.run.handles());
        self.resolve()
    }

    /// Empties what the last picture covered, and finds what this one may cover.
    fn clear(&mut self) {
        let [width, height] = self.size.map(|side| (side * self.factor) as usize);
        let [columns, rows] = self.touched.clone();
        for row in rows {
            let line = row * width;
            self.nearness[line + columns.start..line + columns.end].fill(0.0);
        }
        let reach = HANDLE_RADIUS * self.line_scale();
        let places = self.vertices.iter().filter(|v| v.nearness > 0.0);
        let (low, high) = places.fold((Vec2::MAX, Vec2::MIN), |(low, high), vertex| {
            (low.min(vertex.place), high.max(vertex.place))
        });
        self.touched = bounds([low, high, low], reach, width, height).unwrap_or([0..0, 0..0]);
    }

    fn place_vertices(&mut self, positions: &[Vec3], values: Option<&[f32]>) {
        let [width, height] = self.size.map(|side| (side * self.factor) as f32);
        self.vertices.clear();
        for (vertex, &position) in positions.iter().enumerate() {
            let seen = self.camera.project(position);
            let ahead = seen.depth > 1e-6;
            self.vertices.push(ScreenVertex {
                place: Vec2::new(seen.x * width, seen.y * height),
                nearness: if ahead { seen.depth.recip() } else { 0.0 },
                normal: self.surface.normals[vertex].into(),
                hollow: self.surface.hollow[vertex],
                value: values.map_or(0.0, |values| values[vertex]),
            });
        }
    }

    fn fill_faces(&mut self, topology: &Topology, colours: Option<&ValueColours>) {
        let pen = Pen {
            lines: self.lines,
            scale: self.line_scale(),
            factor: self.factor as f32,
        };
        for face in topology.faces() {
            let corners = face.map(|vertex| self.vertices[vertex.index()]);
            let Some(triangle) = Triangle::new(corners, pen) else {
                continue;
            };
            let shader = self.shader.clone();
            match colours {
                None => {
                    let side = triangle.side(&shader);
                    self.fill(&triangle, |weights, _| {
                        let tint = side.cloth.lerp(side.edge, triangle.line_at(weights));
                        shader.cloth(tint, triangle.point_at(weights))
                    });
                }
                Some(colours) => {
                    self.fill(&triangle, |weights, nearness| {
                        let tint = colours.tint(triangle.value_at(weights, nearness));
                        let left = 1.0 - 0.45 * triangle.line_at(weights);
                        shader.value(tint * left, triangle.point_at(weights))
                    });
                }
            }
        }
    }

    /// Pixels of line per pixel of [`EDGE_WIDTH`], in samples.
    fn line_scale(&self) -> f32 {
        let shorter = self.size[0].min(self.size[1]) as f32;
        (shorter / 480.0).clamp(0.6, 4.0) * self.factor as f32
    }

    /// Fills the samples of a triangle that are nearer than what is there with the light at their
    /// weights and nearness.
    #[inline]
    fn fill(&mut self, triangle: &Triangle, light: impl Fn(Vec3A, f32) -> Vec3A) {
        let [width, height] = self.size.map(|side| (side * self.factor) as usize);
        let Some([columns, rows]) = triangle.bounds(width, height) else {
            return;
        };
        for row in rows {
            let line = row * width;
            let start = triangle.weights(Vec2::new(0.5, row as f32 + 0.5));
            for column in triangle.span(start, &columns) {
                let weights = start + triangle.across * column as f32;
                if weights.min_element() < 0.0 {
                    continue;
                }
                let nearness = weights.dot(triangle.nearness);
                let at = line + column;
                if nearness > self.nearness[at] {
                    self.nearness[at] = nearness;
                    self.light[at] = to_linear16(light(weights, nearness));
                }
            }
        }
    }

    /// Draws the boundary edges as round-ended lines over the cloth.
    fn fill_border(&mut self, topology: &Topology, tint: Vec3A) {
        let radius = 0.5 * BORDER_WIDTH * self.line_scale();
        for edge in topology.edges().iter().filter(|edge| edge.is_boundary()) {
            let [from, to] = edge.vertices.map(|vertex| self.vertices[vertex.index()]);
            if from.nearness <= 0.0 || to.nearness <= 0.0 {
                continue;
            }
            let normal = (from.normal + to.normal).normalize_or_zero();
            let point = self.shader.facing(normal);
            let light = to_linear16(self.shader.cloth(tint, point));
            let along = to.place - from.place;
            let stretch = along.length_squared().max(f32::MIN_POSITIVE).recip();
            let places = [from.place, to.place, to.place];
            self.fill_near(places, radius, |sample| {
                let share = ((sample - from.place).dot(along) * stretch).clamp(0.0, 1.0);
                let off = sample.distance_squared(from.place + share * along);
                let nearness = from.nearness + share * (to.nearness - from.nearness);
                (off <= radius * radius).then_some((nearness * (1.0 + BORDER_LIFT), light))
            });
        }
    }

    /// Sets the samples within `reach` of a triangle for which `sample_at` gives a nearness that
    /// beats what is there.
    fn fill_near(
        &mut self,
        places: [Vec2; 3],
        reach: f32,
        sample_at: impl Fn(Vec2) -> Option<(f32, Linear16)>,
    ) {
        let [width, height] = self.size.map(|side| (side * self.factor) as usize);
        let Some([columns, rows]) = bounds(places, reach, width, height) else {
            return;
        };
        for row in rows {
            for column in columns.clone() {
                let sample = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let at = row * width + column;
                if let Some((nearness, light)) = sample_at(sample)
                    && nearness > self.nearness[at]
                {
                    self.nearness[at] = nearness;
                    self.light[at] = light;
                }
            }
        }
    }

    /// Draws a disc in a ring over each handle.
    fn fill_handles(&mut self, handles: &[VertexId]) {
        let radius = HANDLE_RADIUS * self.line_scale();
        let [ring, disc] =
            [HANDLE_RING, HANDLE].map(|colour| to_linear16(to_linear(colour).into()));
        for handle in handles {
            let vertex = self.vertices[handle.index()];
            let nearness = vertex.nearness * (1.0 + HANDLE_LIFT);
            self.fill_near([vertex.place; 3], radius, |sample| {
                let distance = sample.distance(vertex.place);
                let light = if distance <= 0.7 * radius { disc } else { ring };
                (distance <= radius && nearness > 0.0).then_some((nearness, light))
            });
        }
    }

    /// Averages the samples of each pixel; the empty ones show the backdrop.
    fn resolve(&self) -> Result<Image, ViewError> {
        let [width, height] = self.size;
        let mut image = Image::filled(width, height, [0; 3])?;
        let factor = self.factor as usize;
        let stride = width as usize * factor;
        let share = 1.0 / (factor * factor) as f32;
        let touched = self
            .touched
            .clone()
            .map(|samples| samples.start / factor..samples.end.div_ceil(factor));
        for (pixel, colour) in image.pixels_mut().iter_mut().enumerate() {
            let (row, column) = (pixel / width as usize, pixel % width as usize);
            let [columns, rows] = &touched;
            if !(rows.contains(&row) && columns.contains(&column)) {
                *colour = self.encoder.encode(self.backdrop.colour(pixel));
                continue;
            }
            let first = row * factor * stride + column * factor;
            let (mut sum, mut covered) = ([0_u32; 3], 0_u32);
            for line in 0..factor {
                let samples = first + line * stride..first + line * stride + factor;
                for at in samples {
                    if self.nearness[at] > 0.0 {
                        covered += 1;
                        for (total, channel) in sum.iter_mut().zip(self.light[at]) {
                            *total += u32::from(channel);
                        }
                    }
                }
            }
            let empty = self.factor * self.factor - covered;
            let behind = if empty > 0 {
                self.backdrop.colour(pixel)
            } else {
                [0; 3]
            };
            *colour = self.encoder.encode(std::array::from_fn(|channel| {
                let total = sum[channel] + empty * u32::from(behind[channel]);
                (total as f32 * share) as u16
            }));
        }
        Ok(image)
    }
}

#[cfg(test)]
mod tests;

//! Meshes made from numbers: irregular sheets (random, then relaxed; no grid lines) with evenly
//! spaced boundary vertices and all faces counter-clockwise, as the irregular meshes of Libao et
//! al.
//! 2023.
//!
//! A shape is an outline, and what its labels mean; the mesh comes from one routine for all
//! outlines. The same numbers give the same bytes on every machine.

mod boundary;
mod catalogue;
mod outline;
mod relax;
mod scatter;
mod shapes;
mod tube;

pub use self::catalogue::{NamedSheet, named_sheets};
use self::outline::{FlatSheet, sheet_from_outline};
pub use self::shapes::Shape;
use self::shapes::{Cut, Label};
use crate::Mesh;
use crate::error::{SceneError, must, require_positive};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most vertices that are made: a million take a minute or so.
const MOST_VERTICES: usize = 1_000_000;

/// The numbers of a sheet. A file may give a `density` `[vertices/m²]` instead of `vertices`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SheetFields")]
pub struct SheetSpec {
    /// Shape of the sheet.
    #[serde(rename = "kind")]
    pub shape: Shape,
    /// Number of vertices; the mesh has exactly so many.
    pub vertices: usize,
    /// The unit of length of the shape, as the side of a square or the height of a rectangle `[m]`.
    pub size: f64,
    /// Width of a rectangle, or the way around a tube `[m]`; none for other shapes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    /// Decides where the inner vertices lie, and the outline of a random shape.
    pub seed: u64,
}

/// [`SheetSpec`] as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SheetFields {
    kind: Shape,
    vertices: Option<usize>,
    density: Option<f64>,
    size: f64,
    width: Option<f64>,
    seed: u64,
}

impl TryFrom<SheetFields> for SheetSpec {
    type Error = String;

    fn try_from(fields: SheetFields) -> Result<Self, String> {
        let (shape, size, width) = (fields.kind, fields.size, fields.width);
        match (shape.has_width(), width) {
            (true, None) => {
                return Err("missing field: `width`, in m; `size` is the height".to_owned());
            }
            (false, Some(_)) => return Err("`width` is for a rectangle or a tube".to_owned()),
            _ => (),
        }
        let vertices = match (fields.vertices, fields.density) {
            (Some(vertices), None) => vertices,
            (None, Some(density)) if density.is_finite() && density > 0.0 => {
                // Of a rectangle as high as it is wide, and as large.
                let side = width.map_or(size, |width| (size * width).sqrt());
                shape.vertices(side, density)
            }
            (None, Some(density)) => {
                return Err(format!(
                    "density must be finite and positive, found {density} vertices/m²"
                ));
            }
            (Some(_), Some(_)) => return Err("give `vertices` or `density`, not both".to_owned()),
            (None, None) => return Err("missing field: `vertices` or `density`".to_owned()),
        };
        Ok(Self {
            shape,
            vertices,
            size,
            width,
            seed: fields.seed,
        })
    }
}

/// A mesh and the names of some of its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// The mesh, hanging flat.
    pub mesh: Mesh,
    /// Lists of vertices by what they are called.
    pub labels: BTreeMap<String, Vec<u32>>,
}

impl Sheet {
    /// The list of vertices of this name.
    ///
    /// # Errors
    /// [`SceneError`] names the lists that there are.
    ///
    /// ```
    /// let sheet = selvedge_cloth::generate::square(16, 1.0, 1)?;
    /// let error = sheet.label("left-edge").unwrap_err().to_string();
    /// assert!(error.contains("left-edge") && error.contains("upper-edge"), "{error}");
    /// # Ok::<(), selvedge_cloth::SceneError>(())
    /// ```
    pub fn label(&self, name: &str) -> Result<&[u32], SceneError> {
        let known = || self.labels.keys().cloned().collect::<Vec<_>>().join(", ");
        let found = self.labels.get(name).map(Vec::as_slice);
        found.ok_or_else(|| {
            must(
                "the label",
                &format!("one of {}", known()),
                format!("{name:?}"),
            )
        })
    }
}

/// A square sheet of exactly so many `vertices`, at least 4, and of sides of `size` `[m]`; `seed`
/// decides where the inner vertices lie. It hangs flat in the plane x = 0, its top edge at y = 0, its
/// material x axis u along z: (u, v) is at (0, v - size, u - size/2), its normals (-1, 0, 0). Vertex 0 is the upper
/// left corner (u = 0, v = size); the boundary is numbered on from there along the top edge
/// and round, then the inner vertices from top to bottom.
///
/// From 16 vertices on no angle is below 28° (the relaxation aims at 30°), and edges are 0.55 to
/// 1.6 times as long as their mean.
///
/// Labels: `upper-corners` and `lower-corners` (left, then right), `upper-edge` (left to right),
/// `boundary`.
///
/// ```
/// use selvedge_cloth::generate::square;
///
/// let sheet = square(1024, 1.0, 1)?;
/// assert_eq!(sheet.mesh.topology().vertex_count(), 1024);
/// assert_eq!(sheet.labels["upper-corners"], [0, 30]);
/// # Ok::<(), selvedge_cloth::SceneError>(())
/// ```
///
/// # Errors
/// [`SceneError`] names what cannot be used.
pub fn square(vertices: usize, size: f64, seed: u64) -> Result<Sheet, SceneError> {
    sheet(&SheetSpec {
        shape: Shape::Square,
        vertices,
        size,
        width: None,
        seed,
    })
}

/// A sheet of any shape, placed as [`square`] is: flat in the plane x = 0, its highest point at y =
/// 0, its middle at z = 0, u along z and normals (-1, 0, 0). The boundary comes first, clockwise
/// from the upper left (of a disc at 135°, of a diamond the left corner, of a random shape near
/// 135°), then holes, then the inner vertices from top to bottom.
///
/// Labels: `boundary` (holes included); `upper-corners` (left, then right) of every shape, of a
/// disc the points at 135° and 45°, of a random shape the corners near them, not level;
/// `upper-three` (left, middle, right) of `wide`, `diamond` and `disc`; `upper-row` of `triangle`,
/// 17 vertices evenly spaced from left to right; `clamped` of `drape-disc`; `upper-edge` where there is one; `lower-corners`
/// of a sheet with four corners; `hole` where there is one. A tube stands about the y axis with its
/// upper edge at y = 0, and has `upper-edge`, `lower-edge` and both, `boundary`.
///
/// # Errors
/// [`SceneError`] names what cannot be used.
pub fn sheet(spec: &SheetSpec) -> Result<Sheet, SceneError> {
    let width = spec.width.unwrap_or(spec.size);
    require_positive("size", spec.size).map_err(in_metres)?;
    if spec.vertices > MOST_VERTICES {
        let problem = format!(
            "vertices must be at most {MOST_VERTICES}, found {}",
            spec.vertices
        );
        return Err(SceneError(problem));
    }
    if spec.shape.has_width() {
        require_positive("width", width).map_err(in_metres)?;
    }
    if spec.shape == Shape::Tube {
        return tube::tube(spec, width);
    }
    let cut = (spec.shape).cut(width / spec.size, spec.vertices, spec.seed);
    let flat = sheet_from_outline(&cut, spec.vertices, spec.seed)?;
    let coordinates: Vec<DVec2> = flat.points.iter().map(|p| spec.size * *p).collect();
    let extent = spec.size * cut.extent;
    let hang = |c: &DVec2| DVec3::new(0.0, c.y - extent.y, c.x - extent.x / 2.0);
    let positions = coordinates.iter().map(hang).collect();
    Ok(Sheet {
        mesh: Mesh::new(&flat.faces, coordinates, positions)?,
        labels: labels(&cut, &flat),
    })
}

fn in_metres(error: SceneError) -> SceneError {
    SceneError(format!("{error} m"))
}

impl Shape {
    /// Returns true for a shape whose width is said.
    fn has_width(self) -> bool {
        matches!(self, Self::Rectangle | Self::Tube)
    }

    /// Vertices of a sheet of `size` `[m]` (and as wide, where that is said) at `density`
    /// `[vertices/m²]`, to the nearest; none where a number is not positive.
    pub fn vertices(self, size: f64, density: f64) -> usize {
        (density * self.unit_area() * size * size).round() as usize
    }
}

fn labels(cut: &Cut, flat: &FlatSheet) -> BTreeMap<String, Vec<u32>> {
    let outer = &flat.corners[0];
    let mut labels = BTreeMap::new();
    for (name, label) in &cut.labels {
        let list = match label {
            Label::Corners(corners) => corners.iter().map(|&k| outer[k]).collect(),
            Label::Run(from, to) => (outer[*from]..=outer[*to]).collect(),
            Label::WithinRidge => within_ridge(&cut.ridge, &flat.points),
        };
        labels.insert((*name).to_owned(), list);
    }
    let boundary = 0..flat.boundary_count as u32;
    if let Some(hole) = flat.corners.get(1) {
        labels.insert("hole".to_owned(), (hole[0]..boundary.end).collect());
    }
    labels.insert("boundary".to_owned(), boundary.collect());
    labels
}

/// Numbers of the `points` in the convex loop `ridge` (clockwise), its own included.
fn within_ridge(ridge: &[DVec2], points: &[DVec2]) -> Vec<u32> {
    let sides = || ridge.iter().zip(ridge.iter().cycle().skip(1));
    let is_within = |p: &DVec2| sides().all(|(a, b)| (*b - *a).perp_dot(*p - *a) <= 1e-12);
    (0..)
        .zip(points)
        .filter(|(_, p)| is_within(p))
        .map(|(v, _)| v)
        .collect()
}

#[cfg(test)]
mod tests;

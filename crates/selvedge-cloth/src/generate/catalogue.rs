//! The meshes that have a name: those that Libao et al. 2023 show their model on, and three that
//! they do not have. The paper gives no measures; these are ours.

use super::{Shape, SheetSpec};

/// A mesh that has a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedSheet {
    /// Name of the sheet.
    pub name: &'static str,
    /// Shape of the sheet.
    pub shape: Shape,
    /// Size of the sheet `[m]`.
    pub size: f64,
    /// The label of its handles.
    pub handles: &'static str,
}

const SHEETS: [NamedSheet; 12] = [
    entry("square", Shape::Square, 1.0, "upper-corners"),
    entry("long", Shape::Long, 1.0, "upper-corners"),
    entry("wide", Shape::Wide, 1.0, "upper-corners"),
    entry("big", Shape::Square, 1.5, "upper-corners"),
    entry("quarter", Shape::Square, 0.5, "upper-corners"),
    entry("triangle", Shape::Triangle, 1.0, "upper-corners"),
    entry("diamond", Shape::Diamond, 1.0, "upper-three"),
    entry("wide-3", Shape::Wide, 1.0, "upper-three"),
    entry("triangle-17", Shape::Triangle, 1.0, "upper-row"),
    entry("disc", Shape::Disc, 1.0, "upper-corners"),
    entry("l-shape", Shape::LShape, 1.0, "upper-corners"),
    entry("holed", Shape::Holed, 1.0, "upper-corners"),
];

const fn entry(name: &'static str, shape: Shape, size: f64, handles: &'static str) -> NamedSheet {
    NamedSheet {
        name,
        shape,
        size,
        handles,
    }
}

/// All meshes that have a name, the training mesh (`square`) first.
pub fn named_sheets() -> &'static [NamedSheet] {
    &SHEETS
}

impl NamedSheet {
    /// The mesh of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        SHEETS.into_iter().find(|sheet| sheet.name == name)
    }

    /// Number of vertices at `density` `[vertices/m²]`.
    pub fn vertices(&self, density: f64) -> usize {
        self.shape.vertices(self.size, density)
    }

    /// Its numbers for so many `vertices`.
    pub fn of(&self, vertices: usize, seed: u64) -> SheetSpec {
        SheetSpec {
            shape: self.shape,
            vertices,
            size: self.size,
            width: None,
            seed,
        }
    }
}

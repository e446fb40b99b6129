//! The Green strain of a face.

/// Green strain G of a face in material axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain {
    /// G00, along the course axis u.
    pub uu: f64,
    /// G11, along the wale axis v.
    pub vv: f64,
    /// G01, half the shear.
    pub uv: f64,
}

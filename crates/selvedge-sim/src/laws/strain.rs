//! The Green strain of a face.

/// Green strain G of a face in material axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain<N = f64> {
    /// G00, along the course axis u.
    pub uu: N,
    /// G11, along the wale axis v.
    pub vv: N,
    /// G01, half the shear.
    pub uv: N,
}

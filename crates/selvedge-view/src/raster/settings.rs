//! Choices of a picture: its samples per pixel, and the edges drawn over the cloth.

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
    pub(crate) fn factor(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }
}

/// The edges of the mesh that are drawn over the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EdgeLines {
    /// None.
    None,
    /// The border of the cloth.
    #[default]
    Border,
    /// The border, and faintly all other edges.
    All,
}

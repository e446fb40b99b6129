//! The choice of the samples per pixel.

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

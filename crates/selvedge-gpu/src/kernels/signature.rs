//! What is known of a kernel beside its body: what it works on, and what it is called with and does with
//! each of that. Schedules are checked against these tables, and signatures are written from them.

use selvedge_model::ModelSpec;

use crate::schedule::plan::Element;

/// What a kernel works on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A thread each.
    Element,
    /// A warp each.
    Row,
    /// A block of threads each.
    Block,
}

/// What a kernel does with an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reads `f32`.
    In,
    /// Reads `f32`, unless there are none.
    InOrNothing,
    /// Writes every `f32`.
    Out,
    /// Writes every `f32`, unless they are not wanted.
    OutOrNothing,
    /// Reads and writes `f32`.
    InOut,
    /// Reads `u32`.
    Indices,
    /// Reads and writes `u32`.
    IndicesInOut,
    /// Reads `f64`.
    Doubles,
    /// Reads `f64`, unless there are none.
    DoublesOrNothing,
    /// Writes every `f64`.
    DoublesOut,
    /// Reads and writes `f64`.
    DoublesInOut,
    /// Takes a `u32`.
    Count,
    /// Takes an `f32`.
    Number,
}

impl Access {
    /// Whether it reads memory.
    #[must_use]
    pub fn reads(self) -> bool {
        !matches!(
            self,
            Self::Out | Self::OutOrNothing | Self::DoublesOut | Self::Count | Self::Number
        )
    }

    /// Whether it writes memory.
    #[must_use]
    pub fn writes(self) -> bool {
        matches!(
            self,
            Self::Out
                | Self::OutOrNothing
                | Self::InOut
                | Self::IndicesInOut
                | Self::DoublesOut
                | Self::DoublesInOut
        )
    }

    /// Whether there may be nothing to read or write.
    #[must_use]
    pub fn may_be_nothing(self) -> bool {
        matches!(
            self,
            Self::InOrNothing | Self::OutOrNothing | Self::DoublesOrNothing
        )
    }

    /// What it points to, if it does.
    #[must_use]
    pub fn element(self) -> Option<Element> {
        match self {
            Self::In | Self::InOrNothing | Self::Out | Self::OutOrNothing | Self::InOut => {
                Some(Element::Float)
            }
            Self::Indices | Self::IndicesInOut => Some(Element::Index),
            Self::Doubles | Self::DoublesOrNothing | Self::DoublesOut | Self::DoublesInOut => {
                Some(Element::Double)
            }
            Self::Count | Self::Number => None,
        }
    }

    /// Its type in C.
    pub(super) fn c_type(self) -> &'static str {
        match self {
            Self::In | Self::InOrNothing => "const float *",
            Self::Out | Self::OutOrNothing | Self::InOut => "float *",
            Self::Indices => "const unsigned *",
            Self::IndicesInOut => "unsigned *",
            Self::Doubles | Self::DoublesOrNothing => "const double *",
            Self::DoublesOut | Self::DoublesInOut => "double *",
            Self::Count => "unsigned ",
            Self::Number => "float ",
        }
    }
}

/// A number of elements that follows from the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// So many.
    Numbers(usize),
    /// So many latent vectors.
    Latents(usize),
    /// The columns of a vertex.
    NodeColumns,
    /// The columns of an arc.
    EdgeColumns,
}

impl Width {
    /// How many that is.
    #[must_use]
    pub fn of(self, sizes: Sizes) -> usize {
        match self {
            Self::Numbers(number) => number,
            Self::Latents(number) => number * sizes.latent,
            Self::NodeColumns => sizes.node_width,
            Self::EdgeColumns => sizes.edge_width,
        }
    }
}

/// How many elements an argument has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// So many for each element, row or block of the launch.
    PerCount(Width),
    /// So many.
    Fixed(Width),
    /// That depends on other arguments.
    Any,
}

/// A parameter of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name in the source.
    pub name: &'static str,
    /// What is done with it.
    pub access: Access,
    /// How much of it there is.
    pub extent: Extent,
}

impl Parameter {
    /// A parameter with `width` elements per element, row or block of the launch.
    #[must_use]
    pub const fn per_count(name: &'static str, access: Access, width: Width) -> Self {
        let extent = Extent::PerCount(width);
        Self {
            name,
            access,
            extent,
        }
    }

    /// A parameter with `width` elements.
    #[must_use]
    pub const fn fixed(name: &'static str, access: Access, width: Width) -> Self {
        let extent = Extent::Fixed(width);
        Self {
            name,
            access,
            extent,
        }
    }

    /// A parameter of any size, or a number.
    #[must_use]
    pub const fn any(name: &'static str, access: Access) -> Self {
        let extent = Extent::Any;
        Self {
            name,
            access,
            extent,
        }
    }
}

/// A kernel as schedules and launchers see it. An `In` and an `Out` of one launch may be the same
/// region, never overlap otherwise.
#[derive(Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Its name in the source.
    pub name: &'static str,
    /// What it works on.
    pub shape: Shape,
    /// What it is called with, after the number of elements, rows or blocks.
    pub parameters: &'static [Parameter],
}

/// A file of kernels with their table.
#[derive(Debug)]
pub struct Part {
    /// Of the file.
    pub name: &'static str,
    /// Its contents.
    pub text: &'static str,
    /// The kernels in it.
    pub kernels: &'static [&'static Kernel],
}

/// Sizes of a network that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Of a latent vector.
    pub latent: usize,
    /// Columns of a vertex.
    pub node_width: usize,
    /// Columns of an arc.
    pub edge_width: usize,
}

impl Sizes {
    /// Those of a spec.
    #[must_use]
    pub fn of(spec: &ModelSpec) -> Self {
        Self {
            latent: spec.latent,
            node_width: spec.node_width(),
            edge_width: spec.edge_width(),
        }
    }
}

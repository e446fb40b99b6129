//! The table of `kernels/layers.cu`: the layers of the network that are not products, forward.

use crate::kernels::{Access, Kernel, Parameter, Part, Shape, Width};

use Access::{Count, In, InOrNothing, InOut, Indices, Number, Out, OutOrNothing};

const LATENT: Width = Width::Latents(1);
const ONE: Width = Width::Numbers(1);

const fn latent_rows(name: &'static str, access: Access) -> Parameter {
    Parameter::per_count(name, access, LATENT)
}

const fn latent(name: &'static str) -> Parameter {
    Parameter::fixed(name, In, LATENT)
}

/// The file and its kernels.
pub static PART: Part = Part {
    name: "layers.cu",
    text: include_str!("layers.cu"),
    kernels: &[
        &ADD_BIAS,
        &ADD_BIAS_RELU,
        &PACK_ENDS,
        &GATHER_ENDS,
        &NORM,
        &NORM_MESSAGES,
        &GATES,
        &DROPOUT,
    ],
};

/// Adds a bias to rows.
pub static ADD_BIAS: Kernel = Kernel {
    name: "add_bias",
    shape: Shape::Row,
    parameters: FINISH,
};

/// Adds a bias to rows, then takes their positive part.
pub static ADD_BIAS_RELU: Kernel = Kernel {
    name: "add_bias_relu",
    shape: Shape::Row,
    parameters: FINISH,
};

const FINISH: &[Parameter] = &[
    Parameter::any("rows", InOut),
    Parameter::any("leading", Count),
    Parameter::any("bias", In),
    Parameter::any("width", Count),
];

/// Puts the first edge layer's parts for both ends below each other, for every block.
pub static PACK_ENDS: Kernel = Kernel {
    name: "pack_ends",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("weights", In),
        Parameter::any("first", Count),
        Parameter::any("apart", Count),
        Parameter::per_count("packed", Out, ONE),
    ],
};

/// Adds to the first edge layer what both ends of an arc bring, and the bias; ReLU.
pub static GATHER_ENDS: Kernel = Kernel {
    name: "gather_ends",
    shape: Shape::Row,
    parameters: &[
        latent_rows("hidden", InOut),
        Parameter::any("ends", In),
        latent("bias"),
        Parameter::per_count("senders", Indices, ONE),
        Parameter::per_count("receivers", Indices, ONE),
    ],
};

/// Layer normalisation with the update that it ends in.
pub static NORM: Kernel = Kernel {
    name: "norm",
    shape: Shape::Row,
    parameters: &[
        latent_rows("x", In),
        latent("bias"),
        latent("weight"),
        latent("shift"),
        latent_rows("before", InOrNothing),
        latent_rows("after", Out),
        latent_rows("normal", OutOrNothing),
        Parameter::per_count("inverse", OutOrNothing, ONE),
    ],
};

/// Layer normalisation of the arcs into each vertex, added to the arcs and summed.
pub static NORM_MESSAGES: Kernel = Kernel {
    name: "norm_messages",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("x", In),
        latent("bias"),
        latent("weight"),
        latent("shift"),
        Parameter::any("first_arc", Indices),
        Parameter::any("before", In),
        Parameter::any("after", Out),
        latent_rows("incoming", Out),
        Parameter::any("normal", OutOrNothing),
        Parameter::any("inverse", OutOrNothing),
    ],
};

/// One step of a gated recurrent unit; without a state before, from zero.
pub static GATES: Kernel = Kernel {
    name: "gates",
    shape: Shape::Row,
    parameters: &[
        Parameter::per_count("input", In, Width::Latents(3)),
        Parameter::per_count("recurrent", InOrNothing, Width::Latents(3)),
        Parameter::fixed("bias_input", In, Width::Latents(3)),
        Parameter::fixed("bias_recurrent", In, Width::Latents(3)),
        latent_rows("before", InOrNothing),
        latent_rows("after", Out),
        Parameter::per_count("kept", OutOrNothing, Width::Latents(4)),
    ],
};

/// Dropout between the layers of a recurrent encoder.
pub static DROPOUT: Kernel = Kernel {
    name: "dropout",
    shape: Shape::Row,
    parameters: &[
        latent_rows("before", In),
        latent_rows("after", Out),
        Parameter::any("seeds", Indices),
        Parameter::any("place", Count),
        Parameter::any("steps", Count),
        Parameter::any("step", Count),
        Parameter::any("threshold", Count),
        Parameter::any("scale", Number),
    ],
};

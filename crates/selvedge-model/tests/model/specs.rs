//! Specs of the networks that tests go through.

use selvedge_model::{
    Connectivity, Encoder, Gradients, Input, InputGradient, Instructions, ModelSpec, Network,
    NetworkScalar, PackedWeights, Pass, Purpose, Workspace,
};

/// One of every encoder.
pub(crate) fn specs() -> Vec<ModelSpec> {
    vec![
        ModelSpec::physical(Encoder::MLP, 8, 3),
        ModelSpec::physical(Encoder::Gru { window: 4 }, 6, 2),
        ModelSpec::physical(Encoder::Gru { window: 1 }, 5, 1),
        ModelSpec::mesh_graph_nets(7, 2),
    ]
}

/// Weights for passes forward and backward.
pub(crate) fn packed<T: NetworkScalar>(network: &Network, weights: &[T]) -> PackedWeights<T> {
    network.pack(weights, Purpose::Training, Instructions::Detected)
}

/// The input of a network.
pub(crate) fn input<'a, T>(nodes: &'a [T], arcs: &'a [T]) -> Input<'a, T> {
    Input { nodes, arcs }
}

/// The output of a pass that nobody stops.
pub(crate) fn forward<T: NetworkScalar>(
    network: &Network,
    weights: &PackedWeights<T>,
    graph: &Connectivity,
    input: Input<'_, T>,
    pass: Pass<'_>,
) -> Vec<T> {
    let mut workspace = Workspace::new();
    let out = network.forward_packed(weights, graph, input, pass, &mut workspace);
    out.expect("no stop").to_vec()
}

/// The output of a training pass that nobody stops and, for the gradient `by_output` of it, the
/// gradients of the weights, and of the input in `by_input`.
pub(crate) fn both<T: NetworkScalar>(
    network: &Network,
    weights: &PackedWeights<T>,
    (graph, input): (&Connectivity, Input<'_, T>),
    pass: Pass<'_>,
    by_output: &[T],
    by_input: Option<InputGradient<'_, T>>,
) -> [Vec<T>; 2] {
    let mut workspace = Workspace::new();
    let out = network.forward_packed(weights, graph, input, pass, &mut workspace);
    let out = out.expect("no stop").to_vec();
    let mut gradient = vec![T::ZERO; network.parameter_count()];
    let gradients = Gradients {
        output: by_output,
        weights: &mut gradient,
        input: by_input,
    };
    let back = network.backward_packed(weights, graph, input, gradients, &mut workspace);
    back.expect("no stop");
    [out, gradient]
}

//! The networks that are measured, on a cloth with numbers drawn from a seed.

use anyhow::{Context, bail};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::Topology;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_model::{
    Carried, Connectivity, Encoder, EncoderState, Gradients, Input, Instructions, ModelSpec,
    Network, PackedWeights, Pass, Purpose, Workspace,
};
use selvedge_train::{Adam, AdamSettings};

/// A network to measure.
pub(crate) struct Variant {
    pub(crate) name: &'static str,
    pub(crate) spec: ModelSpec,
    /// Of its cloth.
    pub(crate) vertices: usize,
}

/// All that there are: the paper's sizes, and a small one.
pub(crate) fn all() -> Vec<Variant> {
    let of = |name, encoder| Variant {
        name,
        spec: ModelSpec::physical(encoder, 128, 15),
        vertices: 1024,
    };
    vec![
        of("gru-10", Encoder::Gru { window: 10 }),
        of("gru-5", Encoder::Gru { window: 5 }),
        of("streaming-gru", Encoder::StreamingGru { window: 10 }),
        of("mlp", Encoder::MLP),
        Variant {
            spec: ModelSpec::mesh_graph_nets(128, 15),
            ..of("meshgraphnets", Encoder::MLP)
        },
        Variant {
            name: "small",
            spec: ModelSpec::physical(Encoder::Gru { window: 5 }, 64, 8),
            vertices: 256,
        },
    ]
}

/// The variants with these names, or all where none is named.
///
/// # Errors
/// When there is none of a name.
pub(crate) fn named(names: &[String]) -> anyhow::Result<Vec<Variant>> {
    let known: Vec<&str> = all().iter().map(|v| v.name).collect();
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        bail!(
            "there is no variant {name:?}: there are {}",
            known.join(", ")
        );
    }
    let wanted = |v: &Variant| names.is_empty() || names.iter().any(|name| name == v.name);
    Ok(all().into_iter().filter(wanted).collect())
}

/// The arcs of an irregular square cloth.
///
/// # Errors
/// When it cannot be made.
pub(crate) fn cloth(vertices: usize) -> anyhow::Result<Topology> {
    let spec = SquareSpec {
        vertices,
        size: 1.0,
        seed: 1,
    };
    let sheet = square(&spec).context("making a cloth to measure on")?;
    Ok(sheet.mesh.topology().clone())
}

/// A network at work.
pub(crate) struct Engine {
    network: Network,
    graph: Connectivity,
    using: Instructions,
    weights: Vec<f32>,
    used: PackedWeights<f32>,
    nodes: Vec<f32>,
    edges: Vec<f32>,
    state: EncoderState<f32>,
    target: Vec<f32>,
    workspace: Workspace<f32>,
    learning: Option<Learning>,
}

/// The further needs of a step of learning, made for the first one.
struct Learning {
    weights: PackedWeights<f32>,
    gradient: Vec<f32>,
    by_output: Vec<f32>,
    adam: Adam,
    workspace: Workspace<f32>,
}

impl Engine {
    /// A network of this spec on these arcs.
    ///
    /// # Errors
    /// When the spec is of no network.
    pub(crate) fn new(
        spec: &ModelSpec,
        graph: Connectivity,
        using: Instructions,
    ) -> anyhow::Result<Self> {
        let network = Network::new(spec)?;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let mut numbers = |count: usize| -> Vec<f32> {
            (0..count)
                .map(|_| 3.0 * rng.random::<f32>() - 1.5)
                .collect()
        };
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        // A stream is measured on its way, with one frame of input.
        let [node_frames, edge_frames] = if network.streams() {
            [1, 1]
        } else {
            [spec.window(); 2]
        };
        let nodes = numbers(node_frames * vertices * spec.node_width());
        let edges = numbers(edge_frames * arcs * spec.edge_width());
        let target = numbers(3 * vertices);
        let state = if network.streams() {
            EncoderState::filled(0.1, vertices, arcs, spec.latent)
        } else {
            EncoderState::new()
        };
        let purpose = Purpose::Inference;
        Ok(Self {
            used: network.pack(&weights, purpose, using),
            workspace: Workspace::with_instructions(using),
            using,
            learning: None,
            network,
            graph,
            weights,
            nodes,
            edges,
            state,
            target,
        })
    }

    /// Vertices and arcs.
    pub(crate) fn counts(&self) -> (usize, usize) {
        (self.graph.vertex_count(), self.graph.arc_count())
    }

    /// One forward pass.
    pub(crate) fn frame(&mut self) {
        let input = Input {
            nodes: &self.nodes,
            arcs: &self.edges,
        };
        let workspace = &mut self.workspace;
        let given = Carried {
            input,
            state: &self.state,
        };
        let pass = Pass::Inference;
        let done = self
            .network
            .forward_carried(&self.used, &self.graph, given, pass, workspace);
        debug_assert!(done.is_ok(), "nobody stops it");
    }

    /// Makes what [`Self::step`] needs.
    ///
    /// # Errors
    /// When the optimiser's settings are wrong.
    pub(crate) fn learn(&mut self) -> anyhow::Result<()> {
        let (network, purpose) = (&self.network, Purpose::Training);
        self.learning = Some(Learning {
            weights: network.pack(&self.weights, purpose, self.using),
            gradient: vec![0.0; self.weights.len()],
            by_output: vec![0.0; self.target.len()],
            adam: Adam::new(AdamSettings::default(), self.weights.len())?,
            workspace: Workspace::with_instructions(self.using),
        });
        Ok(())
    }

    /// One step of learning, after [`Self::learn`]: packing, forward, the mean square error of the
    /// output, backward, Adam.
    pub(crate) fn step(&mut self) {
        let Some(learning) = &mut self.learning else {
            return;
        };
        let (network, workspace) = (&self.network, &mut learning.workspace);
        network.repack(&self.weights, &mut learning.weights);
        let input = Input {
            nodes: &self.nodes,
            arcs: &self.edges,
        };
        let pass = Pass::Training(None);
        let given = Carried {
            input,
            state: &self.state,
        };
        let out = network.forward_carried(&learning.weights, &self.graph, given, pass, workspace);
        let Ok(out) = out else { return };
        let scale = 2.0 / out.len() as f32;
        for ((to, x), y) in learning.by_output.iter_mut().zip(out).zip(&self.target) {
            *to = scale * (x - y);
        }
        learning.gradient.fill(0.0);
        let gradients = Gradients::new(&learning.by_output, &mut learning.gradient);
        let back =
            network.backward_carried(&learning.weights, &self.graph, given, gradients, workspace);
        debug_assert!(back.is_ok(), "nobody stops it");
        let adam = &mut learning.adam;
        adam.step(&mut self.weights, &learning.gradient, 1e-5);
    }
}

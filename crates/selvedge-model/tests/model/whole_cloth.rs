//! Tokens of a cloth do not know how its vertices are numbered or where they lie close together.

use glam::DVec2;
use selvedge_cloth::{Cloth, Environment, Handles, Mesh};
use selvedge_model::{
    ClothGraph, Connectivity, Encoder, Input, ModelSpec, Network, Pass, Workspace,
};

/// Length and width of the strip `[m]`.
const SIZE: DVec2 = DVec2::new(1.0, 0.5);
const LATENT: usize = 8;

/// A strip of cloth with columns of vertices at x = (c / columns)^`power`.
struct Strip {
    graph: Connectivity,
    places: Vec<DVec2>,
}

/// Rows of vertices in a strip.
const ROWS: u32 = 9;

/// A strip whose vertices are numbered from the other end where `backwards`.
fn strip(columns: u32, power: f64, backwards: bool) -> Strip {
    let count = ROWS * (columns + 1);
    let number = |v: u32| if backwards { count - 1 - v } else { v };
    let mut faces = Vec::new();
    for c in 0..columns {
        for row in 0..ROWS - 1 {
            let v = ROWS * c + row;
            faces.push([v, v + ROWS, v + 1].map(number));
            faces.push([v + 1, v + ROWS, v + ROWS + 1].map(number));
        }
    }
    let place = |v: u32| {
        let along = (f64::from(v / ROWS) / f64::from(columns)).powf(power);
        SIZE * DVec2::new(along, f64::from(v % ROWS) / f64::from(ROWS - 1))
    };
    let places: Vec<DVec2> = (0..count).map(|v| place(number(v))).collect();
    let shapes: Vec<_> = faces
        .iter()
        .map(|face| face.map(|v| places[v as usize]))
        .collect();
    let positions = places.iter().map(|p| p.extend(0.0)).collect();
    let mesh = Mesh::sewn(&faces, &shapes, positions).expect("a strip");
    let handles = Handles::new(&[number(0)], count as usize).expect("a handle");
    let cloth = Cloth::of_mesh(&mesh, 0.2, handles).expect("a cloth");
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph");
    Strip {
        graph: graph.connectivity().clone(),
        places,
    }
}

impl Strip {
    /// Outputs of a network that sees waves along the strip at its vertices, and nothing at its
    /// arcs; those of some places.
    fn outputs(&self, network: &Network, weights: &[f64], places: &[DVec2]) -> Vec<f64> {
        let (spec, vertices) = (network.spec(), self.graph.vertex_count());
        let width = spec.node_width();
        let mut nodes = Vec::with_capacity(vertices * width);
        for p in &self.places {
            nodes.extend((0..width).map(|k| (3.0 * p.x + (k as f64) * (1.0 + p.y)).sin()));
        }
        let arcs = vec![0.0; self.graph.arc_count() * spec.edge_width()];
        let input = Input {
            nodes: &nodes,
            arcs: &arcs,
        };
        let mut workspace = Workspace::new();
        let out = network.forward(weights, &self.graph, input, Pass::Inference, &mut workspace);
        let rows = places.iter().map(|at| {
            let found = self.places.iter().position(|p| p.distance(*at) < 1e-9);
            found.expect("a vertex there")
        });
        rows.flat_map(|v| out[3 * v..][..3].to_vec()).collect()
    }
}

fn spec(tokens: usize) -> ModelSpec {
    ModelSpec {
        tokens,
        ..ModelSpec::physical(Encoder::MLP, LATENT, 2)
    }
}

/// Weights that are uneven everywhere.
fn weights(network: &Network) -> Vec<f64> {
    let mut number = 0_u32;
    let start = network.initialise(&mut || {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(number) / f64::from(u32::MAX)
    });
    start.iter().map(|&w| f64::from(w)).collect()
}

/// The largest difference between two lists.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}

/// Corners of the strip, and the middles of two of its sides.
fn places() -> Vec<DVec2> {
    [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.0, 1.0],
        [1.0, 1.0],
        [0.0, 0.5],
        [1.0, 0.5],
    ]
    .map(|[x, y]| SIZE * DVec2::new(x, y))
    .to_vec()
}

#[test]
fn the_numbers_of_vertices_do_not_show() {
    let network = Network::new(&spec(5)).expect("a spec");
    let weights = weights(&network);
    let [there, back] = [false, true]
        .map(|backwards| strip(12, 1.3, backwards).outputs(&network, &weights, &places()));
    // Sums in another order.
    assert!(apart(&there, &back) < 1e-10, "{there:?} {back:?}");
}

/// Takes away what the vertices' updates see in some columns of `columns`.
fn blind(network: &Network, weights: &mut [f64], columns: std::ops::Range<usize>) {
    for block in 0..2 {
        let name = format!("processor.{block}.node.0.weight");
        let first = network.parameters().iter().find(|p| p.name == name);
        let first = first.expect("a layer");
        for row in weights[first.range.clone()].chunks_exact_mut(first.shape[1]) {
            row[columns.clone()].fill(0.0);
        }
    }
}

#[test]
fn where_vertices_lie_close_together_does_not_show() {
    let network = Network::new(&spec(5)).expect("a spec");
    let mut weights = weights(&network);
    // Without messages, whose sum counts arcs, a vertex knows itself and the tokens.
    blind(&network, &mut weights, LATENT..2 * LATENT);
    let [even, dense] = [1.0, 3.0].map(|power| strip(60, power, false));
    let of = |strip: &Strip, weights: &[f64]| strip.outputs(&network, weights, &places());
    let off = apart(&of(&even, &weights), &of(&dense, &weights));
    // Sums over columns of up to a twentieth in place of integrals.
    assert!(off < 5e-3, "{off}");
    let [least, most] = [f32::min, f32::max].map(|of| {
        let shares = dense.graph.shares().iter().copied();
        shares.reduce(of).expect("shares")
    });
    assert!(most > 1000.0 * least, "even after all: {least} {most}");
    let mut blinded = weights.clone();
    blind(&network, &mut blinded, 2 * LATENT..3 * LATENT);
    let seen = apart(&of(&even, &weights), &of(&even, &blinded));
    assert!(seen > 0.05, "tokens show: {seen}");
}

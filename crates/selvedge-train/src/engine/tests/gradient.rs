//! Gradients of whole micro-batches: the same for slots together and apart, and in f64 the slope of
//! the whole training loss, features to losses.

use selvedge_data::SectionRule;
use selvedge_model::{
    Connectivity, Dropout, Encoder, Gradients, Input, Instructions, ModelSpec, Network,
    NetworkScalar, Pass, Place, Purpose, Window, Workspace,
};

use crate::config::TrainConfig;
use crate::engine::OnProcessor;
use crate::losses::{LossEvaluator, LossStatistics, LossTerms};
use crate::schedule::UnrollFrames;
use crate::slot::{ShownSample, Slot, rng_of};
use crate::test_data::{ENGINE, Swinging, busy, config, swinging, two_cloths};
use crate::trainer::Trainer;
use crate::training_set::TrainingSet;

/// The loss terms of a step and its gradient, with micro-batches of so many slots.
fn step(data: &Swinging, cfg: &TrainConfig, micro_batch: usize) -> (LossTerms, Vec<f32>) {
    let engine = OnProcessor { micro_batch };
    let mut trainer = Trainer::new(cfg.clone(), &data.dataset, &engine).expect("a training");
    let terms = trainer.step().expect("a step").terms;
    (terms, trainer.gradient().expect("a gradient"))
}

#[test]
fn grouping_changes_nothing_but_rounding() {
    let data = two_cloths();
    for (encoder, frames) in [
        (Encoder::MLP, 1),
        (Encoder::Gru { window: 3 }, 1),
        (Encoder::Gru { window: 3 }, 2),
    ] {
        let mut cfg = busy(encoder);
        cfg.batch.samples = 5;
        cfg.unroll = UnrollFrames::Constant { frames };
        if frames > 1 {
            cfg.losses.kinetic_energy = 0.0;
        }
        let (expected, apart) = step(&data, &cfg, 1);
        let length =
            |x: &mut dyn Iterator<Item = f32>| x.map(|x| f64::from(x).powi(2)).sum::<f64>().sqrt();
        for micro_batch in [2, 3, 4, 5, 9] {
            let (found, together) = step(&data, &cfg, micro_batch);
            let what = format!("{encoder:?}, {frames} frames, {micro_batch} together");
            // Each vertex is computed alone; a union only changes the tiles of its products.
            let off = (found.total - expected.total).abs() / expected.total;
            assert!(off < 1e-5, "{what}: {off}");
            let difference = together.iter().zip(&apart).map(|(a, b)| a - b);
            let off = length(&mut difference.into_iter()) / length(&mut apart.iter().copied());
            // Sums of some hundred f32 numbers in another order, for each frame.
            assert!(off < 1e-4, "{what}: {off}");
        }
    }
}

#[test]
fn a_batch_of_one_sample_many_times_has_the_gradient_of_that_sample() {
    // Three frames are one sample.
    let data = swinging(&[("a", 9, 3)], SectionRule::Whole);
    let gradient = |samples: usize| {
        let mut cfg = config(Encoder::MLP);
        cfg.batch.samples = samples;
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        trainer.step().expect("a step");
        trainer.gradient().expect("a gradient")
    };
    let (one, many) = (gradient(1), gradient(5));
    let largest = one.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
    for (a, b) in one.iter().zip(&many) {
        // Sums in f32 in another order.
        assert!((a - b).abs() < 1e-5 * largest);
    }
}

/// One sample, its normalised features and its statistics, for the network in f64.
struct Whole {
    network: Network,
    connectivity: Connectivity,
    shown: ShownSample,
    set: TrainingSet,
    nodes: Vec<f64>,
    edges: Vec<f64>,
    statistics: LossStatistics,
    losses: LossEvaluator,
    weights: Vec<f64>,
    _data: Swinging,
}

fn whole(encoder: Encoder) -> Whole {
    let data = swinging(&[("a", 9, 20)], SectionRule::Whole);
    let mut cfg = config(encoder);
    cfg.noise.deviation = 0.003;
    cfg.model = ModelSpec {
        latent: 6,
        ..cfg.model
    };
    let trainer = Trainer::new(cfg.clone(), &data.dataset, &ENGINE).expect("a training");
    let model = trainer.model(String::new()).expect("a model");
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let mut shown = ShownSample::default();
    let mut rng = rng_of(cfg.seed, 0, 0, 1);
    Slot::new().show(&cfg, &set, &mut rng, &mut shown);
    let graph = &set.motion(0).graph;
    let place = Place::alone(graph);
    let mut window = Window::default();
    window.write(&cfg.model, graph, shown.window(), &place);
    let normalizers = model.normalizers();
    window.normalize(&normalizers.nodes, &normalizers.edges);
    let wide = |x: &[f32]| x.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
    Whole {
        connectivity: Connectivity::of(graph.topology()),
        nodes: wide(&window.nodes),
        edges: wide(&window.arcs),
        statistics: trainer.state.targets.freeze(),
        losses: LossEvaluator::new(cfg.losses),
        weights: wide(model.weights()),
        network: model.network().clone(),
        shown,
        set,
        _data: data,
    }
}

impl Whole {
    /// The loss with these weights, and its gradient if asked for.
    fn loss<T: NetworkScalar>(&mut self, weights: &[T], gradient: Option<&mut [T]>) -> f64 {
        let narrow = |x: &[f64]| x.iter().map(|&x| T::from_f64(x)).collect::<Vec<T>>();
        let (nodes, edges) = (narrow(&self.nodes), narrow(&self.edges));
        let input = Input {
            nodes: &nodes,
            arcs: &edges,
        };
        let (network, graph) = (&self.network, &self.connectivity);
        let packed = network.pack(weights, Purpose::Training, Instructions::Detected);
        let mut workspace = Workspace::new();
        let pass = Pass::Training(Some(Dropout {
            rate: 0.2,
            seeds: &[5],
        }));
        let predicted = network
            .forward_packed(&packed, graph, input, pass, &mut workspace)
            .expect("nobody stops it")
            .to_vec();
        let mut output = vec![T::ZERO; predicted.len()];
        let triplet = self.shown.triplet(&self.set.motion(0).graph);
        let statistics = &self.statistics;
        let losses = &mut self.losses;
        let terms = losses.evaluate(&triplet, statistics, &predicted, &mut output);
        if let Some(gradient) = gradient {
            let gradients = Gradients::new(&output, gradient);
            let back = network.backward_packed(&packed, graph, input, gradients, &mut workspace);
            back.expect("nobody stops it");
        }
        terms.total
    }
}

#[test]
fn the_gradient_is_the_slope_of_the_whole_loss() {
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let mut whole = whole(encoder);
        let weights = whole.weights.clone();
        let mut gradient = vec![0.0; weights.len()];
        whole.loss(&weights, Some(&mut gradient));
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        for parameter in whole.network.parameters().to_vec() {
            // The steepest entry of every tensor, and its first.
            let steepest = parameter
                .range
                .clone()
                .max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()));
            for place in [steepest.expect("no empty tensor"), parameter.range.start] {
                let step = 1e-5;
                let mut moved = weights.clone();
                moved[place] += step;
                let above = whole.loss(&moved, None);
                moved[place] -= 2.0 * step;
                let below = whole.loss(&moved, None);
                let slope = (above - below) / (2.0 * step);
                let error = (slope - gradient[place]).abs();
                // Central differences: 1e-10 times the third derivative, and 1e-16 of the loss
                // over the step; a ReLU that switches within the step would show.
                assert!(
                    error < 1e-6 * (length + slope.abs()),
                    "{} at {place}: slope {slope}, gradient {}",
                    parameter.name,
                    gradient[place]
                );
            }
        }
    }
}

#[test]
fn single_precision_gives_the_same_gradient() {
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let mut whole = whole(encoder);
        let weights = whole.weights.clone();
        let mut exact = vec![0.0; weights.len()];
        let loss = whole.loss(&weights, Some(&mut exact));
        let narrow: Vec<f32> = weights.iter().map(|&w| w as f32).collect();
        let mut found = vec![0.0_f32; weights.len()];
        let rounded = whole.loss(&narrow, Some(&mut found));
        assert!((rounded - loss).abs() < 1e-4 * loss);
        let squares = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
        let length = squares(&mut exact.iter().copied());
        let pairs = exact.iter().zip(&found);
        let difference = squares(&mut pairs.map(|(a, &b)| a - f64::from(b)));
        // Roundings of 6e-8 through two dozen layers, amplified by LayerNorms: 1e-4.
        assert!(difference < 1e-4 * length, "{}", difference / length);
    }
}

#[test]
fn a_capped_sample_counts_with_the_part_that_the_cap_is_of_its_loss() {
    let data = swinging(&[("a", 9, 3)], SectionRule::Whole);
    let run = |cap: Option<f64>| {
        let mut cfg = config(Encoder::MLP);
        cfg.loss_cap = cap;
        let mut trainer = Trainer::new(cfg, &data.dataset, &ENGINE).expect("a training");
        let report = trainer.step().expect("a step");
        (report.terms.total, report.gradient_norm)
    };
    let (loss, norm) = run(None);
    assert_eq!(run(Some(2.0 * loss)), (loss, norm), "below the cap");
    let (reported, capped) = run(Some(0.25 * loss));
    assert_eq!(reported, loss, "the report is of the loss itself");
    assert!((capped - 0.25 * norm).abs() < 1e-6 * norm, "{capped}");
}

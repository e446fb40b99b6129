//! What is reported. The values of the terms, their gradients and their statistics are compared with
//! PyTorch's in `tests/pytorch.rs`.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, Environment, Handles};

use super::*;

/// An irregular cloth with two handles, and three frames of it in motion.
struct Sample {
    graph: ClothGraph,
    previous: Vec<DVec3>,
    current: Vec<DVec3>,
    target: Vec<DVec3>,
}

impl Sample {
    fn triplet(&self) -> Triplet<'_> {
        Triplet {
            graph: &self.graph,
            previous: &self.previous,
            current: &self.current,
            target: &self.target,
        }
    }
}

fn sample(vertices: usize) -> Sample {
    let sheet = square(vertices, 1.0, 3).expect("a square");
    let rest = sheet.mesh.positions();
    let handles = Handles::new(&[0, 1], rest.len()).expect("two handles");
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).expect("a cloth");
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut draw =
        |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * rng.random::<f64>() - 1.0)));
    let current: Vec<DVec3> = rest.iter().map(|&p| p + draw(0.01)).collect();
    Sample {
        graph: graph.expect("a graph"),
        previous: current.iter().map(|&p| p + draw(0.02)).collect(),
        target: current.iter().map(|&p| p + draw(0.02)).collect(),
        current,
    }
}

fn statistics(triplet: &Triplet<'_>) -> LossStatistics {
    let mut running = RunningLossStatistics::default();
    running.add(triplet);
    running.freeze()
}

fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| 2.0 * rng.random::<f64>() - 1.0)
        .collect()
}

fn evaluate(weights: LossWeights, sample: &Sample, predicted: &[f64]) -> (LossTerms, Vec<f64>) {
    let triplet = sample.triplet();
    let mut gradient = vec![f64::NAN; predicted.len()];
    let mut evaluator = LossEvaluator::new(weights);
    let terms = evaluator.evaluate(&triplet, &statistics(&triplet), predicted, &mut gradient);
    (terms, gradient)
}

const OFF: LossWeights = LossWeights {
    kinetic_energy: 0.0,
    edge_vector: 0.0,
    edge_length: 0.0,
    bending_angle: 0.0,
};

#[test]
fn terms_go_to_other_ranks_and_back() {
    let sample = sample(40);
    let predicted = numbers(3 * 40, 2);
    let both = [LossWeights::default(), OFF].map(|w| evaluate(w, &sample, &predicted).0);
    let bytes: Vec<u8> = both.into_iter().flat_map(LossTerms::to_bytes).collect();
    assert_eq!(LossTerms::from_bytes(&bytes), Some(both.to_vec()));
    assert_eq!(LossTerms::from_bytes(&bytes[1..]), None);
}

#[test]
fn terms_of_weight_0_are_left_out() {
    let sample = sample(40);
    let triplet = sample.triplet();
    let statistics = statistics(&triplet);
    let weights = LossWeights {
        edge_length: 2.0,
        ..OFF
    };
    let predicted = numbers(3 * 40, 2);
    let run = |evaluator: &mut LossEvaluator| {
        let mut gradient = vec![0.0; predicted.len()];
        let terms = evaluator.evaluate(&triplet, &statistics, &predicted, &mut gradient);
        (terms, gradient)
    };
    let mut evaluator = LossEvaluator::new(weights);
    let mut gradient = vec![0.0; predicted.len()];
    // Buffers of the sample before must not show.
    evaluator.evaluate(&triplet, &statistics, &numbers(3 * 40, 9), &mut gradient);
    let found = run(&mut evaluator);
    assert_eq!(found, run(&mut LossEvaluator::new(weights)));
    let terms = found.0;
    assert_eq!(
        (terms.kinetic_energy, terms.edge_vector, terms.bending_angle),
        (None, None, None)
    );
    assert_eq!(
        terms.total,
        terms.acceleration + 2.0 * terms.edge_length.expect("weighted")
    );
}

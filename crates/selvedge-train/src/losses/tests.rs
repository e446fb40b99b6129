//! Gradients against finite differences, what is reported and what is counted. The values of the terms
//! are compared with PyTorch's in `tests/pytorch.rs`.

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles};

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
    let shape = sheet.mesh.rest_shape(0.15);
    let rest = sheet.mesh.positions();
    let arrays = ClothArrays {
        vertex_mass: shape.vertex_mass.iter().map(|&m| m as f32).collect(),
        face_area: shape.face_area.iter().map(|&a| a as f32).collect(),
        material_coordinates: vec![Vec2::ZERO; rest.len()],
        rest_positions: rest.iter().map(|p| p.as_vec3()).collect(),
    };
    let handles = Handles::new(&[0, 1], rest.len()).expect("two handles");
    let cloth = Cloth::new(sheet.mesh.topology().clone(), handles, arrays).expect("a cloth");
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

/// The normalised acceleration that leads exactly to the target.
fn perfect(triplet: &Triplet<'_>, statistics: &LossStatistics) -> Vec<f64> {
    let (mean, deviation) = (
        statistics.acceleration.mean(),
        statistics.acceleration.deviation(),
    );
    (0..triplet.target.len())
        .flat_map(|v| ((triplet.acceleration(v) - vector(mean)) / vector(deviation)).to_array())
        .collect()
}

fn evaluate(weights: LossWeights, sample: &Sample, predicted: &[f64]) -> (LossTerms, Vec<f64>) {
    let triplet = sample.triplet();
    let mut gradient = vec![f64::NAN; predicted.len()];
    let mut evaluator = LossEvaluator::new(weights);
    let terms = evaluator.evaluate(&triplet, &statistics(&triplet), predicted, &mut gradient);
    (terms, gradient)
}

const OFF: LossWeights = LossWeights::ACCELERATION_ONLY;

fn cases() -> [(&'static str, LossWeights); 6] {
    let weight = 7.0;
    [
        ("acceleration", OFF),
        (
            "kinetic energy",
            LossWeights {
                kinetic_energy: weight,
                ..OFF
            },
        ),
        (
            "edge vector",
            LossWeights {
                edge_vector: weight,
                ..OFF
            },
        ),
        (
            "edge length",
            LossWeights {
                edge_length: weight,
                ..OFF
            },
        ),
        (
            "bending angle",
            LossWeights {
                bending_angle: weight,
                ..OFF
            },
        ),
        ("all", LossWeights::default()),
    ]
}

#[test]
fn every_term_has_the_gradient_of_its_finite_differences() {
    let sample = sample(40);
    let start = numbers(3 * 40, 1);
    for (name, weights) in cases() {
        let (_, gradient) = evaluate(weights, &sample, &start);
        for seed in 0..20 {
            // Along random directions, every component at once.
            let direction = numbers(start.len(), 100 + seed);
            let step = 1e-5;
            let at = |sign: f64| {
                let moved: Vec<f64> = start
                    .iter()
                    .zip(&direction)
                    .map(|(x, d)| x + sign * step * d)
                    .collect();
                evaluate(weights, &sample, &moved).0.total
            };
            let expected = (at(1.0) - at(-1.0)) / (2.0 * step);
            let found: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
            let size = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
            // Truncation step² times third derivatives, rounding 1e-16 · loss / step.
            assert!(
                (found - expected).abs() < 1e-7 * size,
                "{name}: {found} {expected}"
            );
        }
        for (v, &handle) in sample.graph.handle_mask().iter().enumerate() {
            assert_eq!(
                handle,
                gradient[3 * v..][..3] == [0.0; 3],
                "{name}, vertex {v}"
            );
        }
    }
}

#[test]
fn a_perfect_prediction_costs_nothing_and_has_no_gradient() {
    let sample = sample(40);
    let triplet = sample.triplet();
    let predicted = perfect(&triplet, &statistics(&triplet));
    let (terms, gradient) = evaluate(LossWeights::default(), &sample, &predicted);
    // Squares of roundings of 1e-16 m in 1e-2 m.
    assert!(terms.total < 1e-20, "{terms:?}");
    assert!(gradient.iter().all(|g| g.abs() < 1e-9));
}

#[test]
fn terms_go_to_other_ranks_and_back() {
    let sample = sample(40);
    let predicted = numbers(3 * 40, 2);
    let both = [LossWeights::default(), OFF].map(|weights| {
        let triplet = sample.triplet();
        let mut gradient = vec![0.0; predicted.len()];
        let mut evaluator = LossEvaluator::new(weights);
        evaluator.evaluate(&triplet, &statistics(&triplet), &predicted, &mut gradient)
    });
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

#[test]
fn statistics_count_free_vertices_and_edges_both_ways() {
    let sample = sample(40);
    let triplet = sample.triplet();
    let statistics = statistics(&triplet);
    let energies: Vec<f64> = triplet
        .free_vertices()
        .map(|v| triplet.kinetic_energy(v, triplet.target[v]))
        .collect();
    let mean = energies.iter().sum::<f64>() / 38.0;
    assert!((statistics.kinetic_energy.mean()[0] / mean - 1.0).abs() < 1e-12);
    assert!(
        statistics
            .edge_vector
            .mean()
            .iter()
            .all(|m| m.abs() < 1e-15)
    );
}

#[test]
fn weights_are_checked_and_their_names_too() {
    let weights = |text: &str| toml::from_str::<LossWeights>(text);
    assert_eq!(weights("").expect("defaults"), LossWeights::default());
    assert!(
        weights("bending = 1.0")
            .expect_err("a wrong name")
            .to_string()
            .contains("bending")
    );
    let negative = weights("edge_length = -1.0").expect("a number");
    let message = negative.validate().expect_err("negative").to_string();
    assert_eq!(
        message,
        "losses.edge_length must be finite and not negative, found -1"
    );
    let text = toml::to_string(&LossWeights::default()).expect("TOML");
    assert_eq!(text.lines().count(), 4, "{text}");
}

//! Losses, their gradients and statistics, Adam and clipping against PyTorch:
//! pytorch/learning.safetensors, which pytorch/generate.py wrote beside it, all in f64. Differences
//! are relative to the largest entry of each tensor; f32 is allowed 1e-5.
//! `cargo test -p selvedge-train --test pytorch -- --nocapture` prints the largest differences.

// What is measured is there to be read.
#![allow(clippy::print_stdout)]

use glam::{DVec3, Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles, Topology};
use selvedge_model::{ClothGraph, Real};
use selvedge_train::{
    Adam, AdamSettings, LossEvaluator, LossStatistics, LossTerms, LossWeights,
    RunningLossStatistics, Triplet, clip_norm,
};

#[path = "../../selvedge-model/tests/pytorch/fixture.rs"]
mod fixture;

const FIXTURE: &[u8] = include_bytes!("pytorch/learning.safetensors");

/// f64 against f64: some hundred roundings of 1e-16, amplified where angles are steep.
const WIDE: f64 = 1e-12;
/// f32 against f64.
const NARROW: f64 = 1e-5;

fn tensor(name: &str) -> Vec<f64> {
    fixture::tensor(FIXTURE, name)
}

fn narrow(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&x| x as f32).collect()
}

fn whole(name: &str) -> Vec<u32> {
    tensor(name).into_iter().map(|x| x as u32).collect()
}

fn points(name: &str) -> Vec<DVec3> {
    let values = tensor(name);
    let rows = values.as_chunks::<3>().0;
    rows.iter().map(|&row| DVec3::from_array(row)).collect()
}

/// The largest difference, checked and told.
fn compare<T: Real>(what: &str, found: &[T], expected: &[f64], limit: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let differences = found
        .iter()
        .zip(expected)
        .map(|(x, y)| (x.to_f64() - y).abs());
    let worst = differences.fold(0.0, f64::max) / largest;
    println!("{what:36} {worst:.1e} (allowed {limit:.0e})");
    assert!(worst <= limit, "{what}: {worst:e}");
}

fn graph() -> ClothGraph {
    let mass = tensor("mass");
    let faces = whole("faces");
    let faces = faces.as_chunks::<3>().0;
    let arrays = ClothArrays {
        face_area: vec![1.0; faces.len()],
        material_coordinates: vec![Vec2::ZERO; mass.len()],
        rest_positions: vec![Vec3::ZERO; mass.len()],
        vertex_mass: narrow(&mass),
    };
    let topology = Topology::new(mass.len(), faces).expect("a grid");
    let handles = Handles::new(&whole("handles"), mass.len()).expect("two handles");
    let cloth = Cloth::new(topology, handles, arrays).expect("a cloth");
    ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph")
}

/// Results for the sample of the fixture.
type Judge<'a> = dyn FnMut(&Triplet<'_>, &LossStatistics) + 'a;

fn with_sample(judge: &mut Judge<'_>) {
    let graph = graph();
    let [previous, current, target] = ["previous", "current", "target"].map(points);
    let triplet = Triplet {
        graph: &graph,
        previous: &previous,
        current: &current,
        target: &target,
    };
    let mut running = RunningLossStatistics::default();
    running.add(&triplet);
    judge(&triplet, &running.freeze());
}

#[test]
fn statistics_of_the_losses_are_pytorchs() {
    with_sample(&mut |_, statistics| {
        for (name, found) in [
            ("acceleration", &statistics.acceleration),
            ("kinetic_energy", &statistics.kinetic_energy),
            ("edge_vector", &statistics.edge_vector),
            ("edge_length", &statistics.edge_length),
            ("bending_angle", &statistics.bending_angle),
        ] {
            // A mean may be 0 (edges count both ways): it is compared beside its deviation.
            let found = [found.mean(), found.deviation()].concat();
            let expected =
                ["mean", "deviation"].map(|kind| tensor(&format!("statistics/{name}.{kind}")));
            compare(
                &format!("statistics of {name}"),
                &found,
                &expected.concat(),
                WIDE,
            );
        }
    });
}

type Term = fn(&LossTerms) -> Option<f64>;

/// Each term by itself beside the acceleration, and all together.
fn cases() -> [(&'static str, LossWeights, Term); 6] {
    const OFF: LossWeights = LossWeights {
        kinetic_energy: 0.0,
        edge_vector: 0.0,
        edge_length: 0.0,
        bending_angle: 0.0,
    };
    let mut one = [OFF; 4];
    one[0].kinetic_energy = 1.0;
    one[1].edge_vector = 1.0;
    one[2].edge_length = 1.0;
    one[3].bending_angle = 1.0;
    [
        ("acceleration", OFF, |t| Some(t.acceleration)),
        ("kinetic_energy", one[0], |t| t.kinetic_energy),
        ("edge_vector", one[1], |t| t.edge_vector),
        ("edge_length", one[2], |t| t.edge_length),
        ("bending_angle", one[3], |t| t.bending_angle),
        ("total", LossWeights::default(), |t| Some(t.total)),
    ]
}

#[test]
fn losses_and_their_gradients_are_pytorchs() {
    with_sample(&mut |triplet, statistics| {
        let predicted = tensor("predicted");
        let single = narrow(&predicted);
        for (name, weights, term) in cases() {
            let mut evaluator = LossEvaluator::new(weights);
            let [value, slope] =
                ["", ".gradient"].map(|kind| tensor(&format!("loss/{name}{kind}")));
            let mut gradient = vec![f64::NAN; predicted.len()];
            let terms = evaluator.evaluate(triplet, statistics, &predicted, &mut gradient);
            let found = term(&terms).expect("a term that counts");
            compare(&format!("loss {name}"), &[found], &value, WIDE);
            compare(&format!("gradient of {name}"), &gradient, &slope, WIDE);
            let mut gradient = vec![f32::NAN; single.len()];
            evaluator.evaluate(triplet, statistics, &single, &mut gradient);
            compare(
                &format!("gradient of {name}, f32"),
                &gradient,
                &slope,
                NARROW,
            );
        }
    });
}

#[test]
fn the_steps_of_adam_are_pytorchs() {
    let start = narrow(&tensor("adam/start"));
    let (gradients, rates) = (narrow(&tensor("adam/gradients")), tensor("adam/rates"));
    let count = start.len();
    // Many times over: more than the 2¹⁵ numbers that one thread takes at a time.
    let copies = (1 << 16) / count;
    let mut weights = start.repeat(copies);
    let mut adam = Adam::new(AdamSettings::default(), weights.len()).expect("valid settings");
    let mut path = Vec::new();
    for (gradient, &rate) in gradients.chunks_exact(count).zip(&rates) {
        adam.step(&mut weights, &gradient.repeat(copies), rate);
        assert!(weights.chunks(count).all(|copy| *copy == weights[..count]));
        path.extend_from_slice(&weights[..count]);
    }
    compare(
        "weights after each step of Adam",
        &path,
        &tensor("adam/weights"),
        NARROW,
    );
    // Weights hardly move: their moves are what Adam decides.
    let start = tensor("adam/start");
    let moves = |path: &[f64]| -> Vec<f64> {
        path.iter()
            .zip(start.iter().cycle())
            .map(|(w, s)| w - s)
            .collect()
    };
    let (found, expected): (Vec<f64>, _) = (
        path.iter().map(|&w| f64::from(w)).collect(),
        tensor("adam/weights"),
    );
    assert_eq!(path.len(), rates.len() * count);
    compare(
        "moves of the weights",
        &moves(&found),
        &moves(&expected),
        NARROW,
    );
    for (name, found) in [
        ("first_moment", &adam.first_moment()[..count]),
        ("second_moment", &adam.second_moment()[..count]),
    ] {
        // Entries of very different size, each by itself.
        for (k, expected) in tensor(&format!("adam/{name}")).iter().enumerate() {
            let relative = (f64::from(found[k]) / expected - 1.0).abs();
            assert!(relative <= NARROW, "{name} {k}: {relative:e}");
        }
        compare(name, found, &tensor(&format!("adam/{name}")), NARROW);
    }
}

#[test]
fn clipping_is_pytorchs() {
    let expected = tensor("clip/gradient");
    let mut gradient = narrow(&tensor("adam/gradients")[..expected.len()]);
    let norm = clip_norm(&mut gradient, 3.0);
    compare("norm of a gradient", &[norm], &tensor("clip/norm"), WIDE);
    // PyTorch adds 1e-6 to the norm before it divides.
    compare("clipped gradient", &gradient, &expected, NARROW);
}

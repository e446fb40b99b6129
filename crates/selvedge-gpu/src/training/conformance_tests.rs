//! Comparison of a training on a GPU with the same training on the processor: the gradient of
//! the first step, and the losses of all steps from one seed.

use selvedge_train::{EngineMaker, LossTerms, OnProcessor, StepReport, TrainError, Trainer};

use crate::training::OnGpu;

/// Relative differences of a training on a GPU from the one on the processor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TrainingCheck {
    /// The gradient of the first step, relative to its length.
    pub(crate) gradient: f64,
    /// The largest difference of a term of the first loss.
    pub(crate) first_loss: f64,
    /// The largest difference of the loss of a step.
    pub(crate) losses: f64,
    /// The weights at the end, relative to the way they have come.
    pub(crate) weights: f64,
}

/// Takes `steps` steps of the training that `make` makes, on the GPU and on the processor.
///
/// # Errors
/// When a training cannot be made, or a step fails.
pub(crate) fn training(
    on_gpu: &OnGpu,
    make: &mut dyn FnMut(&dyn EngineMaker) -> Result<Trainer, TrainError>,
    steps: usize,
) -> Result<TrainingCheck, TrainError> {
    let (mut cpu, mut other) = (make(&OnProcessor::default())?, make(on_gpu)?);
    let start = cpu.learned().weights.clone();
    let mut check = TrainingCheck::default();
    for step in 0..steps {
        let [expected, found] = [cpu.step()?, other.step()?];
        if step == 0 {
            check.first_loss = loss_apart(&expected, &found);
            check.gradient = apart(&other.gradient()?, &cpu.gradient()?, &[]);
        }
        let [found, expected] = [found, expected].map(|report| report.terms.total);
        check.losses = worse(check.losses, (found - expected).abs() / expected.abs());
    }
    other.collect()?;
    let [found, expected] = [&other, &cpu].map(|trainer| &trainer.learned().weights[..]);
    check.weights = apart(found, expected, &start);
    Ok(check)
}

/// The largest relative difference of a term.
fn loss_apart(expected: &StepReport, found: &StepReport) -> f64 {
    let terms = |report: &StepReport| {
        let LossTerms {
            total,
            acceleration,
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
        } = report.terms;
        [
            Some(total),
            Some(acceleration),
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
        ]
    };
    let pairs = terms(expected).into_iter().zip(terms(found));
    let off = pairs.map(|(expected, found)| match (expected, found) {
        (Some(expected), Some(found)) => (found - expected).abs() / expected.abs().max(1e-30),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    });
    off.fold(0.0, worse)
}

/// The larger number; NaN where one of them is.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        return f64::NAN;
    }
    a.max(b)
}

/// |found - expected| / |expected - start|, where start is zero if it is empty.
fn apart(found: &[f32], expected: &[f32], start: &[f32]) -> f64 {
    let length = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let difference = |(a, b): (&f32, &f32)| f64::from(*a) - f64::from(*b);
    let off = length(&mut found.iter().zip(expected).map(difference));
    let zeros = std::iter::repeat(&0.0);
    let size = length(
        &mut expected
            .iter()
            .zip(start.iter().chain(zeros))
            .map(difference),
    );
    off / size.max(f64::MIN_POSITIVE)
}

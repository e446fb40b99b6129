//! Gradients of whole micro-batches are the same for slots together and apart; a cap of the loss.

use selvedge_data::SectionRule;
use selvedge_model::Encoder;

use crate::config::TrainConfig;
use crate::engine::OnProcessor;
use crate::losses::LossTerms;
use crate::test_data::{ENGINE, Swinging, busy, config, swinging, through, two_cloths};
use crate::trainer::Trainer;

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
        let mut cfg = through(frames, busy(encoder));
        cfg.batch.samples = 5;
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

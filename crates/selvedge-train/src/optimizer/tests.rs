//! Adam against its definition, clipping, and what is refused.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn adam(count: usize) -> Adam {
    Adam::new(AdamSettings::default(), count).expect("valid settings")
}

#[test]
fn steps_match_the_obvious_version_in_f64() {
    // More than a chunk, and gradients of very different size.
    let count = CHUNK + 77;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let sizes: Vec<f32> = (0..count)
        .map(|_| 10_f32.powf(8.0 * rng.random::<f32>() - 7.0))
        .collect();
    let mut parameters: Vec<f32> = (0..count).map(|_| rng.random::<f32>() - 0.5).collect();
    let mut slow: Vec<[f64; 3]> = parameters
        .iter()
        .map(|&p| [f64::from(p), 0.0, 0.0])
        .collect();
    let mut adam = adam(count);
    for step in 1..=30 {
        let gradient: Vec<f32> = sizes
            .iter()
            .map(|s| s * (rng.random::<f32>() - 0.4))
            .collect();
        adam.step(&mut parameters, &gradient, 1e-3);
        for ([p, m, v], &g) in slow.iter_mut().zip(&gradient) {
            let g = f64::from(g);
            *m = 0.9 * *m + 0.1 * g;
            *v = 0.999 * *v + 0.001 * g * g;
            let corrected = (*v / (1.0 - 0.999_f64.powi(step))).sqrt();
            *p -= 1e-3 * (*m / (1.0 - 0.9_f64.powi(step))) / (corrected + 1e-8);
        }
    }
    for (found, [expected, ..]) in parameters.iter().zip(&slow) {
        // 30 roundings of a parameter below 1, and 1e-6 of moves of 1e-3.
        assert!((f64::from(*found) - expected).abs() < 1e-6);
    }
}

#[test]
fn clipping_keeps_direction_and_caps_length() {
    let count = 2 * CHUNK + 5;
    let start: Vec<f32> = (0..count).map(|k| (k % 7) as f32 - 3.0).collect();
    let exact = start.iter().map(|&g| f64::from(g * g)).sum::<f64>().sqrt();
    let mut gradient = start.clone();
    assert_eq!(clip_norm(&mut gradient, 2.0 * exact), exact);
    assert_eq!(gradient, start);
    clip_norm(&mut gradient, 1.0);
    let factor = 1.0 / exact;
    for (found, &g) in gradient.iter().zip(&start) {
        assert!((f64::from(*found) - factor * f64::from(g)).abs() <= 2e-7 * factor * 3.0);
    }
    let mut broken = [f32::NAN, 5.0];
    assert!(clip_norm(&mut broken, 1.0).is_nan());
    assert_eq!(broken[1], 5.0);
}

#[test]
fn settings_and_saved_moments_are_checked() {
    let settings = |beta2| AdamSettings {
        beta2,
        ..AdamSettings::default()
    };
    let message = Adam::new(settings(1.0), 3)
        .expect_err("no memory")
        .to_string();
    assert_eq!(
        message,
        "optimizer.beta2 must be at least 0 and below 1, found 1"
    );
    let resume = |m: &[f32], v: &[f32]| {
        let result = Adam::resume(AdamSettings::default(), m.to_vec(), v.to_vec(), 1);
        result.expect_err("a defect").to_string()
    };
    assert!(resume(&[0.0], &[]).contains("second moment must be of 1 parameters, found 0"));
    assert!(resume(&[f32::NAN], &[0.0]).contains("first moment must be finite"));
    assert!(resume(&[0.0], &[-1.0]).contains("not negative, found -1 at entry 0"));
}

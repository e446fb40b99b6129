//! What is clipped, and what is refused. The steps of Adam and clipped gradients are compared with
//! PyTorch's in `tests/pytorch.rs`.

use super::*;

#[test]
fn clipping_caps_the_length_of_what_is_longer_and_finite() {
    let count = 2 * CHUNK + 5;
    let start: Vec<f32> = (0..count).map(|k| (k % 7) as f32 - 3.0).collect();
    let length = |x: &[f32]| x.iter().map(|&g| f64::from(g * g)).sum::<f64>().sqrt();
    let (mut gradient, exact) = (start.clone(), length(&start));
    assert_eq!(clip_norm(&mut gradient, 2.0 * exact), exact);
    assert_eq!(gradient, start);
    clip_norm(&mut gradient, 1.0);
    assert!((length(&gradient) - 1.0).abs() < 2e-7);
    let mut broken = [f32::NAN, 5.0];
    assert!(clip_norm(&mut broken, 1.0).is_nan());
    assert_eq!(broken[1], 5.0);
}

#[test]
fn saved_moments_are_checked() {
    let resume = |m: &[f32], v: &[f32]| {
        let result = Adam::resume(AdamSettings::default(), m.to_vec(), v.to_vec(), 1);
        result.expect_err("a defect").to_string()
    };
    assert!(resume(&[0.0], &[]).contains("second moment must be of 1 parameters, found 0"));
    assert!(resume(&[f32::NAN], &[0.0]).contains("first moment must be finite"));
    assert!(resume(&[0.0], &[-1.0]).contains("not negative, found -1 at entry 0"));
}

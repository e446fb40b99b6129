//! Lengths and shares as people read them.

/// A length `[m]` as people read it: with two or three digits that matter.
pub fn length(metres: f64) -> String {
    match metres.abs() {
        f64::INFINITY => "beyond measure".to_owned(),
        1e4.. => format!("{metres:.1e} m"),
        10.0.. => format!("{metres:.1} m"),
        0.01.. => format!("{:.1} mm", 1e3 * metres),
        most if most > 0.0 && most < 1e-5 => format!("{metres:.2e} m"),
        _ => format!("{:.3} mm", 1e3 * metres),
    }
}

/// A fraction as percent; as a multiple where it is more than ten.
pub fn percent(fraction: f64) -> String {
    match fraction.abs() {
        f64::INFINITY => "beyond measure".to_owned(),
        most if most.is_nan() => "not a number".to_owned(),
        1e4.. => format!("{fraction:.1e} ×"),
        10.0.. => format!("{fraction:.1} ×"),
        _ => format!("{:.1} %", 1e2 * fraction),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_the_digits_that_matter() {
        let lengths = [0.0, 2.0e-8, 0.000_123_4, 0.024_68, -0.5, 78.125, 2e6];
        let expected = [
            "0.000 mm",
            "2.00e-8 m",
            "0.123 mm",
            "24.7 mm",
            "-500.0 mm",
            "78.1 m",
            "2.0e6 m",
        ];
        assert_eq!(lengths.map(length), expected);
        let fractions = [0.1193, 9.99, 12.34, 1e5];
        let expected = ["11.9 %", "999.0 %", "12.3 ×", "1.0e5 ×"];
        assert_eq!(fractions.map(percent), expected);
        assert!(length(f64::NAN).contains("NaN"));
        assert_eq!(length(f64::INFINITY), "beyond measure");
        assert_eq!(percent(f64::NEG_INFINITY), "beyond measure");
        assert_eq!(percent(f64::NAN), "not a number");
    }
}

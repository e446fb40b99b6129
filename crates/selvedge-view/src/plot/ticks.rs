//! The marks of an axis and their labels: round numbers, 1, 2 or 5 times a power of ten.

/// An axis from `start` to `end` with marks at `at`; on a logarithmic one all three are powers of
/// 10.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ticks {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) at: Vec<f64>,
}

/// Marks on a linear axis, four to nine of them, whose ends are marks; `low` is at most `high`.
pub(super) fn linear(low: f64, high: f64) -> Ticks {
    let span = if high > low { high - low } else { high.abs().max(1.0) };
    let high = low + span;
    let rough = span / 5.0;
    let power = 10_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= rough);
    let step = factor.unwrap_or(10.0) * power;
    let first = (low / step + 1e-9).floor();
    let last = (high / step - 1e-9).ceil().max(first + 1.0);
    let count = (last - first).round() as usize;
    Ticks {
        start: first * step,
        end: last * step,
        at: (0..=count).map(|k| (first + k as f64) * step).collect(),
    }
}

/// Marks on a logarithmic axis around 10^`low` to 10^`high`: at 1, 2 and 5 times powers of ten over
/// two decades or less, otherwise at every power or every few.
pub(super) fn logarithmic(low: f64, high: f64) -> Ticks {
    let high = high.max(low + 0.1);
    let (first, last) = (low.floor() as i32, high.ceil() as i32);
    let every = ((last - first) / 10 + 1) as usize;
    let factors: &[f64] = if high - low <= 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let powers = (first..=last).step_by(every);
    let all = powers.flat_map(|power| factors.iter().map(move |f| f64::from(power) + f.log10()));
    let all: Vec<f64> = all.collect();
    // The axis ends at the marks just outside of the values.
    let is_below = |mark: &&f64| **mark <= low + 1e-9;
    let is_above = |mark: &&f64| **mark >= high - 1e-9;
    let start = all.iter().rev().find(is_below).copied().unwrap_or(low);
    let end = all.iter().find(is_above).copied().unwrap_or(high);
    let shown = all.into_iter().filter(|mark| (start..=end).contains(mark));
    Ticks {
        start,
        end,
        at: shown.collect(),
    }
}

/// A number as it stands beside its mark.
pub(super) fn label(value: f64) -> String {
    let size = value.abs();
    if size < 1e-12 {
        "0".to_owned()
    } else if (1e-3..1e5).contains(&size) {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.0e}")
    }
}

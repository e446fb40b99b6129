//! Numbers to colour a cloth by: one per vertex and frame, and the range that the colours span.

use glam::Vec3;

use super::run::Run;
use crate::ViewError;

/// One number per vertex and frame, and the range that the colours span.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarField {
    name: String,
    values: Vec<Vec<f32>>,
    range: [f32; 2],
}

impl ScalarField {
    /// `values`, `[frames, vertices]`, under a `name` with its unit, as `error [mm]`. The colours
    /// span 0 to the largest value, rounded up to a number that reads well.
    pub fn new(name: impl Into<String>, values: Vec<Vec<f32>>) -> Result<Self, ViewError> {
        let name = name.into();
        if values.is_empty() {
            return Err(ViewError::empty_run());
        }
        for (frame, of_frame) in values.iter().enumerate() {
            if let Some(vertex) = of_frame.iter().position(|value| !value.is_finite()) {
                let value = of_frame[vertex];
                return Err(ViewError::Invalid(format!(
                    "frame {frame}: the value of {name} at vertex {vertex} is not finite: {value}"
                )));
            }
        }
        let largest = values.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
        Ok(Self {
            name,
            values,
            range: [0.0, round_up(largest)],
        })
    }

    /// The distance of each vertex of `prediction` from the same vertex of `truth` `[mm]`.
    pub fn distance(truth: &Run<'_>, prediction: &Run<'_>) -> Result<Self, ViewError> {
        truth.check_match(prediction, ["truth", "prediction"])?;
        let of_frame = |(a, b): (&&[Vec3], &&[Vec3])| {
            let pairs = a.iter().zip(*b);
            pairs.map(|(p, q)| 1e3 * p.distance(*q)).collect()
        };
        let frames = truth.frames().iter().zip(prediction.frames());
        Self::new("distance from truth [mm]", frames.map(of_frame).collect())
    }

    /// The name of the numbers, with the unit.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The values, `[frames, vertices]`.
    pub fn values(&self) -> &[Vec<f32>] {
        &self.values
    }

    /// The values at both ends of the colours.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Checks that there is a value for each vertex and frame of `run`.
    pub(crate) fn check_fits(&self, run: &Run<'_>) -> Result<(), ViewError> {
        let check = |what, expected: usize, found: usize| {
            if expected == found {
                return Ok(());
            }
            Err(ViewError::Invalid(format!(
                "the values of {} have {found} {what}, but the run has {expected}: give one value per vertex and frame",
                self.name
            )))
        };
        check("frames", run.frames().len(), self.values.len())?;
        let expected = run.topology().vertex_count();
        let mut counts = self.values.iter().map(Vec::len);
        counts.try_for_each(|found| check("vertices", expected, found))
    }
}

/// The smallest of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not below `value`; 1 for
/// 0.
fn round_up(value: f32) -> f32 {
    if value <= 0.0 {
        return 1.0;
    }
    let power = 10.0_f64.powf(f64::from(value).log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let mut rounded = steps.into_iter().map(|step| (step * power) as f32);
    rounded.find(|&rounded| rounded >= value).unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use selvedge_cloth::Topology;

    #[test]
    fn distance_is_in_millimetres_and_its_range_reads_well() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let truth = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let moved = truth.map(|p| p + Vec3::new(0.003, 0.0, 0.004));
        let a = Run::new(&topology, [&truth[..]], &[], 60.0).unwrap();
        let b = Run::new(&topology, [&moved[..]], &[], 60.0).unwrap();
        let field = ScalarField::distance(&a, &b).unwrap();
        for value in &field.values()[0] {
            // 3-4-5; positions near 1 m carry 6e-8 m of rounding, that is 1e-4 mm.
            assert!((value - 5.0).abs() < 2e-4, "{value}");
        }
        assert!(field.range()[1] >= 4.999 && field.range()[1] <= 6.0);
        let rounded = [0.0, 0.9, 1.0, 1.2, 7.0, 450.0].map(round_up);
        assert_eq!(rounded, [1.0, 1.0, 1.0, 1.5, 8.0, 500.0]);
    }

    #[test]
    fn values_must_be_finite() {
        let field = ScalarField::new("strain", vec![vec![0.0], vec![f32::NAN]]);
        let words = "frame 1: the value of strain at vertex 0 is not finite: NaN";
        assert_eq!(field.unwrap_err().to_string(), words);
    }
}

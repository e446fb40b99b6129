//! Panels: a run with a label and a colouring; and the checks of panels that stand side by side.

use super::run::Run;
use crate::{ScalarField, ViewError};

/// A run with the label and the colours in which it is shown.
#[derive(Clone, Copy, Debug)]
pub struct Panel<'a> {
    /// The text above it where several panels are shown together; may be empty.
    pub label: &'a str,
    /// The motion.
    pub run: &'a Run<'a>,
    /// The number per vertex that it is coloured by; without, it is drawn as cloth: in the colour of
    /// the run, or indigo in front and ecru at the back.
    pub field: Option<&'a ScalarField>,
}

impl<'a> Panel<'a> {
    /// A run drawn as cloth, without a label.
    pub fn of(run: &'a Run<'a>) -> Self {
        Self {
            label: "",
            run,
            field: None,
        }
    }
}

/// Checks that there are panels, that they run at one clock, and that their values fit.
pub(crate) fn check_panels(panels: &[Panel<'_>]) -> Result<(), ViewError> {
    let first = panels.first().ok_or_else(ViewError::no_panels)?;
    for panel in panels {
        let labels = [first.label, panel.label];
        first.run.check_clock(panel.run, labels)?;
        if let Some(field) = panel.field {
            field.check_fits(panel.run)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use selvedge_cloth::Topology;

    #[test]
    fn panels_side_by_side_must_match() {
        let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let still = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let short = Run::new(&topology, [&still[..]], &[], 60.0).unwrap();
        let long = Run::new(&topology, [&still[..], &still[..]], &[], 60.0).unwrap();
        let field = ScalarField::new("error", vec![vec![0.0; 2]; 2]).unwrap();
        let panel = |label, run, field| Panel { label, run, field };
        let two = [panel("a", &short, None), panel("b", &long, None)];
        let coloured = [panel("b", &long, Some(&field))];
        let unequal =
            "panel \"b\" has 2 frames, but panel \"a\" has 1: panels side by side must match";
        for (panels, words) in [
            (&two[..], unequal),
            (&[], "no panels were given"),
            (&coloured, "2 vertices, but the run has 3"),
        ] {
            let text = check_panels(panels).unwrap_err().to_string();
            assert!(text.contains(words), "{text}");
        }
    }
}

//! Fitting the cloth of a scene into its pattern, and the word on what is left of its strain.

use std::ops::ControlFlow;

use selvedge_data::{LoadedScene, Times, panel_stretches, worst_free_edges};
use selvedge_sim::{FitError, FitProgress, Fitted, fit as fit_cloth, sew_and_fit};
use thiserror::Error;

use crate::event::{Goal, Reporter};
use crate::numbers::percent;

/// Strain that a fit may leave without a word.
const LEFT: f64 = 0.1;
/// Strain from which a fitted cloth is not run: no fabric stretches to more than its double, and
/// the physics would fling it about.
const MOST: f64 = 1.0;
/// Edges that a message names.
const NAMED: usize = 3;
/// Median stretch of a panel's edges at the start, or its inverse, from which the panel is named.
const ODD_PANEL: f64 = 1.5;

/// Reason why a cloth was not fitted.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FittingError {
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(
        "the cloth of scene {scene:?} does not fit into its pattern: {left}; {panels}mend the pattern or the handles, let mesh.texture = \"fit\" size each panel as it stands, take the form in space for the pattern with mesh.pattern = \"shape\", or start where the mesh stands (start = \"mesh\")"
    )]
    Unfit {
        scene: String,
        left: String,
        panels: String,
    },
}

/// A cloth in its pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedCloth {
    /// The cloth.
    pub fitted: Fitted,
    /// A warning of strain that is left.
    pub warning: Option<String>,
}

/// Relaxes the cloth of a scene into its pattern; where its panels are loose, they are sewn first.
pub(crate) fn fit(
    loaded: &LoadedScene,
    reporter: &Reporter<'_>,
) -> Result<FittedCloth, FittingError> {
    const STEPS: f64 = 100.0;
    let what = match loaded.loose {
        Some(_) => "sewing and fitting into the pattern",
        None => "fitting into the pattern",
    };
    let task = reporter.begin(what, Goal::Count(STEPS as u64), "steps");
    let mut done = 0.0;
    fit_told(loaded, &mut |now| {
        let open = match now.gap {
            Some(gap) => format!("seams open by {:.1} cm, ", 100.0 * gap),
            None => String::new(),
        };
        task.note(&format!("{open}largest strain {}", percent(now.strain)));
        while done < STEPS * now.done {
            done += 1.0;
            task.advance()?;
        }
        match task.is_stopped() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })
}

/// Relaxes the cloth of a scene into its pattern, with the progress as it is.
pub fn fit_told(
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
) -> Result<FittedCloth, FittingError> {
    let scene = &loaded.scene;
    let fitted = match &loaded.loose {
        Some(loose) => sew_and_fit(scene, loose, progress)?,
        None => fit_cloth(scene, progress)?,
    };
    if fitted.after <= LEFT {
        let warning = None;
        return Ok(FittedCloth { fitted, warning });
    }
    let worst = worst_free_edges(&scene.mesh, &scene.handles, &fitted.positions, NAMED);
    let named: Vec<String> = worst.iter().map(ToString::to_string).collect();
    let left = format!(
        "strains of up to {} are left ({} before), the worst edges are {}",
        percent(fitted.after),
        percent(fitted.before),
        named.join(", ")
    );
    if fitted.after > MOST {
        return Err(FittingError::Unfit {
            scene: scene.name.clone(),
            left,
            panels: odd_panels(loaded),
        });
    }
    let warning = format!(
        "the cloth does not fit into its pattern: {left}; look at these panels, or at handles that are too far apart"
    );
    Ok(FittedCloth {
        fitted,
        warning: Some(warning),
    })
}

/// Names of panels that are drawn in another size than the mesh has.
fn odd_panels(loaded: &LoadedScene) -> String {
    let mesh = &loaded.scene.mesh;
    let stretches = panel_stretches(mesh, mesh.positions());
    let odd: Vec<String> = (0..)
        .zip(&stretches)
        .filter(|(_, stretch)| !(1.0 / ODD_PANEL..=ODD_PANEL).contains(*stretch))
        .take(NAMED)
        .map(|(panel, stretch): (usize, &f64)| {
            format!(
                "the edges of panel {panel} are {} as long as drawn (median); ",
                Times(*stretch)
            )
        })
        .collect();
    odd.concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use selvedge_data::parse_scene;

    /// A flat bag of two squares that are sewn all round, each of four faces about its middle; the
    /// second is drawn `by` times as small.
    fn scene(by: f64) -> LoadedScene {
        let folder = tempfile::tempdir().unwrap();
        let mut text =
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0\nv 0.5 0.5 -0.01\n".to_owned();
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        for (shift, by) in [(0.0, 1.0), (5.0, by)] {
            for [u, v] in square {
                text += &format!("vt {} {}\n", shift + u / by, v / by);
            }
        }
        for k in 1..=4 {
            let next = k % 4 + 1;
            text += &format!("f {k}/{k} {next}/{next} 5/5\n");
            text += &format!("f {next}/{} {k}/{} 6/10\n", next + 5, k + 5);
        }
        std::fs::write(folder.path().join("bag.obj"), text).unwrap();
        let scene = "name = \"bag\"\nmaterial = \"gray-interlock\"\nstart = \"fit\"\n\
            mesh = { file = \"bag.obj\" }\nhandles = { vertices = [0] }\nmotion = { named = \"forward\" }\ncontact = false\n";
        parse_scene(scene, folder.path(), "bag").unwrap()
    }

    #[test]
    fn a_panel_of_another_size_is_refused_with_its_name_and_one_that_is_eased_is_warned_of() {
        let mut go_on = |_| ControlFlow::Continue(());
        let fits = fit_told(&scene(1.02), &mut go_on).unwrap();
        assert!(fits.warning.is_none() && fits.fitted.after < LEFT);
        let eased = fit_told(&scene(1.6), &mut go_on).unwrap();
        assert!(eased.warning.unwrap().contains("the worst edges are"));
        let refused = fit_told(&scene(20.0), &mut go_on).unwrap_err().to_string();
        for words in [
            "scene \"bag\"",
            "panel 1 are",
            "mesh.texture = \"fit\"",
            "start = \"mesh\"",
        ] {
            assert!(refused.contains(words), "{refused}");
        }
    }
}

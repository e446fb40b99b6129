//! The cloth of a scene made ready from its mesh: moved apart, put onto a body, fitted into its
//! pattern; and the word on what is left of its strain.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{LoosePanels, Mesh, Scene};
use selvedge_data::{StartSpec, Times, panel_stretches, worst_edges};
use selvedge_sim::{FitError, FitProgress, Fitted, dress, fit as fit_cloth, sew_and_fit, untangle};

use crate::Error;
use crate::event::{self, Event, Goal};
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

/// What is done to the cloth before its motion begins.
#[derive(Clone, Debug)]
pub(crate) struct Making {
    pub(crate) start: StartSpec,
    /// The body that it is put onto.
    pub(crate) dress: Option<String>,
    /// Its panels before they are sewn.
    pub(crate) loose: Option<LoosePanels>,
}

/// A cloth made ready from its mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FittedCloth {
    /// Positions `[m]`, `[vertices]`.
    pub(crate) positions: Vec<DVec3>,
    /// What was done.
    pub(crate) remarks: Vec<String>,
    /// Warnings of strain that is left, and of openings around nothing.
    pub(crate) warnings: Vec<String>,
}

/// A listener of each stage, by its name and progress.
type Listener<'a> = &'a mut dyn FnMut(&'static str, FitProgress) -> ControlFlow<()>;

/// Makes the cloth of a scene ready as [`fit_told`] does.
pub(crate) fn fit(
    scene: &Scene,
    making: &Making,
    on_event: &mut event::Listener<'_>,
) -> Result<FittedCloth, Error> {
    const STEPS: f64 = 100.0;
    let (mut stage, mut done) = ("", 0.0);
    let fitted = fit_told(scene, making, &mut |task, now| {
        if stage != task {
            if !stage.is_empty() {
                let _ = on_event(Event::Ended);
            }
            let (goal, unit) = (Goal::Count(STEPS as u64), "steps");
            let _ = on_event(Event::Begun { task, goal, unit });
            (stage, done) = (task, 0.0);
        }
        let _ = on_event(Event::Noted(&state(now)));
        while done < STEPS * now.done {
            done += 1.0;
            on_event(Event::Advanced)?;
        }
        on_event(Event::Asked)
    });
    if !stage.is_empty() {
        let _ = on_event(Event::Ended);
    }
    fitted
}

/// What a cloth under way is like.
fn state(now: FitProgress) -> String {
    let strain = percent(now.strain);
    match (now.meeting, now.gap) {
        (Some(pairs), _) => format!("{pairs} pairs of faces meet"),
        (None, Some(gap)) => format!(
            "seams open by {:.1} cm, largest strain {strain}",
            100.0 * gap
        ),
        (None, None) => format!("largest strain {strain}"),
    }
}

/// Makes the cloth of a scene ready from its mesh, as its start says: moved apart where it meets
/// itself, put onto a body, and relaxed into its pattern; where its panels are loose, they are sewn
/// first.
fn fit_told(own: &Scene, making: &Making, progress: Listener<'_>) -> Result<FittedCloth, Error> {
    let mut scene = own.clone();
    let (mut remarks, mut warnings) = (Vec::new(), Vec::new());
    let start = &making.start;
    let meets_itself = scene.contact.is_some_and(|contact| contact.self_contact);
    if *start == StartSpec::Untangle || *start == StartSpec::Fit && meets_itself {
        let found = untangle(&scene, &mut |now| progress("untangling", now))?;
        if found.before > 0 {
            remarks.push(format!(
                "untangled: the cloth met itself at {} pairs of faces; {} vertices were moved, by up to {:.1} mm",
                found.before,
                found.moved,
                1e3 * found.farthest
            ));
            scene.mesh = at(scene.mesh, found.positions)?;
        }
    }
    if let Some(body) = &making.dress {
        let dressed = dress(&scene, body, &mut |now| progress("dressing", now))?;
        let [before, after] = dressed.strains.map(percent);
        remarks.push(format!(
            "dressed: {body:?} met the cloth at {} pairs of faces, shrank by {:.0} mm and grew back; the largest strain went from {before} to {after}",
            dressed.before,
            1e3 * dressed.shrunk
        ));
        warnings.extend(dressed.empty.iter().map(|opening| {
            format!("dress: {opening}: if a limb belongs there, move the cloth (mesh.transform) or let the body stand with its arms out")
        }));
        scene.mesh = at(scene.mesh, dressed.positions)?;
    }
    if *start != StartSpec::Fit {
        return Ok(FittedCloth {
            positions: scene.mesh.positions().to_vec(),
            remarks,
            warnings,
        });
    }
    let fitted = match &making.loose {
        Some(loose) => sew_and_fit(&scene, loose, &mut |now| {
            progress("sewing and fitting into the pattern", now)
        })?,
        None => fit_cloth(&scene, &mut |now| progress("fitting into the pattern", now))?,
    };
    if let Some(gap) = fitted.gap {
        remarks.push(format!("sewn: the seams were up to {gap:.3} m open"));
    }
    let [before, after] = [fitted.before, fitted.after].map(percent);
    remarks.push(format!(
        "fitted into the pattern: the largest strain went from {before} to {after}"
    ));
    warnings.extend(left(own, &fitted)?);
    Ok(FittedCloth {
        positions: fitted.positions,
        remarks,
        warnings,
    })
}

/// A mesh that stands elsewhere.
fn at(mesh: Mesh, positions: Vec<DVec3>) -> Result<Mesh, FitError> {
    mesh.with_positions(positions)
        .map_err(|error| FitError::Solve {
            cause: error.to_string(),
        })
}

/// A warning of the strain that a fit left; an error where that is too much.
fn left(scene: &Scene, fitted: &Fitted) -> Result<Option<String>, Error> {
    if fitted.after <= LEFT {
        return Ok(None);
    }
    let worst = worst_edges(&scene.mesh, &scene.handles, &fitted.positions, NAMED);
    let named: Vec<String> = worst.iter().map(ToString::to_string).collect();
    let left = format!(
        "strains of up to {} are left ({} before), the worst edges are {}",
        percent(fitted.after),
        percent(fitted.before),
        named.join(", ")
    );
    if fitted.after > MOST {
        return Err(Error::Misfit(format!(
            "the cloth of scene {:?} does not fit into its pattern: {left}; {}mend the pattern or the handles, let mesh.texture = \"fit\" size each panel as it stands, take the form in space for the pattern with mesh.pattern = \"shape\", or start where the mesh stands (start = \"mesh\")",
            scene.name,
            odd_panels(scene)
        )));
    }
    Ok(Some(format!(
        "the cloth does not fit into its pattern: {left}; look at these panels, or at handles that are too far apart"
    )))
}

/// Names of panels that are drawn in another size than the mesh has.
fn odd_panels(scene: &Scene) -> String {
    let mesh = &scene.mesh;
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

#[cfg(all(test, feature = "learned"))]
mod tests {
    use super::*;
    use selvedge_data::parse_scene;

    /// A flat bag of two squares that are sewn all round, each of four faces about its middle; the
    /// second is drawn `by` times as small.
    fn scene(by: f64) -> (Scene, Making) {
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
        let loaded = parse_scene(scene, folder.path(), "bag").unwrap();
        let making = Making {
            start: loaded.spec.start,
            dress: loaded.spec.dress,
            loose: loaded.loose,
        };
        (loaded.scene, making)
    }

    #[test]
    fn a_panel_of_another_size_is_refused_with_its_name_and_one_that_is_eased_is_warned_of() {
        let fit_of = |by: f64| {
            let (scene, making) = scene(by);
            fit_told(&scene, &making, &mut |_: &str, _| ControlFlow::Continue(()))
        };
        let fits = fit_of(1.02).unwrap();
        assert!(fits.warnings.is_empty() && fits.remarks.len() == 1);
        let eased = fit_of(1.6).unwrap();
        assert!(eased.warnings[0].contains("the worst edges are"));
        let refused = fit_of(20.0).unwrap_err().to_string();
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

//! Many runs, moved side by side.

use rayon::prelude::*;
use selvedge_cloth::{HandleTargets, StepError};

use crate::run::Run;

/// Moves every run by a frame, side by side on the threads of rayon's pool: its handles to its own of
/// `targets`, or where that is none, or missing, along the motion of its scene. Frames have the bytes
/// of runs that are moved one by one; a run whose step failed is as it was before.
pub fn step_all(runs: &mut [Run], targets: &[Option<HandleTargets>]) -> Vec<Result<(), StepError>> {
    let step = |(number, run): (usize, &mut Run)| match targets.get(number) {
        Some(Some(targets)) => run.step_to(targets),
        _ => run.step(),
    };
    runs.par_iter_mut().enumerate().map(step).collect()
}

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "the figures, for the docs")]
mod tests {
    use glam::DVec3;
    use selvedge_cloth::{
        Compression, ContactSettings, Handles, Isotropic, Material, Obstacle, Scene as Built,
        bodies, generate,
    };

    use super::*;
    use crate::{Scene, Stepper as _};

    /// A sheet of 0.3 m, held at two corners, or lying on a box with its top at the origin.
    fn scene(lies: bool) -> Scene {
        let sheet = generate::square(49, 0.3, 1).unwrap();
        let elastic = Isotropic {
            youngs_modulus: 1e5,
            poissons_ratio: 0.3,
            thickness: 5e-4,
        };
        let material = Material {
            name: "sheet".to_owned(),
            source: String::new(),
            density: 0.2,
            damping: 0.0,
            stretch: elastic.stretch_table(),
            bend: elastic.bend_table(),
            compression: Compression::default(),
        };
        let held = if lies { &[][..] } else { &sheet.labels["upper-corners"][..] };
        let handles = Handles::new(held, 49).unwrap();
        let flat = sheet.mesh.positions().iter();
        let flat = flat.map(|p| DVec3::new(p.y, 9e-4, p.z)).collect();
        let mesh = if lies { sheet.mesh.with_positions(flat).unwrap() } else { sheet.mesh };
        let mut scene = Built::of("sheet", mesh, handles, material);
        if lies {
            let body = bodies::cuboid(DVec3::new(2.0, 0.1, 2.0));
            let points = body.points.iter().map(|p| *p - DVec3::Y * 0.05).collect();
            scene.obstacles = vec![Obstacle::new("box", points, body.faces).unwrap()];
            scene.contact = Some(ContactSettings::default());
        }
        Scene::of(scene)
    }

    #[test]
    fn worlds_side_by_side_have_the_bytes_of_one_by_one() {
        let scene = scene(false);
        let new = || Run::new(&scene).unwrap();
        let (mut worlds, mut alone): (Vec<_>, Vec<_>) = (0..3).map(|_| (new(), new())).unzip();
        let beginning = worlds[1].snapshot().unwrap();
        for frame in 0..4 {
            let targets = |run: &Run, world: usize| {
                let way = DVec3::X * (1e-3 * (world * (frame + 1)) as f64);
                let places = run.handle_places().iter().map(|p| *p + way).collect();
                (world > 0).then(|| HandleTargets::at_frame_end(places).unwrap())
            };
            let all: Vec<_> = (0..3).map(|world| targets(&worlds[world], world)).collect();
            assert!(step_all(&mut worlds, &all).iter().all(Result::is_ok));
            for (run, targets) in alone.iter_mut().zip(&all) {
                match targets {
                    Some(targets) => run.step_to(targets).unwrap(),
                    None => run.step().unwrap(),
                }
            }
            for (one, other) in worlds.iter().zip(&alone) {
                assert_eq!(one.positions_f64(), other.positions_f64());
            }
            assert_ne!(worlds[0].positions(), worlds[2].positions());
        }
        // One world begins anew, the others go on.
        worlds[1].restore(&beginning).unwrap();
        step_all(&mut worlds, &[]);
        assert_eq!([worlds[0].frame(), worlds[1].frame()], [5, 1]);
    }

    #[test]
    fn a_box_receives_the_weight_of_a_sheet_at_rest_where_that_lies() {
        let mut run = Run::new(&scene(true)).unwrap();
        for _ in 0..120 {
            run.step().unwrap();
        }
        let solver = run.solver().unwrap();
        let masses = solver.vertex_mass().iter();
        let mass: f64 = masses.clone().sum();
        let places = masses.zip(solver.positions_f64()).map(|(m, p)| *m * *p);
        let middle = places.sum::<DVec3>() / mass;
        let force = run.impulses()[0].linear * run.scene().built().frame_rate;
        let weight = run.scene().built().environment.gravity * mass;
        println!("{force} N, weight {weight} N");
        assert!(
            (force - weight).length() < 0.01 * weight.length(),
            "{force}"
        );
        // About the middle of the sheet it has no moment.
        let moment = run.impulses()[0].about(middle) * run.scene().built().frame_rate;
        assert!(moment.length() < 1e-3 * weight.length(), "{moment}");
    }
}

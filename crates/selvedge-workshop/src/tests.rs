//! Orders to the viewer's workshop, and its words where one cannot be had.

use std::ops::ControlFlow;
use std::path::PathBuf;

use glam::DVec3;
use selvedge::machine::Machine;
use selvedge_cloth::{HandleTargets, Handles, Stepper};
use selvedge_live::{
    Influences, LiveError, LiveStepper, MeshOrder, Mover, MoverKind, Order, Start, Workshop,
};

use super::SceneWorkshop;

fn go_on(_: String) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn refused(change: impl FnOnce(&mut Order)) -> String {
    let mut workshop = SceneWorkshop::new("default", &[], Machine::Cpu).unwrap();
    let mut order = workshop.first_order();
    change(&mut order);
    let made = workshop.prepare(&order, &mut go_on);
    made.err().expect("a refusal").to_string()
}

fn mesh(name: &str, vertices: usize) -> Option<MeshOrder> {
    Some(MeshOrder {
        name: name.to_owned(),
        vertices,
    })
}

#[test]
fn a_page_cannot_open_what_was_not_named_at_the_start() {
    assert!(refused(|order| order.scene = "/etc/passwd".to_owned()).contains("no scene"));
    assert!(refused(|order| order.model = "../x.safetensors".to_owned()).contains("no model"));
    assert!(refused(|order| order.material = Some("x.toml".to_owned())).contains("no material"));
    assert!(refused(|order| order.mesh = mesh("x.obj", 289)).contains("no mesh"));
    assert!(refused(|order| order.mesh = mesh("square", 1_000_000)).contains("20 to 4096"));
}

#[test]
fn another_mesh_has_its_own_handles_and_is_said_to_be_beyond_training() {
    let mut workshop = SceneWorkshop::new("default", &[], Machine::Cpu).unwrap();
    let order = Order {
        model: "paper".to_owned(),
        mesh: mesh("triangle-17", 60),
        material: Some("11oz-black-denim".to_owned()),
        ..workshop.first_order()
    };
    let ready = workshop.prepare(&order, &mut go_on).unwrap();
    assert!(ready.cloth.handles().len() > 2);
    assert!(ready.remarks.join("; ").contains("a guess"));
    // The one that it was trained on is not.
    let first = workshop.first_order();
    let ready = workshop.prepare(&first, &mut go_on).unwrap();
    assert!(ready.remarks.is_empty(), "{:?}", ready.remarks);
    assert_eq!(ready.cloth.handles().len(), 2);
}

#[test]
fn hands_beyond_training_are_said_while_the_model_moves_the_cloth() {
    let models = ["paper"].map(PathBuf::from);
    let mut workshop = SceneWorkshop::new("default", &models, Machine::Cpu).unwrap();
    let catalogue = workshop.catalogue();
    assert_eq!(catalogue.models, ["paper"], "once");
    let order = Order {
        model: "paper".to_owned(),
        ..workshop.first_order()
    };
    let ready = workshop.prepare(&order, &mut go_on).unwrap();
    let influences = Influences {
        handles: ready.cloth.handles().clone(),
        environment: ready.environment,
    };
    let at_rest = influences.handles.select(ready.cloth.rest_positions());
    let mut places: Vec<DVec3> = at_rest.iter().map(|p| p.as_dvec3()).collect();
    let remark = |mover, places: &[DVec3]| ready.movers.remark_on(mover, &influences, places);
    assert_eq!(remark(Mover::Model, &places), None);
    places[0].y += 0.6;
    let said = remark(Mover::Model, &places).unwrap();
    assert!(said.contains("different heights"), "{said}");
    assert!(said.contains("solver knows better"), "{said}");
    // The same while it goes on: a remark that changed would be shown anew.
    places[0].y += 0.01;
    assert_eq!(remark(Mover::Model, &places), Some(said));
    assert_eq!(remark(Mover::Physics, &places), None);
}

#[test]
fn a_cloth_whose_rest_pose_is_not_needed_is_shown_without_a_search() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    let name = file.to_string_lossy();
    let prepare = |handles: &str, more: &str, flow: ControlFlow<()>| {
        let text = format!(
            "name = \"hasty\"\nmaterial = \"gray-interlock\"\nmotion = {{ named = \"forward\" }}\n\
             mesh = {{ generator = {{ kind = \"square\", vertices = 60, size = 1.0, seed = 1 }} }}\n\
             handles = {handles}\n{more}"
        );
        std::fs::write(&file, text).unwrap();
        let mut workshop = SceneWorkshop::new(&name, &[], Machine::Cpu).unwrap();
        let order = workshop.first_order();
        let ready = workshop.prepare(&order, &mut |_| flow)?;
        Ok::<_, LiveError>((ready.remarks.join("; "), ready.cloth))
    };
    let (held, on) = ("{ label = \"upper-corners\" }", ControlFlow::Continue(()));
    let hasty = "sag = { max_steps = 3 }\n";
    let from_mesh = format!("{hasty}start = \"mesh\"\n");
    // No search is begun that could fail, or that somebody could stop.
    for flow in [on, ControlFlow::Break(())] {
        let (remarks, cloth) = prepare(held, &from_mesh, flow).unwrap();
        assert!(!remarks.contains("sag"), "{remarks}");
        // As it was generated: flat and upright.
        assert!(cloth.rest_positions().iter().all(|p| p.x == 0.0));
    }
    let problem = prepare(held, hasty, on).unwrap_err().to_string();
    assert!(problem.contains("sag.max_steps"), "{problem}");
    let stopped = prepare(held, hasty, ControlFlow::Break(()));
    let stopped = stopped.unwrap_err().to_string();
    assert!(stopped.contains("stopped"), "{stopped}");
    // Nothing holds it at the start.
    let free = "{ groups = [{ name = \"all\", select = { label = \"upper-corners\" }, \
                released = [{ from = 0.0 }] }] }";
    let (remarks, _) = prepare(free, "", on).unwrap();
    assert!(remarks.contains("nothing holds the cloth"), "{remarks}");
}

/// The solver begins in the rest pose of the scene's own law: a cloth that nobody touches stays.
#[test]
fn a_cloth_that_nobody_touches_stands_still() {
    for scene in ["default", "square-1024"] {
        let mut workshop = SceneWorkshop::new(scene, &[], Machine::Cpu).unwrap();
        let order = workshop.first_order();
        let ready = workshop.prepare(&order, &mut go_on).unwrap();
        let influences = Influences {
            handles: ready.cloth.handles().clone(),
            environment: ready.environment,
        };
        let mut solver = ready
            .movers
            .start(MoverKind::Physics, Start::Beginning, &influences)
            .unwrap();
        let start = solver.positions().to_vec();
        let places = influences.handles.select(&start);
        let still: Vec<DVec3> = places.iter().map(|p| p.as_dvec3()).collect();
        let still = HandleTargets::at_frame_end(still).unwrap();
        for _ in 0..30 {
            solver.step(&still).unwrap();
        }
        let pairs = start.iter().zip(solver.positions());
        let farthest = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        // A rest pose is one to 1e-3 m/s²: half a second of that is 0.1 mm.
        assert!(farthest < 2e-4, "{scene}: {farthest} m");
    }
}

/// A cloth that rests wakes when it is dropped, and when a wind begins.
#[test]
fn a_cloth_that_rests_falls_when_it_is_dropped_and_flutters_when_a_wind_begins() {
    let mut workshop = SceneWorkshop::new("default", &[], Machine::Cpu).unwrap();
    let order = Order {
        touches: true,
        ..workshop.first_order()
    };
    let ready = workshop.prepare(&order, &mut go_on).unwrap();
    let held = Influences {
        handles: ready.cloth.handles().clone(),
        environment: ready.environment,
    };
    let movers = &ready.movers;
    let physics = MoverKind::Physics;
    let mut solver = movers.start(physics, Start::Beginning, &held).unwrap();
    let stay = |solver: &dyn LiveStepper| HandleTargets::at_frame_end(solver.handle_places());
    for _ in 0..90 {
        let still = stay(&*solver).unwrap();
        solver.step(&still).unwrap();
    }
    let free = Handles::new(&[], ready.cloth.vertex_count()).unwrap();
    let dropped = Influences {
        handles: free,
        ..held.clone()
    };
    let mut blown = held.clone();
    blown.environment.wind = DVec3::X * 6.0;
    for changed in [dropped, blown] {
        let mut moved = solver.changed(&changed).unwrap();
        for _ in 0..20 {
            let still = stay(&*moved).unwrap();
            moved.step(&still).unwrap();
        }
        let pairs = solver.positions().iter().zip(moved.positions());
        let farthest = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(farthest > 0.1, "{farthest} m");
    }
}

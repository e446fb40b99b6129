//! Corrected physics keeps the contract of a stepper, and is its base where nothing is corrected.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::conformance::{HandlesEnd, check_correctable, check_stop};
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    Environment, Gust, HandleSchedule, Motion, PhysicsSettings, Release, SagSettings,
};
use selvedge_model::{Encoder, ModelSpec, Network, Normalizer, Normalizers};

use super::*;

const GRAY: &str = selvedge_assets::materials::GRAY_INTERLOCK;
/// Deviation of corrections that do no harm `[m]`.
const SMALL: f64 = 1e-4;
/// Deviation whose corrections no f32 holds `[m]`.
const HUGE: f64 = 1e38;

/// A square that hangs from two corners.
fn hanging() -> Scene {
    let spec = SquareSpec {
        vertices: 25,
        size: 1.0,
        seed: 2,
    };
    let sheet = square(&spec).unwrap();
    Scene {
        name: "hanging".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], 25).unwrap(),
        schedule: HandleSchedule::default(),
        mesh: sheet.mesh,
        material: toml::from_str(GRAY).unwrap(),
        fabrics: Default::default(),
        environment: Environment::default(),
        motion: Motion::still(1.0),
        physics: PhysicsSettings::default(),
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}

fn gusty() -> Scene {
    let mut scene = hanging();
    scene.environment.gust = Some(Gust {
        speed: DVec3::new(3.0, 0.0, 2.0),
        period: 0.2,
        seed: 1,
    });
    scene
}

fn bases() -> [PhysicsBase; 2] {
    [1, 2].map(|substeps| PhysicsBase { substeps })
}

/// An untrained model, whose corrections have the deviation `size`; with `size` 0 it has none, by
/// weights of the last layer that are 0.
fn model(base: PhysicsBase, size: f64) -> Arc<Model> {
    let spec = ModelSpec {
        node_features: Default::default(),
        edge_features: Default::default(),
        base: Some(base),
        ..ModelSpec::physical(Encoder::MLP, 8, 0)
    };
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let network = Network::new(&spec).unwrap();
    let mut weights = network.initialise(&mut || rng.random::<f64>());
    // Without a last layer, or with one whose outputs are many deviations.
    let factor = match size {
        0.0 => 0.0,
        HUGE => 1e6,
        _ => 1.0,
    };
    for name in ["decoder.4.weight", "decoder.4.bias"] {
        let parameters = network.parameters();
        let last = parameters.iter().find(|p| p.name == name).unwrap();
        weights[last.range.clone()]
            .iter_mut()
            .for_each(|w| *w *= factor);
    }
    let even = |width: usize, deviation: f64| {
        Normalizer::new(vec![0.0; width], vec![deviation; width]).unwrap()
    };
    let normalizers = Normalizers {
        nodes: even(spec.node_width(), 10.0),
        edges: even(spec.edge_width(), 10.0),
        acceleration: even(spec.outputs(), if size == 0.0 { SMALL } else { size }),
    };
    Arc::new(Model::new(&spec, weights, normalizers, String::new()).unwrap())
}

fn at_rest(scene: &Scene) -> FrameState {
    FrameState {
        positions: scene.mesh.positions().to_vec(),
        velocities: vec![DVec3::ZERO; scene.mesh.positions().len()],
    }
}

fn stepper(scene: &Scene, base: PhysicsBase, size: f64) -> CorrectedStepper {
    CorrectedStepper::new(model(base, size), scene, at_rest(scene)).unwrap()
}

fn still(scene: &Scene) -> HandleTargets {
    let places = scene.handles.select(scene.mesh.positions());
    HandleTargets::at_frame_end(places).unwrap()
}

#[test]
fn corrected_physics_conforms() {
    for scene in [hanging(), gusty()] {
        for base in bases() {
            let make = || stepper(&scene, base, SMALL);
            let checked = check_correctable(make, HandlesEnd::AtTargets);
            assert_eq!(checked, Ok(()), "{base:?}");
            assert_eq!(check_stop(make), Ok(()), "{base:?}");
        }
    }
}

#[test]
fn a_model_that_corrects_nothing_leaves_its_base() {
    for base in bases() {
        let scene = gusty();
        let targets = still(&scene);
        let physics = base_scene(&scene, base);
        let mut alone = Simulator::new(&physics).unwrap().at_frame(10);
        let mut none = stepper(&scene, base, 0.0).at_frame(10);
        let mut some = stepper(&scene, base, SMALL).at_frame(10);
        for frame in 11..16 {
            alone.step(&targets).unwrap();
            none.step(&targets).unwrap();
            some.step(&targets).unwrap();
            assert_eq!(none.frame(), frame);
            assert_eq!(none.state().positions, alone.positions_f64(), "{base:?}");
            assert_eq!(none.state().velocities, alone.velocities_f64(), "{base:?}");
            // All of it was familiar: it is the weights that are 0.
            let familiar = none.familiarity();
            assert_eq!((familiar.familiar, familiar.largest), (1.0, 0.0));
        }
        // Corrections are in parts of a scale, which is small where little moves.
        assert!(some.familiarity().largest > 1e-6 * SMALL, "{base:?}");
        assert_ne!(some.positions(), none.positions());
    }
}

/// Frames beyond what a model was trained on are those of its base, to the bit, and the network
/// goes on with the first one that is within it.
#[test]
fn frames_beyond_the_training_are_left_to_physics() {
    let scene = hanging();
    let base = bases()[1];
    let trained = |scene: &Scene| {
        let domain = Domain::of_scene(scene, 10).unwrap();
        Arc::new(Model::clone(&model(base, SMALL)).with_domain(&domain))
    };
    let run = |model: Arc<Model>, scene: &Scene, frames: usize| {
        let mut stepper = CorrectedStepper::new(model, scene, at_rest(scene)).unwrap();
        let targets = still(scene);
        let familiar = (0..frames).map(|_| {
            stepper.step(&targets).unwrap();
            stepper.familiarity().familiar
        });
        (familiar.collect::<Vec<_>>(), stepper.state().clone())
    };
    let mut windy = hanging();
    windy.environment.wind = DVec3::new(0.0, 0.0, 4.0);
    let (familiar, there) = run(trained(&scene), &windy, 5);
    assert_eq!(familiar, [0.0; 5]);
    let mut alone = Simulator::new(&base_scene(&windy, base)).unwrap();
    (0..5).for_each(|_| alone.step(&still(&windy)).unwrap());
    assert_eq!(there.positions, alone.positions_f64());
    assert_eq!(there.velocities, alone.velocities_f64());
    // Where the training had such wind, or the model does not say, the network is asked.
    for model in [trained(&windy), model(base, SMALL)] {
        let (familiar, corrected) = run(model, &windy, 5);
        assert!(familiar.iter().all(|part| *part > 0.0), "{familiar:?}");
        assert_ne!(corrected.positions, there.positions);
    }
    // A handle that lets go is beyond it for as long as it is free.
    let mut stepper = CorrectedStepper::new(trained(&scene), &scene, at_rest(&scene)).unwrap();
    let all = still(&scene);
    let one = still(&scene).releasing(vec![false, true]).unwrap();
    let familiar: Vec<bool> = [&all, &one, &one, &all]
        .map(|targets| {
            stepper.step(targets).unwrap();
            stepper.familiarity().familiar > 0.0
        })
        .to_vec();
    assert_eq!(familiar, [true, false, false, true]);
    // A scene in which one will let go is beyond it from the start.
    let mut lets_go = hanging();
    lets_go.schedule.releases = vec![Release {
        handles: vec![1],
        from: 0.5,
        to: None,
    }];
    let (familiar, _) = run(trained(&scene), &lets_go, 3);
    assert_eq!(familiar, [0.0; 3]);
}

/// A run that is taken up while a handle is free, or after it took hold elsewhere, goes on as
/// physics does.
#[test]
fn a_run_is_taken_up_with_its_handles_as_they_hold() {
    let mut scene = hanging();
    scene.motion = Motion::still(2.0);
    let release = Release {
        handles: vec![1],
        from: 0.1,
        to: Some(0.2),
    };
    scene.schedule.releases = vec![release];
    let base = bases()[1];
    let physics = base_scene(&scene, base);
    let path = scene.handle_path().unwrap();
    let mut run = Simulator::new(&physics).unwrap();
    for frame in 0..20 {
        if [8, 16].contains(&frame) {
            let state = FrameState {
                positions: run.positions_f64().to_vec(),
                velocities: run.velocities_f64().to_vec(),
            };
            let (x, v) = (state.positions.clone(), state.velocities.clone());
            let alone = Simulator::with_state(&physics, x, v).unwrap();
            let mut alone = alone.taken_up_at(frame).unwrap();
            let none = CorrectedStepper::new(model(base, 0.0), &scene, state).unwrap();
            let mut none = none.taken_up_at(frame).unwrap();
            for next in frame..frame + 3 {
                let targets = path.targets(next, 2).unwrap();
                alone.step(&targets).unwrap();
                none.step(&targets).unwrap();
            }
            assert_eq!(none.state().positions, alone.positions_f64(), "{frame}");
        }
        run.step(&path.targets(frame, 2).unwrap()).unwrap();
    }
}

#[test]
fn gusts_are_felt() {
    let run = |scene: &Scene| {
        let mut stepper = stepper(scene, bases()[1], SMALL);
        let targets = still(scene);
        (0..10).for_each(|_| stepper.step(&targets).unwrap());
        stepper.positions().to_vec()
    };
    let (calm, windy) = (run(&hanging()), run(&gusty()));
    let apart = calm.iter().zip(windy).map(|(p, q)| p.distance(q));
    assert!(apart.fold(0.0, f32::max) > 1e-3);
}

#[test]
fn a_handle_that_lets_go_is_corrected_as_others_are() {
    let scene = hanging();
    let [first, second] = scene.handles.vertices() else {
        panic!("two handles");
    };
    let targets = still(&scene).releasing(vec![true, false]).unwrap();
    let run = |size: f64| {
        let mut stepper = stepper(&scene, bases()[1], size);
        (0..3).for_each(|_| stepper.step(&targets).unwrap());
        stepper.state().positions.clone()
    };
    let (none, some) = (run(0.0), run(SMALL));
    assert!(none[first.index()].distance(some[first.index()]) > 1e-7 * SMALL);
    assert_eq!(none[second.index()], some[second.index()]);
}

#[test]
fn a_correction_beyond_all_bounds_fails_and_leaves_the_cloth() {
    let scene = hanging();
    let mut stepper = stepper(&scene, bases()[1], HUGE);
    let refused = stepper.step(&still(&scene));
    assert!(matches!(
        refused,
        Err(StepError::NonFinite { frame: 1, .. })
    ));
    assert_eq!(stepper.frame(), 0);
    assert_eq!(*stepper.state(), at_rest(&scene));
    let start: Vec<Vec3> = scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
    assert_eq!(stepper.positions(), start);
}

#[test]
fn a_model_that_moves_the_cloth_by_itself_is_refused() {
    let spec = ModelSpec::mesh_graph_nets(8, 1);
    let network = Network::new(&spec).unwrap();
    let weights = network.initialise(&mut || 0.5);
    let even = |width: usize| Normalizer::new(vec![0.0; width], vec![1.0; width]).unwrap();
    let normalizers = Normalizers {
        nodes: even(spec.node_width()),
        edges: even(spec.edge_width()),
        acceleration: even(3),
    };
    let alone = Model::new(&spec, weights, normalizers, String::new()).unwrap();
    let scene = hanging();
    let made = CorrectedStepper::new(Arc::new(alone), &scene, at_rest(&scene));
    assert!(matches!(made.err(), Some(CorrectedError::Base(NoBase))));
}

#[test]
fn velocities_are_those_between_the_last_two_frames() {
    let frames = [0.0, 1.0, 3.0].map(|x| vec![Vec3::new(x, 0.0, 0.0)]);
    let state = FrameState::of_frames(&frames, 60.0);
    assert_eq!(state.positions, [DVec3::new(3.0, 0.0, 0.0)]);
    assert_eq!(state.velocities, [DVec3::new(120.0, 0.0, 0.0)]);
    let state = FrameState::of_frames(&frames[..1], 60.0);
    assert_eq!(state.velocities, [DVec3::ZERO]);
    assert_eq!(FrameState::of_frames(&[], 60.0), FrameState::default());
}

#[test]
fn each_face_has_the_stiffness_of_its_own_fabric() {
    let mut scene = hanging();
    let faces = scene.mesh.topology().faces().len();
    let lined = selvedge_cloth::FaceFabrics {
        names: vec!["lining".to_owned()],
        of_face: (0..faces)
            .map(|face| (face % 2 == 1).then_some(0))
            .collect(),
    };
    scene.mesh = scene.mesh.with_fabrics(lined).unwrap();
    let lining = scene.material.clone().multiplied(3.0, 5.0);
    scene.fabrics.insert("lining".to_owned(), lining);
    let own = face_stiffness(&scene);
    assert_eq!(own.len(), faces);
    for pair in own.chunks_exact(2) {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(pair[1].stretch, 3.0 * pair[0].stretch));
        assert!(near(pair[1].bend, 5.0 * pair[0].bend));
        assert!(near(pair[1].density, pair[0].density));
    }
}

/// Frames that are undone or given up are not seen: what hands do in them is not remembered.
#[test]
fn a_frame_that_is_taken_back_is_not_seen() {
    let scene = hanging();
    let domain = Domain::of_scene(&scene, 10).unwrap();
    let model = Model::clone(&model(bases()[0], SMALL)).with_domain(&domain);
    let mut stepper = CorrectedStepper::new(Arc::new(model), &scene, at_rest(&scene)).unwrap();
    let seen =
        |stepper: &CorrectedStepper| format!("{:?}", stepper.watched.as_ref().unwrap().watch);
    stepper.step(&still(&scene)).unwrap();
    let before = seen(&stepper);
    let places = scene.handles.select(scene.mesh.positions());
    let moved = places.into_iter().map(|p| p + 0.01 * DVec3::X).collect();
    let fast = HandleTargets::at_frame_end(moved).unwrap();
    stepper.step(&fast).unwrap();
    assert_ne!(seen(&stepper), before);
    stepper.undo_step();
    assert_eq!(seen(&stepper), before);
    let stop = Stop::default();
    stop.ask();
    stepper.stop_by(stop);
    stepper.step(&fast).unwrap_err();
    assert_eq!(seen(&stepper), before);
}

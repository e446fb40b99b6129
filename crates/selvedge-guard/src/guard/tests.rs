//! Guards of a stepper that errs on purpose: it is kept within bounds, and left alone as long as it
//! does not err.

use crate::conformance::{HandlesEnd, check, check_correctable, check_stop};
use glam::{DVec3, Vec2};
use selvedge_cloth::generate::square;
use selvedge_cloth::{
    Cloth, ClothArrays, ContactSettings, Handles, Material, Motion, Obstacle, Topology, bodies,
};
use selvedge_sim::{Checkpoint, Simulator};

mod double;

use double::{Double, Error};

use super::*;
use crate::limiter::SLACK;

const GRAY: &str = selvedge_assets::MATERIALS[0].1;
const FRAMES: usize = 300;
/// Those that a guard makes good.
const ERRORS: [Error; 5] = [
    Error::Grows,
    Error::NotANumber,
    Error::Fails,
    Error::Jumps,
    Error::Trembles,
];

/// A square of 36 vertices that hangs flat from its upper corners.
fn scene() -> Scene {
    let sheet = square(36, 1.0, 1).unwrap();
    let material: Material = toml::from_str(GRAY.trim()).unwrap();
    let handles = Handles::new(&sheet.labels["upper-corners"], 36).unwrap();
    Scene {
        motion: Motion::still(10.0),
        ..Scene::of("guarded", sheet.mesh, handles, material)
    }
}

/// Handle targets of frame `frame`: they swing by 0.2 m and turn a little, at most 0.8 m/s.
fn targets(scene: &Scene, frame: usize) -> HandleTargets {
    let phase = 0.05 * frame as f64;
    let turn = glam::DQuat::from_rotation_y(0.3 * phase.sin());
    let shift = 0.2 * phase.sin() * DVec3::new(1.0, 0.4, 0.5);
    let held = scene.handles.select(scene.mesh.positions());
    let at = |p: DVec3| turn * p + shift;
    HandleTargets::at_frame_end(held.into_iter().map(at).collect()).unwrap()
}

/// The cloth of `scene`, at rest where its mesh starts.
fn cloth(scene: &Scene) -> Cloth {
    let (density, handles) = (scene.material.density, scene.handles.clone());
    Cloth::of_mesh(&scene.mesh, density, handles).unwrap()
}

/// A guard of a double, with its scene or without.
fn watched(errs: Error, correction: Correction, scene: Option<Scene>) -> Guard<Double> {
    let double = Double::new(errs);
    let cloth = cloth(&double.scene);
    Guard::new(double, &cloth, 60.0, scene.map(Arc::new), correction).unwrap()
}

/// A guard that limits, of a double and the parts that are given, which may not fit.
fn limited(
    double: Double,
    cloth: &Cloth,
    scene: Option<Scene>,
) -> Result<Guard<Double>, GuardError> {
    Guard::new(double, cloth, 60.0, scene.map(Arc::new), Correction::Limit)
}

/// Asserts that the handles of the guarded cloth are at their targets.
fn assert_held(guard: &Guard<Double>, targets: &HandleTargets) {
    let held: Vec<Vec3> = guard.handles().of(guard.positions()).collect();
    let targets: Vec<Vec3> = targets.end().iter().map(|p| p.as_vec3()).collect();
    assert_eq!(held, targets);
}

fn largest_stretch(guard: &Guard<Double>) -> f64 {
    guard.trust().given.largest_strain + 1.0
}

#[test]
fn a_stepper_that_never_errs_is_left_alone_bit_for_bit() {
    let mut alone = Double::new(Error::Never);
    let mut all: Vec<Guard<Double>> = [Correction::None, Correction::Limit]
        .map(|correction| watched(Error::Never, correction, Some(scene())))
        .into();
    for frame in 1..=60 {
        let targets = targets(&scene(), frame);
        alone.step(&targets).unwrap();
        for guard in &mut all {
            guard.step(&targets).unwrap();
            assert_eq!(guard.positions(), alone.positions());
            let trust = guard.trust();
            assert_eq!((trust.frame, trust.verdict), (frame, Verdict::Held));
            assert_eq!(trust.predicted, Some(trust.given));
            assert_eq!(trust.correction, Some(Moved::default()));
        }
    }
    assert!(all.iter().all(|guard| guard.inner().given == 0));
}

#[test]
fn whatever_a_stepper_does_it_is_kept_within_bounds() {
    for errs in ERRORS {
        for scene_of in [None, Some(scene())] {
            let has_scene = scene_of.is_some();
            let mut guard = watched(errs, Correction::Limit, scene_of);
            let mut tally = crate::GuardSummary::default();
            for frame in 1..=FRAMES {
                let targets = targets(&scene(), frame);
                guard.step(&targets).unwrap();
                tally.add(guard.trust());
                // The bound and its slack, and positions of 1 m in f32 against edges of 0.1 m.
                let most = 1.28 * (1.0 + f64::from(SLACK)) + 1e-5;
                let found = largest_stretch(&guard);
                assert!(found <= most, "{errs:?} {has_scene} {frame}: {found}");
                assert!(guard.positions().iter().all(|p| p.is_finite()));
                assert_held(&guard, &targets);
                assert_eq!((guard.frame(), guard.trust().frame), (frame, frame));
            }
            assert!(tally.lost + tally.corrected > 20, "{errs:?}: {tally:?}");
            match errs {
                // From frame 20 on: all, every second, every tenth.
                Error::NotANumber => assert_eq!(tally.lost, FRAMES - 20),
                Error::Fails => assert!(tally.lost >= (FRAMES - 18) / 2),
                Error::Jumps => assert!(tally.lost >= FRAMES / 10),
                Error::Never | Error::Grows | Error::Trembles | Error::Refuses | Error::Lost => {}
            }
        }
    }
}

/// The scene with a ball that stands where the cloth swings.
fn with_ball() -> Scene {
    let mut scene = scene();
    let positions = scene.mesh.positions();
    let middle = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let body = bodies::sphere(0.15, 0.08);
    let at = |p: &DVec3| *p + middle + DVec3::new(0.25, -0.2, 0.05);
    let points = body.points.iter().map(at).collect();
    let ball = Obstacle::new("ball", points, body.faces).unwrap();
    scene.obstacles = vec![ball];
    scene.contact = Some(ContactSettings {
        thickness: 2e-3,
        ..ContactSettings::default()
    });
    scene
}

#[test]
fn whatever_a_stepper_does_no_frame_intersects() {
    let scene = with_ball();
    let oracle = Simulator::new(&scene).unwrap();
    let (mut pushed, mut lost, mut unguarded) = (0, 0, 0);
    for errs in [Error::Never].into_iter().chain(ERRORS) {
        let mut guard = watched(errs, Correction::Limit, Some(scene.clone()));
        let mut alone = Double::new(errs);
        let mut tally = crate::GuardSummary::default();
        for frame in 1..=40 {
            let targets = targets(&scene, frame);
            guard.step(&targets).unwrap();
            tally.add(guard.trust());
            oracle.check_apart(frame, guard.positions()).unwrap();
            assert_held(&guard, &targets);
            let is_bad = alone.step(&targets).is_err()
                || oracle.check_apart(frame, alone.positions()).is_err();
            unguarded += u32::from(is_bad);
        }
        pushed += tally.pushed_apart;
        lost += tally.lost_to_contact;
    }
    assert!(unguarded > 50, "{unguarded}");
    assert!(pushed > 50, "{pushed} {lost}");
}

#[test]
fn a_start_that_intersects_is_refused() {
    let mut scene = with_ball();
    let double = Double::new(Error::Never);
    let cloth = cloth(&scene);
    let mut moved = double.last[1].clone();
    moved.iter_mut().for_each(|p| *p += 0.25 * Vec3::X);
    let mut inside = Double::new(Error::Never);
    inside.last = [moved.clone(), moved];
    let error = limited(inside, &cloth, Some(scene.clone())).err().unwrap();
    let is_met = matches!(error, GuardError::Start(StepError::Intersections { .. }));
    let text = error.to_string();
    assert!(is_met && text.contains("of obstacle \"ball\""), "{text}");
    scene.contact = None;
    scene.obstacles.clear();
    assert!(limited(double, &cloth, Some(scene)).is_ok());
}

#[test]
fn a_guard_that_only_watches_changes_nothing_and_passes_errors_on() {
    let none = Correction::None;
    let mut guard = watched(Error::Grows, none, None);
    let mut alone = Double::new(Error::Grows);
    let mut worst = Verdict::Held;
    for frame in 1..=60 {
        let targets = targets(&scene(), frame);
        guard.step(&targets).unwrap();
        alone.step(&targets).unwrap();
        assert_eq!(guard.positions(), alone.positions());
        worst = worst.max(guard.trust().verdict);
    }
    let replaced_by = Replacement::Nothing;
    assert_eq!(worst, Verdict::Lost { replaced_by });
    assert!(
        largest_stretch(&guard) > 100.0,
        "it explodes when it is let"
    );
    let mut failing = watched(Error::Fails, none, None);
    let failed = (1..=60).find_map(|frame| failing.step(&targets(&scene(), frame)).err());
    assert!(matches!(
        failed,
        Some(StepError::NonFinite { frame: 20, .. })
    ));
    assert_eq!(failing.frame(), 19);
}

#[test]
fn verdicts_turn_at_their_thresholds() {
    // The cloth grown about the origin, handles included: all edges strain alike.
    let replaced_by = Replacement::Nothing;
    for (strain, verdict) in [
        (0.27, Verdict::Held),
        (0.29, Verdict::Corrected),
        (0.99, Verdict::Corrected),
        (1.01, Verdict::Lost { replaced_by }),
    ] {
        let mut guard = watched(Error::Never, Correction::None, None);
        let flat = guard.positions().to_vec();
        let grown: Vec<Vec3> = flat.iter().map(|p| *p * (1.0 + strain as f32)).collect();
        let held = guard.handles().of(&grown).map(|p| p.as_dvec3()).collect();
        guard.inner.last[1] = grown;
        let targets = HandleTargets::at_frame_end(held).unwrap();
        guard.step(&targets).unwrap();
        assert_eq!(guard.trust().verdict, verdict, "{strain}");
        // The second route: the very frame, by its own gauge.
        let measured = guard.gauge.measure(&flat, guard.positions());
        assert_eq!(guard.trust().predicted, Some(measured));
        assert!((measured.largest_strain - strain).abs() < 1e-5, "{strain}");
    }
}

#[test]
fn a_lost_frame_is_the_physics_from_the_last_good_ones() {
    let mut implicit = scene();
    implicit.physics.air = selvedge_cloth::AirLaw::Implicit;
    let mut guard = watched(Error::Fails, Correction::Limit, Some(scene()));
    for frame in 1..=19 {
        guard.step(&targets(&implicit, frame)).unwrap();
    }
    let [before, now] = guard.last.clone();
    guard.step(&targets(&implicit, 20)).unwrap();
    let replaced_by = Replacement::Physics;
    assert_eq!(guard.trust().verdict, Verdict::Lost { replaced_by });
    assert!(!guard.trust().physics_failed);
    let trust = guard.trust();
    assert_eq!((trust.predicted, trust.correction), (None, None));
    let wide = |p: &Vec3| p.as_dvec3();
    let pairs = now.iter().zip(&before);
    let velocities = pairs.map(|(p, q)| (wide(p) - wide(q)) * 60.0).collect();
    let positions = now.iter().map(wide).collect();
    let mut physics = Simulator::with_state(&implicit, positions, velocities).unwrap();
    physics.step(&targets(&implicit, 20)).unwrap();
    assert_eq!(guard.positions(), physics.positions());
    assert_eq!(
        guard.inner().positions(),
        physics.positions(),
        "it goes on from there"
    );
    assert_eq!(guard.inner().given, 1);
}

/// A scene whose physics cannot be solved: one iteration of conjugate gradients, to the last bit.
fn unsolvable() -> Scene {
    let mut scene = scene();
    let settings = selvedge_cloth::ConjugateGradients {
        tolerance: 1e-300,
        max_iterations: 1,
    };
    scene.physics.solver = selvedge_cloth::LinearSolver::ConjugateGradients(settings);
    scene
}

#[test]
fn a_failure_of_the_physics_is_told() {
    let mut guard = watched(Error::Fails, Correction::Limit, Some(unsolvable()));
    let mut tally = crate::GuardSummary::default();
    for frame in 1..=20 {
        guard.step(&targets(&scene(), frame)).unwrap();
        tally.add(guard.trust());
        assert_eq!(guard.trust().physics_failed, frame == 20);
        assert_eq!(guard.physics_failure().is_some(), frame == 20);
    }
    let replaced_by = Replacement::Carry;
    assert_eq!(guard.trust().verdict, Verdict::Lost { replaced_by });
    let failure = guard.physics_failure().unwrap().to_string();
    assert!(failure.starts_with("frame 20: "), "{failure}");
    let counts = (tally.lost, tally.lost_to_physics, tally.physics_failures);
    assert_eq!(counts, (1, 0, 1));
}

#[test]
fn a_physics_that_cannot_be_set_up_is_an_error_if_it_is_to_hold_contact() {
    let mut broken = scene();
    broken.frame_rate = -1.0;
    let make = |contact| {
        let double = Double::new(Error::Fails);
        let cloth = cloth(&double.scene);
        let broken = Scene {
            contact,
            ..broken.clone()
        };
        limited(double, &cloth, Some(broken))
    };
    let refused = make(Some(ContactSettings::default())).err();
    assert!(
        matches!(refused, Some(GuardError::Physics(_))),
        "{refused:?}"
    );
    // Where it is needed for lost frames only, the first of them tells.
    let mut guard = make(None).unwrap();
    for frame in 1..=22 {
        guard.step(&targets(&scene(), frame)).unwrap();
        let is_lost = frame == 20 || frame == 22;
        assert_eq!(guard.trust().physics_failed, is_lost);
    }
    assert!(matches!(
        guard.physics_failure(),
        Some(PhysicsFailure::SetUp(_))
    ));
}

#[test]
fn a_correction_that_is_not_taken_leaves_the_cloth_as_it_was() {
    let mut guard = watched(Error::Refuses, Correction::Limit, None);
    let (start, trust) = (guard.positions().to_vec(), *guard.trust());
    for _ in 0..3 {
        let error = guard.step(&targets(&scene(), 1)).unwrap_err();
        let reason = "it is gone".to_owned();
        assert_eq!(error, StepError::Device { frame: 1, reason });
        assert_eq!((guard.positions(), guard.frame()), (&*start, 0));
        assert_eq!(*guard.trust(), trust);
        assert_eq!(guard.inner().last, [start.clone(), start.clone()]);
    }
}

#[test]
fn guards_and_what_they_guard_conform() {
    let never = || Double::new(Error::Never);
    check_correctable(never, HandlesEnd::AtTargets);
    for errs in [Error::Never, Error::Trembles, Error::Grows] {
        let make = || watched(errs, Correction::Limit, Some(scene()));
        check(make, HandlesEnd::AtTargets);
    }
    // The one under guard does not hear, the physics in its place does.
    let lost = || watched(Error::Lost, Correction::Limit, Some(scene()));
    check_stop(lost);
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let scene = scene();
    let whole = cloth(&scene);
    let refused = |cloth: &Cloth, scene: Option<Scene>| {
        let made = limited(Double::new(Error::Never), cloth, scene);
        made.err().unwrap()
    };
    let mut other = scene.clone();
    other.handles = Handles::new(&[0], 36).unwrap();
    let error = GuardError::OtherScene { what: "handles" };
    assert_eq!(refused(&whole, Some(other)), error);
    let freed = whole.clone().with_handles(Handles::new(&[0], 36).unwrap());
    let error = GuardError::OtherCloth { what: "handles" };
    assert_eq!(refused(&freed.unwrap(), None), error);
    let remade = |topology: Topology, edit: fn(&mut ClothArrays)| {
        let mut arrays = whole.arrays().clone();
        edit(&mut arrays);
        Cloth::new(topology, whole.handles().clone(), arrays).unwrap()
    };
    let faces = whole.topology().face_indices();
    let fewer = Topology::new(36, &faces[1..]).unwrap();
    let fewer = remade(fewer, |arrays| {
        arrays.face_area.truncate(arrays.face_area.len() - 1)
    });
    let error = GuardError::OtherCloth { what: "faces" };
    assert_eq!(refused(&fewer, None), error);
    let flat = remade(whole.topology().clone(), |arrays| {
        arrays.material_coordinates.fill(Vec2::ONE);
    });
    assert!(matches!(refused(&flat, None), GuardError::Length { .. }));
}

/// The physics, some steps of which fail.
struct Failing {
    simulator: Simulator,
    fails: &'static [usize],
}

impl Stepper for Failing {
    selvedge_cloth::delegate_stepper!(self: self.simulator);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let frame = self.frame() + 1;
        if self.fails.contains(&frame) {
            let vertex = VertexId(3);
            return Err(StepError::NonFinite { frame, vertex });
        }
        self.simulator.step(targets)
    }
}

impl Failing {
    /// Sets the cloth there in frame `frame`, with the velocities of `from` and that of the way.
    fn put(&mut self, frame: usize, positions: &[Vec3], from: &[DVec3]) {
        let before = self.simulator.positions_f64().to_vec();
        let positions: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
        let ways = positions.iter().zip(&before).map(|(to, from)| *to - *from);
        let velocities = ways.zip(from).map(|(way, v)| *v + 60.0 * way).collect();
        let there = Checkpoint::of(frame, positions, velocities);
        self.simulator.restore(&there).unwrap();
    }
}

impl Correctable for Failing {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let velocities = self.simulator.velocities_f64().to_vec();
        self.put(self.frame(), positions, &velocities);
        Ok(())
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let still = vec![DVec3::ZERO; positions.len()];
        self.put(self.frame() + 1, positions, &still);
        Ok(())
    }

    fn undo_step(&mut self) {
        unreachable!("no frame is refused");
    }
}

/// A corner is free in the steps from frame 6 to 30, then held where it is then. Frames are lost
/// while it is free, when it takes hold and after that.
#[test]
fn lost_frames_leave_a_corner_free_and_hold_it_where_it_took_hold() {
    let scene = scene();
    let path = |frame: usize| targets(&scene, frame).end().to_vec();
    let corner = scene.handles.vertices()[1].index();
    for (has_scene, fails) in [
        (true, &[20, 21, 30, 31, 40][..]),
        (true, &[20, 21, 30, 32]),
        (false, &[20, 31, 40]),
        (false, &[30, 32]),
    ] {
        let inner = Failing {
            simulator: Simulator::new(&scene).unwrap(),
            fails,
        };
        let known = has_scene.then(|| Arc::new(scene.clone()));
        let cloth = cloth(&scene);
        let mut guard = Guard::new(inner, &cloth, 60.0, known, Correction::Limit).unwrap();
        let mut offset = DVec3::ZERO;
        let mut farthest = 0.0_f64;
        for frame in 1..=45 {
            let before = guard.positions().to_vec();
            let mut end = path(frame);
            if frame == 31 {
                offset = before[corner].as_dvec3() - path(30)[1];
            }
            end[1] += offset;
            let is_free = (7..=30).contains(&frame);
            let targets = HandleTargets::at_frame_end(end.clone()).unwrap();
            let targets = targets.releasing(vec![false, is_free]).unwrap();
            guard.step(&targets).unwrap();
            let is_lost = guard.trust().verdict.is_lost();
            assert_eq!(is_lost, fails.contains(&frame), "{frame}");
            let now = guard.positions()[corner];
            let way = now.distance(before[corner]);
            assert!(way < 0.15, "{has_scene}, frame {frame}: {way} m");
            if is_free {
                farthest = farthest.max(now.as_dvec3().distance(end[1]));
            } else {
                let off = now.as_dvec3().distance(end[1]);
                assert!(off < 1e-6, "{has_scene}, frame {frame}: {off} m");
            }
        }
        assert!(farthest > 0.3, "it was free: {farthest}");
    }
}

//! Domains of scenes and of frames, and what goes beyond them.

use glam::{DVec3, Vec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::motion::named::by_name;
use selvedge_cloth::{ContactSettings, Handles, Isotropic, Motion, RecordedMotion, Release};

use super::*;

const VERTICES: usize = 60;

/// A square metre that hangs by two corners and swings.
fn scene() -> Scene {
    let sheet = square(VERTICES, 1.0, 1).expect("a sheet");
    let handles = Handles::new(&sheet.labels["upper-corners"], VERTICES).expect("two handles");
    Scene {
        motion: by_name("test-x-minus-z").expect("a motion"),
        ..Scene::of("test", sheet.mesh, handles, fabric("sheet", 1e5))
    }
}

fn fabric(name: &str, youngs_modulus: f64) -> Material {
    let sheet = Isotropic {
        youngs_modulus,
        poissons_ratio: 0.3,
        thickness: 1e-3,
    };
    Material {
        name: name.into(),
        source: String::new(),
        density: 0.2,
        damping: 0.0,
        stretch: sheet.stretch_table(),
        bend: sheet.bend_table(),
        compression: selvedge_cloth::Compression::default(),
    }
}

/// The handles of `scene` as they are, and shifted by `shifts` in the frames after.
fn recorded(scene: &Scene, shifts: &[[DVec3; 2]]) -> Motion {
    let start = scene.handles.select(scene.mesh.positions());
    let mut positions = vec![start.clone()];
    positions.extend(
        shifts
            .iter()
            .map(|shift| start.iter().zip(shift).map(|(p, s)| *p + *s).collect()),
    );
    Motion::Recorded(RecordedMotion { positions })
}

fn domain(scene: &Scene) -> Domain {
    let frames = scene.frame_count().expect("a motion");
    Domain::by_frame(scene, frames, |_| {}).expect("a domain")
}

fn aspects(trained: &Domain, scene: &Scene) -> Vec<Aspect> {
    let found = trained.departures(&domain(scene));
    found.into_iter().map(|d| d.aspect).collect()
}

#[test]
fn a_scene_is_within_its_own_domain() {
    let own = domain(&scene());
    assert_eq!(own.departures(&own), []);
    assert_eq!(own.vertices, Bounds::of(60.0));
    assert_eq!(own.handles, Bounds::of(2.0));
    assert_eq!(own.wind, 0.0);
    assert!((own.gravity.most - 9.8).abs() < 1e-12);
    // The handles move as one body at one height, and by centimetres per frame at most.
    assert!(own.height_difference < 1e-9, "{own:?}");
    assert!(own.moved_apart < 1e-9, "{own:?}");
    assert!((0.2..6.0).contains(&own.handle_speed), "{own:?}");
}

#[test]
fn an_account_of_a_training_has_the_domain_of_its_model() {
    let own = domain(&scene());
    for account in ["", "by hand", "[3]", r#"{"steps": 3}"#] {
        assert_eq!(Domain::in_account(account).expect("no domain"), None);
    }
    let written = serde_json::json!({ "steps": 3, "domain": own }).to_string();
    let back = Domain::in_account(&written).expect("a domain");
    assert_eq!(back.as_ref(), Some(&own), "{written}");
    let damaged = written.replace("frame_rate", "rate");
    let error = Domain::in_account(&damaged).expect_err("an unknown field");
    assert!(error.to_string().contains("rate"), "{error}");
}

#[test]
fn each_departure_is_found_alone_and_says_both_numbers() {
    type Edit = fn(&mut Scene);
    let cases: [(Aspect, &str, Edit); 12] = [
        (
            Aspect::FrameRate,
            "120 frames per second, trained at 60",
            |s| {
                // As fast, in twice as many frames.
                s.motion = Motion::still(1.0);
                s.frame_rate = 120.0;
            },
        ),
        (Aspect::EdgeLength, "mm on average, trained on", |s| {
            let mesh = s.mesh.clone().with_pattern_scaled(0.5);
            s.mesh = mesh.expect("a smaller pattern");
        }),
        (
            Aspect::Handles,
            "1 to 2 handles held at once, trained with 2",
            |s| {
                s.schedule.releases.push(Release {
                    handles: vec![1],
                    from: 0.5,
                    to: None,
                });
            },
        ),
        (
            Aspect::Heights,
            "handles 0.20 m apart in height, trained with at most 0.00 m",
            |s| {
                // The second handle goes round the first: their distance stays.
                let start = s.handles.select(s.mesh.positions());
                let arm = start[1] - start[0];
                let length = arm.length();
                let turn = (0.2 / length).asin();
                let frames: Vec<_> = (1..=40)
                    .map(|i| {
                        let angle = turn * f64::from(i) / 40.0;
                        let up = DVec3::Y * length * angle.sin();
                        [DVec3::ZERO, arm * (angle.cos() - 1.0) + up]
                    })
                    .collect();
                s.motion = recorded(s, &frames);
            },
        ),
        (
            Aspect::Apart,
            "changes by 0.30 m, trained with at most 0.00 m",
            |s| {
                let start = s.handles.select(s.mesh.positions());
                let aside = (start[1] - start[0]).normalize();
                let frames: Vec<_> = (1..=60)
                    .map(|i| [DVec3::ZERO, -aside * 0.005 * f64::from(i)])
                    .collect();
                s.motion = recorded(s, &frames);
            },
        ),
        (Aspect::Speed, "handles at up to 12.0 m/s", |s| {
            s.motion = recorded(s, &[[DVec3::X * 0.2; 2]]);
        }),
        (
            Aspect::Acceleration,
            // To and fro by 1.2 m/s, within a frame.
            "handles accelerate by up to 144 m/s², trained with up to",
            |s| {
                let aside = DVec3::X * 0.02;
                s.motion = recorded(s, &[[aside; 2], [DVec3::ZERO; 2]]);
            },
        ),
        (
            Aspect::Wind,
            "wind of up to 5.0 m/s, trained in still air",
            |s| s.environment.wind = DVec3::new(3.0, 0.0, 4.0),
        ),
        (
            Aspect::Gravity,
            "gravity of 1.62 m/s², trained with 9.80 m/s²",
            |s| s.environment.gravity = DVec3::new(0.0, -1.62, 0.0),
        ),
        (Aspect::Fabric, "the fabric felt (0.200 kg/m²", |s| {
            s.material = fabric("felt", 3e5);
        }),
        (Aspect::Contact, "the network sees none", |s| {
            s.contact = Some(ContactSettings::default());
        }),
        (Aspect::Vertices, "200 vertices, trained on 60", |s| {
            // Finer in a larger square, so that edges stay as long.
            let sheet = square(200, (200.0_f64 / 60.0).sqrt(), 1).expect("a sheet");
            s.handles = Handles::new(&sheet.labels["upper-corners"], 200).expect("two handles");
            s.mesh = sheet.mesh;
        }),
    ];
    let trained = domain(&scene());
    for (aspect, words, edit) in cases {
        let mut scene = scene();
        edit(&mut scene);
        scene.validate().expect("a scene");
        let found = trained.departures(&domain(&scene));
        let [departure] = &found[..] else {
            panic!("{aspect:?}: {found:?}");
        };
        assert_eq!(departure.aspect, aspect);
        assert!(departure.words.contains(words), "{}", departure.words);
    }
}

#[test]
fn the_farthest_beyond_is_said_first() {
    let mut trained = domain(&scene());
    trained.wind = 1.0;
    let mut far = scene();
    far.environment.wind = DVec3::X * 2.4;
    far.environment.gravity = DVec3::NEG_Y * 98.0;
    let words = |scene: &Scene| {
        let found = trained.departures(&domain(scene));
        found.into_iter().map(|d| d.words).collect::<Vec<_>>()
    };
    let [gravity, wind] = &words(&far)[..] else {
        panic!("{:?}", words(&far));
    };
    assert!(gravity.ends_with("(9.1 times the bound)"), "{gravity}");
    assert!(wind.ends_with("(2.0 times the bound)"), "{wind}");
    far.contact = Some(ContactSettings::default());
    far.environment.wind = DVec3::X * 99.0;
    let found = aspects(&trained, &far);
    assert_eq!(found, [Aspect::Contact, Aspect::Wind, Aspect::Gravity]);
}

#[test]
fn a_file_without_accelerations_is_not_judged_by_them() {
    let mut trained = domain(&scene());
    let least = trained.handle_acceleration.expect("measured");
    assert!((1.0..60.0).contains(&least), "{least}");
    trained.handle_acceleration = None;
    let text = serde_json::json!({ "domain": trained }).to_string();
    assert!(!text.contains("acceleration"), "{text}");
    let back = Domain::in_account(&text).expect("a domain").expect("one");
    let mut abrupt = scene();
    abrupt.motion = recorded(&abrupt, &[[DVec3::X * 0.02; 2], [DVec3::ZERO; 2]]);
    assert_eq!(aspects(&back, &abrupt), []);
}

#[test]
fn a_model_of_several_scenes_knows_what_lies_between() {
    let mut trained = domain(&scene());
    let mut windy = scene();
    windy.environment.wind = DVec3::X * 8.0;
    windy.material = fabric("felt", 3e5);
    trained.include(&domain(&windy));
    let mut between = scene();
    between.environment.wind = DVec3::Z * -5.0;
    between.material = fabric("linen", 2e5);
    assert_eq!(aspects(&trained, &between), []);
    between.material = fabric("wire", 1e6);
    assert_eq!(aspects(&trained, &between), [Aspect::Fabric]);
    let names = trained.fabrics.expect("fabrics").names;
    assert_eq!(names, ["sheet", "felt"]);
}

#[test]
fn a_handle_that_takes_hold_elsewhere_is_no_fast_one() {
    let mut watch = DomainWatch::new(DVec3::NEG_Y, 60.0);
    let places = [DVec3::ZERO, DVec3::X];
    watch.see(&places, &[true, true], DVec3::ZERO);
    watch.see(&places, &[true, false], DVec3::ZERO);
    assert_eq!(watch.now().handles, Bounds::of(1.0));
    watch.see(&[DVec3::ZERO, DVec3::X * 0.5], &[true, true], DVec3::ZERO);
    assert_eq!(watch.now().handle_speed, 0.0);
    assert_eq!(watch.now().handle_acceleration, Some(0.0));
    assert_eq!(watch.now().moved_apart, 0.0);
    let seen = watch.seen();
    assert_eq!((seen.handles.least, seen.handles.most), (1.0, 2.0));
}

#[test]
fn frames_of_a_data_set_have_the_domain_of_their_scene() {
    let scene = scene();
    let path = scene.handle_path().expect("a path");
    let start: Vec<Vec3> = scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
    let frames: Vec<Vec<Vec3>> = (0..=path.frame_count())
        .map(|frame| {
            let mut positions = start.clone();
            let places = path.at(frame as f64 / 60.0);
            for (vertex, place) in scene.handles.vertices().iter().zip(places) {
                positions[vertex.index()] = place.as_vec3();
            }
            positions
        })
        .collect();
    let cloth = Cloth::of_scene(&scene, start).expect("a cloth");
    let found = Domain::of_frames(
        &cloth,
        std::slice::from_ref(&scene.material),
        &scene.environment,
        60.0,
        frames
            .iter()
            .map(|frame| (frame.as_slice(), vec![true; scene.handles.len()])),
    );
    let own = domain(&scene);
    assert_eq!(found.departures(&own), []);
    assert_eq!(own.departures(&found), []);
    assert!((found.handle_speed - own.handle_speed).abs() < 1e-3);
}

//! Slopes of every number against differences, and data that say nothing of a number.

use std::ops::ControlFlow;

use super::*;
use crate::event::Event;

const HELD: &str = r#"
name = "held"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 30, size = 0.6, seed = 2 } }
handles = { label = "upper-corners" }
environment = { air_drag = 0.1, wind = [0.5, 0.1, -0.2] }
physics = { solver = "cholesky" }
sag = { tolerance = 1e-9 }

[motion.inline]
kind = "keyframes"
duration = 0.5

[[motion.inline.groups]]
handles = [0, 1]
keyframes = [
    { time = 0.1, translation = [0.05, 0.02, 0.0] },
    { time = 0.3, translation = [-0.05, 0.0, 0.02], rotation_deg = 10.0 },
]
"#;

const FREE: &str = r#"
name = "free"
start = "mesh"
material = { from = "camel-ponte-roma", damping = 0.01 }
mesh = { generator = { kind = "square", vertices = 30, size = 0.6, seed = 2 } }
physics = { solver = "cholesky" }
"#;

/// An order in a folder of its own, with marks at these frames and vertices.
fn order(scene: &str, bounds: &str, noise: &str) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let mut marks = "frame,vertex,x,y,z\n".to_owned();
    for (k, vertex) in [3, 11, 19, 27].into_iter().enumerate() {
        for frame in [6, 9, 12] {
            let _ = std::fmt::Write::write_fmt(
                &mut marks,
                format_args!(
                    "{frame},{vertex},{},-0.3,{}\n",
                    0.01 * k as f64,
                    0.2 - 0.1 * k as f64
                ),
            );
        }
    }
    write("marks.csv", &marks);
    write("scene.toml", scene);
    let data = format!("data = {{ markers = \"marks.csv\"{noise} }}");
    write(
        "order.toml",
        &format!("scene = \"scene.toml\"\n{data}\n{bounds}"),
    );
    Fit::read(&folder.path().join("order.toml")).unwrap()
}

/// Ends `fit` where a search would begin, with slopes from the gradient and from differences.
fn slopes(mut fit: Fit) -> Vec<(String, f64, f64)> {
    let mut quiet = |_: Event<'_>| ControlFlow::Continue(());
    let reporter = Reporter::new(&mut quiet);
    let scene = selvedge::Scene::from(fit.loaded.clone());
    if !scene.begins_at_rest() {
        fit.start = Some(scene.start(&mut reporter.listener()).unwrap().state);
    }
    let task = reporter.count("", 1, "");
    // Away from the start, so that turns and factors are not those of the scene.
    let at: Vec<f64> = fit
        .numbers
        .iter()
        .map(|number| number.part() + 0.03)
        .collect();
    let (made, mut solver) = fit.run(&at, true, &task).unwrap().unwrap();
    let found = fit.slope(&made, &mut solver).unwrap();
    let value = |number: usize, step: f64| {
        let mut at = at.clone();
        at[number] += step;
        fit.run(&at, false, &task).unwrap().unwrap().0.value()
    };
    let names = fit.numbers.iter().map(|number| number.name.clone());
    let pairs = names.zip(found).enumerate();
    pairs
        .map(|(number, (name, found))| {
            let slope = |step: f64| (value(number, step) - value(number, -step)) / (2.0 * step);
            // Of two lengths the nearer: kinks are in the way of the longer one.
            let near = |slope: &f64| (slope - found).abs();
            let all = [slope(1e-5), slope(1e-6)].into_iter();
            (
                name,
                found,
                all.min_by(|a, b| near(a).total_cmp(&near(b))).unwrap(),
            )
        })
        .collect()
}

fn agree(slopes: &[(String, f64, f64)], count: usize) {
    assert_eq!(slopes.len(), count);
    let largest = slopes.iter().map(|slope| slope.2.abs()).fold(0.0, f64::max);
    for (name, found, expected) in slopes {
        let error = (found - expected).abs() / expected.abs().max(1e-4 * largest);
        assert!(error < 2e-4, "{name}: {found} for {expected}");
    }
}

#[test]
fn slopes_of_fabric_and_air_are_those_of_differences_from_the_rest_pose_too() {
    let bounds = "material = { stretch = [0.2, 5.0], stretch_columns = [0.2, 5.0], bend = [0.1, 10.0], \
        bend_rows = [0.1, 10.0], density = [0.05, 1.0] }\n\
        environment = { air_density = [0.0, 3.0], air_drag = [0.0, 1.0], wind = [-3.0, 3.0] }";
    let found = slopes(order(HELD, bounds, ""));
    agree(&found, 1 + 4 + 1 + 3 + 1 + 1 + 1 + 3);
}

#[test]
fn slopes_of_a_motion_are_those_of_differences() {
    let bounds = "motion = { translation = [-0.5, 0.5], rotation_deg = [-90.0, 90.0] }";
    agree(&slopes(order(HELD, bounds, "")), 2 * 4);
}

#[test]
fn slopes_of_a_start_are_those_of_differences() {
    let bounds = "start = { place = [-1.0, 1.0], velocity = [-3.0, 3.0], spin = [-9.0, 9.0] }\n\
        material = { damping = [0.0, 0.1] }";
    agree(&slopes(order(FREE, bounds, "")), 10);
}

#[test]
fn data_that_say_nothing_of_a_number_are_reported_so() {
    // Below the least damping of the solver nothing changes.
    let bounds = "material = { damping = [0.0, 5e-4], density = [0.15, 0.25] }";
    let mut fit = order(HELD, bounds, ", noise = 0.001");
    let mut quiet = |_: Event<'_>| ControlFlow::Continue(());
    assert!(fit.search(&mut quiet).unwrap());
    let damping = fit
        .numbers
        .iter()
        .find(|number| number.name.ends_with("damping"));
    assert!(damping.unwrap().error.is_infinite());
    let directions = fit.directions.as_ref().unwrap();
    let told: Vec<bool> = directions
        .iter()
        .map(|direction| direction.is_told)
        .collect();
    assert_eq!(told, [true, false]);
    let report = fit.report();
    assert!(
        report.contains("+1.00 material.damping | inf %: not told"),
        "{report}"
    );
}

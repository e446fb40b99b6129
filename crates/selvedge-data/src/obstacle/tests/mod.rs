//! Tests of obstacles in files: words, bodies, motions and the shipped mannequin.

mod glb;
mod mannequin;
mod motions;
mod usd;

use std::path::Path;

use glam::DVec3;
use selvedge_cloth::{Obstacle, ObstaclePath};
use tempfile::TempDir;

use super::*;
use crate::test_help::{says, table};

/// A folder with files, in which obstacles are read.
struct TestFolder(TempDir);

impl TestFolder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.0.path().join(name), bytes).unwrap();
    }

    fn spec(&self, text: &str) -> Result<ObstacleSpec, String> {
        let file: ObstacleFile = toml::from_str(text).map_err(|error| error.to_string())?;
        let spec = file.resolve(self.0.path());
        spec.map_err(|error| error.to_string())
    }

    /// The obstacle that a text makes, which is the same from its spec as JSON.
    fn read(&self, text: &str) -> Result<Obstacle, String> {
        let spec = self.spec(text)?;
        let json = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<ObstacleSpec>(&json).unwrap(), spec);
        Ok(self.warned(text)?.0)
    }

    /// The obstacle that a text makes, and the warnings.
    fn warned(&self, text: &str) -> Result<(Obstacle, Vec<String>), String> {
        let mut warnings = Vec::new();
        let made = self.spec(text)?.build(self.0.path(), 60.0, &mut warnings);
        Ok((made.map_err(|error| error.to_string())?, warnings))
    }

    fn problem(&self, text: &str) -> String {
        self.read(text).unwrap_err()
    }
}

fn at(obstacle: &Obstacle, time: f64) -> Vec<DVec3> {
    obstacle.positions_at(time).collect()
}

fn assert_near(found: &[DVec3], expected: &[DVec3], bound: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.distance(*expected) <= bound, "{found} {expected}");
    }
}

#[test]
fn simple_bodies_are_placed() {
    let dir = TestFolder::new();
    let ball = "name = \"ball\"\nsphere = { radius = 0.3 }\nfriction = 0.2\nthickness = 0.002\n\
        transform = { scale = 2, translation = [1, 2, 3] }";
    let ball = dir.read(ball).unwrap();
    let centre = DVec3::new(1.0, 2.0, 3.0);
    let is_on = |p: DVec3| (p.distance(centre) - 0.6).abs() < 1e-14;
    assert!(ball.positions_at(0.0).all(is_on));
    assert_eq!((ball.friction(), ball.thickness()), (0.2, Some(0.002)));
    assert!(ball.is_still());

    let wall = dir.read("name = \"w\"\nplane = { normal = [2, 0, 0], height = 0.5, size = 3 }");
    let wall = wall.unwrap();
    assert!(wall.positions_at(0.0).all(|p| (p.x - 0.5).abs() < 1e-15));
    assert!((at(&wall, 0.0)[0].distance(at(&wall, 0.0)[1]) - 3.0).abs() < 1e-15);
    assert_eq!(wall.friction(), f64::INFINITY);

    let cube = dir.read("name = \"b\"\nbox = { size = [1, 2, 3] }");
    let cube = cube.unwrap();
    assert_eq!((cube.point_count(), cube.faces().len()), (8, 12));
    let capsule = "name = \"c\"\ncapsule = { radius = 0.1, length = 0.4 }";
    let capsule = dir.read(capsule).unwrap();
    let tallest = capsule.positions_at(0.0).map(|p| p.y).fold(0.0, f64::max);
    assert!((tallest - 0.3).abs() < 1e-15);
}

#[test]
fn meshes_are_cut_into_triangles_and_keep_their_numbers() {
    let dir = TestFolder::new();
    // A point without a face stays, so that motions by number fit.
    let step = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 2 3 4 5\n";
    dir.write("step.obj", step);
    let text = "name = \"s\"\nmesh = \"step.obj\"";
    let step = dir.read(text).unwrap();
    assert_eq!((step.point_count(), step.faces().len()), (5, 2));
    assert!(step.faces().as_flattened().iter().all(|&p| p > 0));
    let spec = dir.spec(text).unwrap();
    assert_eq!(spec.files(Path::new("a")), [Path::new("a/step.obj")]);
}

#[test]
fn faces_without_area_are_left_out_and_crooked_ones_are_cut() {
    let dir = TestFolder::new();
    // A tetrahedron with a sliver along an edge, a corner twice, and a bow tie beside it.
    dir.write(
        "b.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0.5 0 0\nv 3 0 0\nv 4 1 0\nv 4 0 0\nv 3 1 0\n\
        f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\nf 1 5 2\nf 1 1 2\nf 6 7 8 9\n",
    );
    let (made, warnings) = dir.warned("name = \"b\"\nmesh = \"b.obj\"").unwrap();
    assert_eq!((made.point_count(), made.faces().len()), (9, 6));
    let left_out = "2 of 8 faces have no area at the start and are left out";
    assert_eq!(warnings, [format!("obstacles[\"b\"].mesh: {left_out}")]);
}

#[test]
fn what_is_wrong_is_named_with_the_obstacle() {
    let dir = TestFolder::new();
    dir.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    dir.write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    dir.write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    dir.write("empty.obj", "v 0 0 0\n");
    let cases = r#"
        name = ""\nsphere = { radius = 1 } | name: is empty
        name = "a" | obstacles["a"].body: must be one of plane
        name = "a"\nsphere = { radius = 1 }\nbox = { size = [1, 1, 1] } | must be one of
        name = "a"\nsphere = { radius = 1, edge = 0.02 } | sphere.edge: must be at least 0.0207 m
        name = "a"\ncapsule = { radius = 1, length = 100, edge = 0.02 } | capsule.edge: must be at least 0.024544 m
        name = "a"\nsphere = { radius = 0 } | sphere.radius: must be between
        name = "a"\nsphere = { radios = 1 } | radios
        name = "a"\nplane = { normal = [0, 0, 0] } | plane.normal
        name = "a"\ncapsule = { radius = 1, length = -1 } | capsule.length
        name = "a"\nmesh = "gone.obj" | gone.obj could not be read
        name = "a"\nmesh = "mannekin" | neither a shipped body (mannequin)
        name = "a"\nmesh = "flat.obj" | face 0 has no area
        name = "a"\nmesh = "far.obj" | obstacles["a"].mesh: far.obj
        name = "a"\nmesh = "nan.obj" | obstacles["a"].mesh: nan.obj
        name = "a"\nmesh = "empty.obj" | has no faces
        name = "a"\nsphere = { radius = 1 }\nfriction = -1 | friction must be not negative
        name = "a"\nsphere = { radius = 1 }\nthickness = 2 | thickness must be between
        name = "a"\nsphere = { radius = 1 }\ntransform = { scale = 0 } | transform: scale must be
        name = "a"\nsphere = { radius = 1 }\nmotion = { rate = 3 } | motion: needs keyframes
        name = "a"\nsphere = { radius = 1 }\nmotion = { file = "empty.obj" } | motion: points of a file move a mesh
    "#;
    for [text, named] in table(cases) {
        says(dir.problem(text), &[named]);
    }
    let spec = dir.spec("name = \"a\"\nmesh = \"far.obj\"").unwrap();
    dir.write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let error = spec.build(dir.0.path(), 60.0, &mut Vec::new());
    says(error.unwrap_err(), &["far.obj has changed since"]);
}

/// The frames of a path by points.
fn frames(obstacle: &Obstacle) -> (f64, &[Vec<DVec3>]) {
    match obstacle.path() {
        ObstaclePath::Points { frame_rate, frames } => (*frame_rate, frames),
        other => panic!("{other:?}"),
    }
}

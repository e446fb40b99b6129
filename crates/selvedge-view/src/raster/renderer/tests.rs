//! Closed forms of the raster: where points land, what hides what, how much is covered.

use super::*;
use crate::image::colour::to_linear;
use crate::raster::camera::View;
use crate::raster::shade::HANDLE;
use crate::{Rgb, Run, ScalarField};
use glam::{Vec2, Vec3A};
use selvedge_cloth::VertexId;

/// From +x at a level.
const LEVEL: View = View {
    azimuth: 0.0,
    elevation: 0.0,
};

/// Half the width of the border in a small picture `[pixels]`.
const HALF_BORDER: f32 = 0.39;

/// In the plane x = 0; its back is in sight.
const TRIANGLE: [Vec3; 3] = [
    Vec3::new(0.0, -0.5, 0.5),
    Vec3::new(0.0, 0.5, 0.5),
    Vec3::new(0.0, 0.5, -0.5),
];

/// A topology of separate triangles.
fn scene(triangles: &[[Vec3; 3]]) -> (Topology, Vec<Vec3>) {
    let positions: Vec<Vec3> = triangles.concat();
    let faces: Vec<[u32; 3]> = (0..triangles.len() as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    (Topology::new(positions.len(), &faces).unwrap(), positions)
}

fn plain<'a>(run: &'a Run<'a>) -> Panel<'a> {
    Panel::of(run)
}

struct Shot {
    image: Image,
    backdrop: Image,
    stage: Stage,
}

/// The picture of a scene, and the same stage with the cloth shrunk to a point.
fn shoot(triangles: &[[Vec3; 3]], side: u32, samples: u32) -> Shot {
    let (topology, positions) = scene(triangles);
    let gone = vec![positions[0]; positions.len()];
    let frames = [positions.as_slice(), gone.as_slice()];
    let run = Run::new(&topology, frames, &[], 60.0).unwrap();
    let stage = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    let panel = plain(&run);
    let mut renderer = Renderer::new(&stage, [side; 2], samples).unwrap();
    Shot {
        image: renderer.render(&panel, 0).unwrap(),
        backdrop: renderer.render(&panel, 1).unwrap(),
        stage,
    }
}

/// The first frame of a run in a square picture.
fn drawn(panel: &Panel<'_>, stage: &Stage, side: u32, samples: u32) -> Image {
    let mut renderer = Renderer::new(stage, [side; 2], samples).unwrap();
    renderer.render(panel, 0).unwrap()
}

/// The colour at `point` of a square picture.
fn colour_at(image: &Image, stage: &Stage, point: Vec3) -> Rgb {
    let seen = stage.camera.project(point);
    let [x, y] = [seen.x, seen.y].map(|share| (share * image.width() as f32) as u32);
    image.pixel(x, y).unwrap()
}

fn is_bluish([red, _, blue]: Rgb) -> bool {
    i32::from(blue) - i32::from(red) > 40
}

#[test]
fn covered_pixels_are_the_projected_area() {
    // All at one depth, so that the projection is a similarity.
    let triangle = [
        Vec3::new(0.0, -0.9, 0.8),
        Vec3::new(0.0, 0.6, -0.9),
        Vec3::new(0.0, 0.7, 0.95),
    ];
    let side = 256;
    let shot = shoot(&[triangle], side, 1);
    let [a, b, c] = triangle.map(|point| {
        let seen = shot.stage.camera.project(point);
        Vec2::new(seen.x, seen.y) * side as f32
    });
    let expected = 0.5 * (b - a).perp_dot(c - a).abs();
    let pixels = shot.image.pixels().iter();
    let covered = pixels.filter(|p| is_bluish(**p)).count() as f32;
    // The outer half of the hem is as blue as the cloth.
    let perimeter = a.distance(b) + b.distance(c) + c.distance(a);
    let expected = expected + HALF_BORDER * perimeter;
    // Counting middles errs at the outline only, by at most about half a pixel per row it crosses,
    // at random: a small part of the perimeter.
    let allowed = 0.05 * perimeter;
    assert!((covered - expected).abs() < allowed, "{covered} {expected}");
}

#[test]
fn the_nearer_sheet_hides_the_farther_one_in_either_order() {
    let at = |x: f32, size: f32| {
        [
            Vec3::new(x, -size, 0.0),
            Vec3::new(x, size, -size),
            Vec3::new(x, size, size),
        ]
    };
    // The small near one shows its back, the large far one its front.
    let near = at(0.2, 0.3);
    let mut far = at(-0.2, 1.0);
    far.swap(1, 2);
    for order in [[near, far], [far, near]] {
        let shot = shoot(&order, 64, 2);
        let colour_of = |point| colour_at(&shot.image, &shot.stage, point);
        let normal = (near[1] - near[0]).cross(near[2] - near[0]).x;
        let inside_near = colour_of(Vec3::new(0.2, 0.1, 0.0));
        let inside_far = colour_of(Vec3::new(-0.2, 0.8, 0.6));
        assert_eq!(is_bluish(inside_near), normal > 0.0);
        assert_eq!(is_bluish(inside_far), normal < 0.0);
    }
}

#[test]
fn above_the_horizon_a_pixel_shows_cloth_inside_and_backdrop_outside() {
    let [low, behind, before] = TRIANGLE;
    let triangle = [low, before, behind];
    let shot = shoot(&[triangle], 64, 2);
    let corners = triangle.map(|point| {
        let seen = shot.stage.camera.project(point);
        64.0 * Vec2::new(seen.x, seen.y)
    });
    // The camera is level: the floor, and the shadow on it, fill no more than the lower half.
    for (x, y) in (0..64).flat_map(|x| (0..32).map(move |y| (x, y))) {
        let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let depth = (0..3)
            .map(|k| {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                -(to - from).normalize().perp_dot(middle - from)
            })
            .fold(f32::INFINITY, f32::min);
        let seen = shot.image.pixel(x, y).unwrap();
        // A pixel reaches 0.71 from its middle, and the border lies around the outline.
        let reach = 0.71 + HALF_BORDER;
        if depth > reach {
            assert!(is_bluish(seen), "({x}, {y}): {seen:?}");
        } else if depth < -reach {
            assert_eq!(Some(seen), shot.backdrop.pixel(x, y), "({x}, {y})");
        }
    }
}

#[test]
fn values_are_interpolated_in_perspective() {
    // A tilted sheet: value 0 at the near edge, 1 at the far one. Halfway in space is not halfway
    // on the screen.
    let positions = [
        Vec3::new(1.0, 0.0, -1.0),
        Vec3::new(1.0, 0.0, 1.0),
        Vec3::new(-1.0, 1.0, 0.0),
    ];
    let (topology, _) = scene(&[positions]);
    let run = Run::new(&topology, [&positions[..]], &[], 60.0).unwrap();
    let stage = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    let corners = positions.map(|position| {
        let seen = stage.camera.project(position);
        ScreenVertex {
            place: 400.0 * Vec2::new(seen.x, seen.y),
            nearness: seen.depth.recip(),
            normal: Vec3A::Y,
            facing: 1.0,
            lit: Vec3A::ZERO,
            relief: 0.0,
            value: 0.5 * (1.0 - position.x),
        }
    });
    let triangle = Triangle::new(corners).unwrap();
    for share in [0.25, 0.5, 0.75] {
        let point = Vec3::new(1.0 - 2.0 * share, share, 0.0);
        let seen = stage.camera.project(point);
        let weights = triangle.weights(400.0 * Vec2::new(seen.x, seen.y));
        let nearness = weights.dot(triangle.nearness);
        // Places of some hundred pixels carry 3e-5 of rounding over a triangle as large.
        assert!((nearness * seen.depth - 1.0).abs() < 1e-4);
        assert!((triangle.value_at(weights, nearness) - share).abs() < 1e-4);
    }
}

#[test]
fn handles_are_marked_where_they_are() {
    let (topology, positions) = scene(&[TRIANGLE]);
    let handles = [VertexId(2)];
    let run = Run::new(&topology, [positions.as_slice()], &handles, 60.0).unwrap();
    let stage = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    let image = drawn(&plain(&run), &stage, 200, 2);
    let middle = colour_at(&image, &stage, positions[2]);
    // Tables of 4096 steps of light return a byte to within one.
    let is_near = |k: usize| middle[k].abs_diff(HANDLE[k]) <= 1;
    assert!((0..3).all(is_near), "{middle:?}");
}

#[test]
fn a_renderer_forgets_the_picture_before() {
    let (topology, positions) = scene(&[TRIANGLE]);
    let moved = TRIANGLE.map(|p| p + Vec3::new(0.1, 0.4, -0.3));
    let frames = [positions.as_slice(), &moved];
    let run = Run::new(&topology, frames, &[VertexId(0)], 60.0).unwrap();
    let stage = Stage::of_runs(&[&run], View::default(), 1.0).unwrap();
    let panel = plain(&run);
    let fresh = || Renderer::new(&stage, [80; 2], 2).unwrap();
    let mut used = fresh();
    used.render(&panel, 0).unwrap();
    used.render(&panel, 1).unwrap();
    let expected = fresh().render(&panel, 0).unwrap();
    assert_eq!(used.render(&panel, 0).unwrap(), expected);
    let error = used.render(&panel, 2).unwrap_err().to_string();
    let words = "frame 2 was asked for, but the run has only 2 frames";
    assert_eq!(error, words);
}

#[test]
fn a_flat_field_has_the_hue_of_its_value() {
    let (topology, positions) = scene(&[TRIANGLE]);
    let run = Run::new(&topology, [positions.as_slice()], &[], 60.0).unwrap();
    let stage = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    let field = ScalarField::new("value", vec![vec![3.0; 3]]).unwrap();
    let panel = Panel {
        field: Some(&field),
        ..Panel::of(&run)
    };
    let image = drawn(&panel, &stage, 100, 1);
    let centre = (positions[0] + positions[1] + positions[2]) / 3.0;
    // Shading scales light alike in all channels: the ratios stay those of the map's last colour.
    let light = to_linear(colour_at(&image, &stage, centre));
    let expected = to_linear([92, 12, 52]);
    let scale = light.x / expected.x;
    // A byte near the green channel's value of 12 is 10 % of its light.
    let off = (light / expected - scale).abs().max_element();
    assert!(off < 0.12 * scale, "{light}");
    assert!(scale > 0.5 && scale < 1.2);
}

#[test]
fn a_run_that_has_blown_up_is_drawn_without_a_panic() {
    let (topology, positions) = scene(&[TRIANGLE]);
    for far in [1e6_f32, 1e20, 3e38] {
        let blown = positions.iter().map(|p| *p * far).collect::<Vec<Vec3>>();
        let frames = [positions.as_slice(), blown.as_slice()];
        let run = Run::new(&topology, frames, &[VertexId(0)], 60.0).unwrap();
        let stage = Stage::of_runs(&[&run], View::default(), 1.0).unwrap();
        let panel = plain(&run);
        let mut renderer = Renderer::new(&stage, [40; 2], 2).unwrap();
        for frame in 0..2 {
            let image = renderer.render(&panel, frame).unwrap();
            assert_eq!([image.width(), image.height()], [40, 40]);
        }
    }
}

/// The picture of a small triangle before or behind a body that is a larger one, or beside a floor.
fn beside(body: &[Vec3], faces: &[[u32; 3]]) -> (Image, Stage) {
    let cloth = [
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(0.0, 1.0, -0.5),
        Vec3::new(0.0, 1.0, 0.5),
    ];
    let (topology, positions) = scene(&[cloth]);
    let body = crate::Body::new(faces, [std::borrow::Cow::Borrowed(body)]);
    let run = Run::new(&topology, [positions.as_slice()], &[], 60.0).unwrap();
    let run = run.with_bodies(vec![body]);
    let stage = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    (drawn(&plain(&run), &stage, 64, 1), stage)
}

#[test]
fn a_body_hides_the_cloth_behind_it_and_is_hidden_before_it() {
    let corners = [(-1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-1.0, 1.0)];
    let wall = |x: f32| corners.map(|(y, z)| Vec3::new(x, y, z));
    let faces = [[0, 1, 2], [0, 2, 3]];
    for (x, is_seen) in [(-0.4, true), (0.4, false)] {
        let (image, stage) = beside(&wall(x), &faces);
        let pixel = colour_at(&image, &stage, Vec3::new(0.0, 0.7, 0.0));
        let [red, green, blue] = pixel.map(i32::from);
        // The wall is grey; the cloth, seen from its back, is ecru.
        let is_grey = (red - green).abs() < 30 && (green - blue).abs() < 30;
        assert_eq!(is_grey, !is_seen, "{x}: {pixel:?}");
    }
}

#[test]
fn a_large_level_body_is_the_floor_of_the_picture() {
    let ground = [
        Vec3::new(-9.0, -0.2, -9.0),
        Vec3::new(-9.0, -0.2, 9.0),
        Vec3::new(9.0, -0.2, 0.0),
    ];
    let (_, stage) = beside(&ground, &[[0, 1, 2]]);
    assert_eq!(stage.floor, -0.2);
    // One that is small is drawn. Where it is lowest it stands on the floor; cloth hangs above one.
    let plate = ground.map(|p| p * Vec3::new(0.05, 1.0, 0.05));
    let (_, stage) = beside(&plate, &[[0, 1, 2]]);
    assert_eq!(stage.floor, -0.2);
    let (_, stage) = beside(&plate.map(|p| p + 0.5 * Vec3::Y), &[[0, 1, 2]]);
    assert!(stage.floor < 0.0);
}

#[test]
fn a_body_does_not_show_through_the_cloth_that_lies_on_it() {
    // A valley towards the viewer at +x, which is drawn rounder than the body of flat faces 5 mm
    // behind it.
    let points = |off: f32| -> Vec<Vec3> {
        let rows = [0.0, 1.0].into_iter();
        let at = move |y| [-1.0_f32, 0.0, 1.0].map(|z| Vec3::new(0.5 * z.abs() - off, y, z));
        rows.flat_map(at).collect()
    };
    let faces = [[0, 3, 1], [1, 3, 4], [1, 4, 2], [2, 4, 5]];
    let (cloth, body) = (points(0.0), points(5e-3));
    let topology = Topology::new(6, &faces).unwrap();
    let run = Run::new(&topology, [cloth.as_slice()], &[], 60.0).unwrap();
    let run = run.in_colour([200, 20, 20]);
    let alone = Stage::of_runs(&[&run], LEVEL, 1.0).unwrap();
    let body = crate::Body::new(&faces, [std::borrow::Cow::Borrowed(body.as_slice())]);
    let dressed = run.clone().with_bodies(vec![body]);
    let reds = |run: &Run<'_>| {
        let image = drawn(&plain(run), &alone, 128, 1);
        let is_red = |&&[red, green, _]: &&Rgb| i32::from(red) - i32::from(green) > 40;
        image.pixels().iter().filter(is_red).count()
    };
    assert_eq!(reds(&dressed), reds(&run));
}

#[test]
fn threads_show_where_the_picture_has_pixels_for_them() {
    let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
    for (size, shows) in [(0.2, true), (2.0, false)] {
        let frame = [Vec3::ZERO, size * Vec3::Z, size * Vec3::Y];
        let flat = Run::new(&topology, [&frame[..]], &[], 60.0).unwrap();
        let fabric = frame.map(|p| Vec2::new(p.z, p.y));
        let woven = flat.clone().woven(vec![fabric]);
        let stage = Stage::of_runs(&[&flat], LEVEL, 1.0).unwrap();
        let [flat, woven] = [&flat, &woven].map(|run| drawn(&plain(run), &stage, 400, 2));
        assert_eq!(flat != woven, shows, "{size} m");
        // Threads neither darken nor lighten the cloth.
        let light = |image: &Image| -> f64 {
            let pixels = image.pixels().iter();
            pixels.map(|p| f64::from(to_linear(*p).y)).sum()
        };
        let ratio = light(&woven) / light(&flat);
        assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
    }
}

#[test]
fn a_cloth_has_the_colour_of_its_run() {
    let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
    let frame = [Vec3::ZERO, Vec3::Z, Vec3::Y];
    let usual = Run::new(&topology, [&frame[..]], &[], 60.0).unwrap();
    let red = usual.clone().in_colour([200, 20, 20]);
    let middle = |run: &Run<'_>, azimuth: f32| -> [i32; 3] {
        let view = View {
            azimuth,
            elevation: 5.0,
        };
        let stage = Stage::of_runs(&[run], view, 1.0).unwrap();
        let image = drawn(&plain(run), &stage, 32, 2);
        colour_at(&image, &stage, Vec3::new(0.0, 0.3, 0.3)).map(i32::from)
    };
    for azimuth in [0.0, 180.0] {
        let [r, g, b] = middle(&red, azimuth);
        assert!(r > g + 40 && r > b + 40, "{azimuth}: {r} {g} {b}");
        assert_ne!(middle(&usual, azimuth), [r, g, b]);
    }
    // The front is the stronger one.
    let [front, back] = [180.0, 0.0].map(|azimuth| middle(&red, azimuth));
    assert!(front[1] < back[1], "{front:?} {back:?}");
    for (azimuth, elevation) in [(f32::NAN, 0.0), (0.0, 90.0), (0.0, -1.0)] {
        let view = View { azimuth, elevation };
        assert!(Stage::of_runs(&[&red], view, 1.0).is_err());
    }
}

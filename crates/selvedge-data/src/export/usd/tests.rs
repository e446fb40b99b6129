//! The stage of a run, as text, says what USD asks for.

mod text;

use glam::{DVec3, Vec3};

use super::stage_of;
use crate::UpAxis;
use crate::export::take::Take;
use crate::export::{ExportFormat, ExportOptions, FrameSpan};
use crate::test_help::{fan as trajectory, odd, options, run, says, sewn_squares, span};
use crate::trajectory::Trajectory;

const VERTICES: usize = 5;
const FRAMES: usize = 7;

/// The stage that `options` make of a run.
fn text(of: &Trajectory, options: &ExportOptions) -> String {
    let take = Take::new(of, options, &|| Ok(())).unwrap();
    let mut out = Vec::new();
    text::write(&stage_of(&take), &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

fn text_of(options: &ExportOptions) -> String {
    text(&trajectory(), options)
}

/// The numbers in a text, in order.
fn numbers(text: &str) -> Vec<f32> {
    text.split(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)))
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

/// The samples of an attribute of USD text by time code.
fn samples(text: &str, name: &str) -> Vec<(f64, Vec<Vec3>)> {
    let start = format!("{name}.timeSamples = {{");
    let (_, after) = text.split_once(&start).unwrap();
    let lines = after.split('}').next().unwrap().lines();
    let samples = lines.filter_map(|line| line.split_once(':'));
    samples
        .map(|(code, values)| (code.trim().parse().unwrap(), points(&numbers(values))))
        .collect()
}

#[test]
fn usd_has_every_position_at_its_time_code() {
    let trajectory = trajectory();
    let text = text_of(&options(ExportFormat::Usdc, |o| o.normals = true));
    assert!(text.starts_with("#usda 1.0\n"));
    let words = [
        "upAxis = \"Y\"",
        "metersPerUnit = 1\n",
        "timeCodesPerSecond = 60\n",
        "framesPerSecond = 60\n",
        "startTimeCode = 0\n",
        "endTimeCode = 6\n",
        "doubleSided = 1",
        "doc = \"a \\\"test\\\" \\\\ 1\"",
        "primvars:handle = [-1, -1, 1, 0, -1]",
        "faceVertexCounts = [3, 3, 3, 3]\n",
        "faceVertexIndices = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4]\n",
        "primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)]",
        // What binds the mesh to a material.
        "prepend apiSchemas = [\"MaterialBindingAPI\"]",
        "rel material:binding = </cloth/materials/matte>",
        "token outputs:surface.connect = </cloth/materials/matte/surface.outputs:surface>",
        "uniform token info:id = \"UsdPreviewSurface\"",
        "color3f inputs:diffuseColor = (0.08, 0.13, 0.4)",
    ];
    says(&text, &words);
    let positions = samples(&text, "point3f[] points");
    let all_normals = samples(&text, "normal3f[] normals");
    let extents = samples(&text, "float3[] extent");
    for number in 0..FRAMES {
        let (time, frame) = (number as f64, trajectory.frame(number));
        assert_eq!(positions[number], (time, frame.to_vec()));
        let normals = &all_normals[number].1;
        assert_eq!(normals.len(), VERTICES);
        // Rounded to single precision three times.
        let is_unit = |n: &Vec3| (n.length() - 1.0).abs() < 1e-6;
        assert!(normals.iter().all(is_unit), "{number}");
        let [a, b, c] = [0, 1, 4].map(|v| frame[v]);
        // Each face of this fan is seen from the same side as the middle vertex.
        assert!(normals[4].dot((b - a).cross(c - a)) > 0.0);
        let low = frame.iter().copied().reduce(Vec3::min).unwrap();
        let high = frame.iter().copied().reduce(Vec3::max).unwrap();
        assert_eq!(extents[number], (time, vec![low, high]));
    }
    let counts = [&positions, &all_normals, &extents].map(Vec::len);
    assert_eq!(counts, [FRAMES; 3]);
    let handle = text.split("\"handle_1\"").nth(1).unwrap();
    let path = samples(handle, "xformOp:translate");
    let path: Vec<Vec3> = path.iter().map(|sample| sample.1[0]).collect();
    let expected: Vec<Vec3> = (0..FRAMES).map(|k| trajectory.frame(k)[2]).collect();
    assert_eq!(path, expected);
}

#[test]
fn frames_left_out_leave_time_as_it_is_and_z_can_point_up() {
    let text = text_of(&options(ExportFormat::Usdc, |o| {
        o.frames = odd();
        o.up = UpAxis::Z;
    }));
    says(&text, &["upAxis = \"Z\"", "endTimeCode = 4\n"]);
    let turned = |frame: usize| -> Vec<Vec3> {
        let trajectory = trajectory();
        let places = trajectory.frame(frame).iter();
        places.map(|p| Vec3::new(p.x, -p.z, p.y)).collect()
    };
    let expected = [(0.0, 1), (2.0, 3), (4.0, 5)].map(|(code, frame)| (code, turned(frame)));
    assert_eq!(samples(&text, "point3f[] points"), expected);
}

/// The velocity of vertex `v` in `frame` by differences of the positions, as far as they are good
/// to the second order.
fn slope(trajectory: &Trajectory, frame: usize, v: usize) -> DVec3 {
    let at = |frame: usize| trajectory.frame(frame)[v].as_dvec3();
    let last = FRAMES - 1;
    let twice = match frame {
        0 => 4.0 * at(1) - 3.0 * at(0) - at(2),
        f if f == last => 3.0 * at(last) - 4.0 * at(last - 1) + at(last - 2),
        f => at(f + 1) - at(f - 1),
    };
    30.0 * twice
}

#[test]
fn velocities_are_differences_of_positions_whichever_frames_are_taken() {
    let trajectory = trajectory();
    for (frames, taken) in [
        (FrameSpan::default(), (0..FRAMES).collect::<Vec<_>>()),
        (odd(), vec![1, 3, 5]),
        (span("6"), vec![6]),
    ] {
        for up in [UpAxis::Y, UpAxis::Z] {
            let text = text_of(&options(ExportFormat::Usdc, |o| {
                o.frames = frames;
                o.up = up;
                o.velocities = true;
            }));
            let found = samples(&text, "vector3f[] velocities");
            assert_eq!(found.len(), taken.len());
            for ((_, velocities), &frame) in found.iter().zip(&taken) {
                for (v, velocity) in velocities.iter().enumerate() {
                    let expected = slope(&trajectory, frame, v).as_vec3();
                    let turned = match up {
                        UpAxis::Y => expected,
                        UpAxis::Z => Vec3::new(expected.x, -expected.z, expected.y),
                    };
                    // Rounded once, after sums in double precision.
                    let apart = (*velocity - turned).abs().max_element();
                    assert!(apart <= 1e-6, "{frame} {v}: {apart}");
                }
            }
        }
    }
}

#[test]
fn a_stage_of_a_sewn_cloth_has_texture_coordinates_that_vary_over_faces() {
    let cloth = sewn_squares();
    let positions = cloth.rest_positions().to_vec();
    let text = text(
        &run(cloth, 60.0, positions),
        &ExportOptions::plain(ExportFormat::Usdc),
    );
    let st = text.split("primvars:st = [").nth(1).unwrap();
    let (values, after) = st.split_once(']').unwrap();
    assert_eq!(values.matches('(').count(), 12);
    says(values, &["(0, 0), (1, 0), (1, 1), (0, 0)"]);
    let varying = "(\n            interpolation = \"faceVarying\"";
    assert!(after.trim_start().starts_with(varying), "{after:.60}");
}

//! Caches for artists: velocities, and what binds a mesh to a material.

use glam::DVec3;

use super::*;

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
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.usda");
    for (frames, taken) in [
        (FrameSpan::default(), (0..FRAMES).collect::<Vec<_>>()),
        (odd(), vec![1, 3, 5]),
        (span("6"), vec![6]),
    ] {
        for up in [UpAxis::Y, UpAxis::Z] {
            let with = ExportOptions {
                frames,
                up,
                velocities: true,
                ..ExportOptions::plain(ExportFormat::Usda)
            };
            write(&trajectory, &path, &with);
            let text = std::fs::read_to_string(&path).unwrap();
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
                    assert!(
                        (*velocity - turned).abs().max_element() <= 1e-6,
                        "{frame} {v}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_mesh_of_usd_is_bound_to_a_material() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.usda");
    write(
        &trajectory,
        &path,
        &ExportOptions::plain(ExportFormat::Usda),
    );
    let text = std::fs::read_to_string(&path).unwrap();
    for said in [
        "prepend apiSchemas = [\"MaterialBindingAPI\"]",
        "rel material:binding = </cloth/materials/matte>",
        "token outputs:surface.connect = </cloth/materials/matte/surface.outputs:surface>",
        "uniform token info:id = \"UsdPreviewSurface\"",
        "color3f inputs:diffuseColor = (0.08, 0.13, 0.4)",
    ] {
        assert!(text.contains(said), "{said}");
    }
}

//! Caches of other programs: what Blender wrote of a scene that is known, and damage. What we write
//! comes back in the tests of `foreign`.

use glam::{DVec2, DVec3};

use super::*;
use crate::export::ExportFormat;
use crate::test_help::{exported, says};
use crate::trajectory::test_square::moving_square;

/// A grid of two quads that rises by a metre in three frames of 1/24 s while the node that it hangs
/// in moves by (1, 2, 3), all in Blender's axes; exported by Blender 5.0.1.
const BLENDER_USDC: &[u8] = include_bytes!("../../tests/fixtures/caches/blender.usdc");

fn read_body(bytes: &[u8]) -> Result<Rig, RigError> {
    Rig::parse(bytes, RigFormat::Usd, Wanted::Motion(None))
}

#[test]
fn binary_usd_of_blender_is_read() {
    let body = read_body(BLENDER_USDC).unwrap();
    let [first, last] = body.span_of_meshes().unwrap();
    assert!((last - first - 3.0 / 24.0).abs() < 1e-9, "{first} {last}");
    let frames = body.frames(24.0, 0.0).unwrap();
    assert_eq!(frames.len(), 4);
    let flat = [-0.5, 0.5].map(|z| [-0.5, 0.0, 0.5].map(|x| DVec3::new(x, 0.0, z)));
    for (number, shift) in [(0, DVec3::ZERO), (3, DVec3::new(1.0, 4.0, -2.0))] {
        for expected in flat.as_flattened() {
            let nearest = frames[number].iter().map(|p| p.distance(expected + shift));
            assert!(nearest.fold(1.0, f64::min) < 1e-6, "{expected} in {number}");
        }
    }
    let polygons = body.polygons().unwrap();
    // Seen from above, faces go counter-clockwise.
    for face in &polygons.polygons {
        let at = |corner: usize| frames[0][face.corners[corner].vertex as usize];
        assert!((at(1) - at(0)).cross(at(2) - at(0)).y > 0.0);
    }
    assert_eq!((polygons.positions.len(), polygons.polygons.len()), (6, 2));
    // The grid's texture coordinates are its place in the unit square.
    let corners = polygons.polygons.iter().flat_map(|p| &p.corners);
    for corner in corners {
        let place = polygons.positions[corner.vertex as usize];
        let expected = DVec2::new(place.x + 0.5, 0.5 - place.z);
        let found = polygons.texture[corner.texture.unwrap()];
        assert!(found.distance(expected) < 1e-6, "{place}: {found}");
    }
    let hand = body.find("hand").unwrap();
    let [first, last] = body.span(hand).unwrap();
    let place = |time| body.placement(hand, time).transform_point3(DVec3::ZERO);
    assert!(place(first).length() < 1e-6);
    assert!(place(last).distance(DVec3::new(1.0, 3.0, -2.0)) < 1e-6);
}

fn cache(format: ExportFormat, frames: &str) -> Vec<u8> {
    let (_folder, path) = exported(&moving_square(60.0), format, "a", |o| {
        o.frames = frames.parse().unwrap();
        o.frames.every = 2;
        o.normals = true;
        o.velocities = format != ExportFormat::Glb;
    });
    std::fs::read(path).unwrap()
}

#[test]
fn one_frame_does_not_move() {
    let one = cache(ExportFormat::Usdc, "3");
    let body = read_body(&one).unwrap();
    assert_eq!(body.span_of_meshes(), None);
    assert_eq!(
        body.positions(9.0)[0],
        moving_square(60.0).frame(3)[0].as_dvec3()
    );
}

/// Reads `bytes` cut short, an error, and with every byte changed in two of six ways: no panic. The
/// fuzzer tries them all.
fn damage(bytes: &[u8]) {
    for at in 0..bytes.len() {
        let ways = [0, 1, 0x7f, 0x80, 0xff, bytes[at] ^ 4];
        for value in [ways[at % 6], ways[(at + 3) % 6]] {
            let mut spoilt = bytes.to_vec();
            spoilt[at] = value;
            if let Ok(body) = read_body(&spoilt) {
                let _ = (body.polygons(), body.frames(24.0, 0.0).map(|f| f.len()));
            }
            let meshes = Rig::parse(&spoilt, RigFormat::Usd, Wanted::Meshes);
            let _ = meshes.and_then(|rig| rig.polygons());
        }
        assert!(at % 7 > 0 || read_body(&bytes[..at]).is_err());
    }
}

#[test]
fn archives_of_usd_that_are_packed_or_old_are_refused() {
    let mut packed = cache(ExportFormat::Usdz, "0..4");
    packed[8] = 8;
    says(read_body(&packed).unwrap_err(), &["packed or encrypted"]);
    let mut old = cache(ExportFormat::Usdc, "0..4");
    old[9] = 3;
    says(read_body(&old).unwrap_err(), &["0.3", "usdcat"]);
}

#[test]
fn damaged_binary_usd_is_an_error_or_another_stage() {
    damage(BLENDER_USDC);
    damage(&cache(ExportFormat::Usdc, "0..4"));
}

#[test]
fn what_a_cache_has_can_be_told() {
    let folder = tempfile::tempdir().unwrap();
    for (format, ending) in [(ExportFormat::Usdc, "usdc"), (ExportFormat::Glb, "glb")] {
        let path = folder.path().join(format!("a.{ending}"));
        std::fs::write(&path, cache(format, "0..4")).unwrap();
        let [sheet] = &Rig::read_meshes(&path).unwrap()[..] else {
            panic!("{ending}: several meshes");
        };
        assert_eq!((sheet.points, sheet.faces), (4, 2), "{ending}");
        assert_eq!((sheet.name.as_str(), sheet.times.len()), ("sheet", 3));
        let rate = sheet.frame_rate().unwrap();
        assert!((rate - 30.0).abs() < 1e-3, "{ending}: {rate}");
    }
    let path = folder.path().join("blender.usdc");
    std::fs::write(&path, BLENDER_USDC).unwrap();
    let meshes = Rig::read_meshes(&path).unwrap();
    assert_eq!((meshes[0].points, meshes[0].times.len()), (6, 4));
    assert!((meshes[0].frame_rate().unwrap() - 24.0).abs() < 1e-3);
    assert_eq!(meshes.len(), 1);
}

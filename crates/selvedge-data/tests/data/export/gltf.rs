//! .glb: its two chunks, its accessors with their bounds, and the mesh as its animation moves it.

use super::*;

/// A .glb in parts.
pub(crate) struct Glb {
    pub(crate) json: Value,
    binary: Vec<u8>,
}

impl Glb {
    pub(crate) fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!([word(&bytes, 4), word(&bytes, 8)], [2, bytes.len()]);
        let length = word(&bytes, 12);
        assert_eq!(&bytes[16..20], b"JSON");
        assert_eq!(length % 4, 0);
        let binary = 20 + length;
        assert_eq!(&bytes[binary + 4..binary + 8], b"BIN\0");
        assert_eq!(word(&bytes, binary), bytes.len() - binary - 8);
        Self {
            json: serde_json::from_slice(&bytes[20..binary]).unwrap(),
            binary: bytes[binary + 8..].to_vec(),
        }
    }

    fn number(&self, pointer: &str) -> usize {
        let found = self.json.pointer(pointer).and_then(Value::as_u64);
        found.unwrap_or_else(|| panic!("no {pointer}")) as usize
    }

    /// Numbers of each element of an accessor.
    fn width(&self, accessor: usize) -> usize {
        match self.json["accessors"][accessor]["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            other => panic!("{other}"),
        }
    }

    /// The numbers of an accessor, four bytes each.
    pub(crate) fn words(&self, accessor: usize) -> Vec<[u8; 4]> {
        let at = |key: &str| self.number(&format!("/accessors/{accessor}/{key}"));
        let of_view = |key: &str| self.number(&format!("/bufferViews/{}/{key}", at("bufferView")));
        let start = of_view("byteOffset") + at("byteOffset");
        let length = 4 * self.width(accessor) * at("count");
        let end = of_view("byteOffset") + of_view("byteLength");
        assert!(start + length <= end && end <= self.binary.len());
        self.binary[start..start + length].as_chunks().0.to_vec()
    }

    /// The floats of an accessor, which keep its bounds where it has some.
    pub(crate) fn floats(&self, accessor: usize) -> Vec<f32> {
        assert_eq!(self.json["accessors"][accessor]["componentType"], 5126);
        let width = self.width(accessor);
        let words = self.words(accessor).into_iter();
        let values: Vec<f32> = words.map(f32::from_le_bytes).collect();
        for (bound, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
            if let Some(bounds) = self.json["accessors"][accessor][bound].as_array() {
                let found =
                    (0..width).map(|k| values.iter().skip(k).step_by(width).copied().reduce(pick));
                let said = bounds.iter().map(|b| b.as_f64().map(|b| b as f32));
                assert!(found.eq(said), "{bound} of accessor {accessor}");
            }
        }
        values
    }

    /// Positions at each key: the mesh and its targets, each times its weight.
    fn animated(&self) -> Vec<(f32, Vec<Vec3>)> {
        let primitive = "/meshes/0/primitives/0";
        let bounded = |accessor: usize| {
            assert!(self.json["accessors"][accessor]["min"].is_array());
            points(&self.floats(accessor))
        };
        let base = bounded(self.number(&format!("{primitive}/attributes/POSITION")));
        let count = self.json["meshes"][0]["primitives"][0]["targets"]
            .as_array()
            .map_or(0, Vec::len);
        let targets: Vec<Vec<Vec3>> = (0..count)
            .map(|k| bounded(self.number(&format!("{primitive}/targets/{k}/POSITION"))))
            .collect();
        assert_eq!(
            self.json["animations"][0]["channels"][0]["target"]["path"],
            "weights"
        );
        let sampler = format!(
            "/animations/0/samplers/{}",
            self.number("/animations/0/channels/0/sampler")
        );
        let times = self.floats(self.number(&format!("{sampler}/input")));
        let weights = self.floats(self.number(&format!("{sampler}/output")));
        assert_eq!(weights.len(), times.len() * count);
        assert!(targets.iter().all(|target| target.len() == base.len()));
        let pose = |weights: &[f32]| {
            let mut pose = base.clone();
            for (target, &weight) in targets.iter().zip(weights) {
                pose.iter_mut()
                    .zip(target)
                    .for_each(|(p, d)| *p += weight * *d);
            }
            pose
        };
        times
            .iter()
            .copied()
            .zip(weights.chunks_exact(count).map(pose))
            .collect()
    }
}

#[test]
fn gltf_has_every_frame_at_its_time() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.glb");
    for (frames, normals, taken) in [
        (FrameSpan::default(), true, vec![0, 1, 2, 3, 4, 5, 6]),
        (odd(), false, vec![1, 3, 5]),
    ] {
        let options = ExportOptions {
            frames,
            normals,
            ..ExportOptions::plain(ExportFormat::Glb)
        };
        write(&trajectory, &path, &options);
        let planned = planned_bytes(&trajectory, &options).unwrap();
        assert_eq!(planned, Some(std::fs::metadata(&path).unwrap().len()));
        let glb = Glb::read(&path);
        let animated = glb.animated();
        assert_eq!(animated.len(), taken.len());
        for ((time, positions), frame) in animated.iter().zip(&taken) {
            let expected = (frame - taken[0]) as f32 / 60.0;
            assert!((time - expected).abs() <= f32::EPSILON * expected, "{time}");
            assert_eq!(positions.len(), VERTICES);
            for (p, q) in positions.iter().zip(trajectory.frame(*frame)) {
                // Two roundings of numbers below 2.
                assert!(p.distance(*q) <= 2.0 * f32::EPSILON * 2.0, "{p} {q}");
            }
        }
        let handles: Vec<Vec3> = points(&glb.floats(glb.number("/animations/0/samplers/2/output")));
        let path = taken.iter().map(|&frame| trajectory.frame(frame)[2]);
        assert!(path.eq(handles));
        assert_eq!(glb.json["nodes"][2]["name"], "handle_1");
    }
}

#[test]
fn gltf_says_how_the_cloth_is_to_be_shown() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.glb");
    let with_normals = ExportOptions {
        normals: true,
        ..ExportOptions::plain(ExportFormat::Glb)
    };
    write(&trajectory, &path, &with_normals);
    let glb = Glb::read(&path);
    assert_eq!(glb.json["materials"][0]["doubleSided"], true);
    let attribute = |name: &str| {
        let pointer = format!("/meshes/0/primitives/0/attributes/{name}");
        glb.floats(glb.number(&pointer))
    };
    let texture = attribute("TEXCOORD_0");
    let material = trajectory.cloth().material_coordinates();
    let expected: Vec<f32> = material.iter().flat_map(|c| [c.x, 1.0 - c.y]).collect();
    assert_eq!(texture, expected);
    assert_eq!(attribute("_HANDLE"), [-1.0, -1.0, 1.0, 0.0, -1.0]);
    let base = points(&attribute("NORMAL"));
    for target in 0..FRAMES - 1 {
        let pointer = format!("/meshes/0/primitives/0/targets/{target}/NORMAL");
        let change = points(&glb.floats(glb.number(&pointer)));
        assert_eq!([base.len(), change.len()], [VERTICES; 2]);
        for (n, d) in base.iter().zip(change) {
            // Rounded to single precision four times.
            assert!(((*n + d).length() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn one_frame_makes_a_gltf_without_animation() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.glb");
    let one = ExportOptions {
        frames: span("4"),
        ..ExportOptions::plain(ExportFormat::Glb)
    };
    write(&trajectory, &path, &one);
    let glb = Glb::read(&path);
    assert!(glb.json.get("animations").is_none() && glb.json["meshes"][0].get("weights").is_none());
    let base = glb.floats(glb.number("/meshes/0/primitives/0/attributes/POSITION"));
    assert_eq!(points(&base), trajectory.frame(4));
}

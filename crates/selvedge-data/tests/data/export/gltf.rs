//! .glb: what of it no reader of ours takes. Its frames and handles come back in the tests of
//! `foreign`.

use super::*;

/// A .glb in parts.
pub(crate) struct Glb {
    pub(crate) json: Value,
    binary: Vec<u8>,
}

impl Glb {
    pub(crate) fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let (text, binary) = bytes[20..].split_at(word(&bytes, 12));
        Self {
            json: serde_json::from_slice(text).unwrap(),
            binary: binary[8..].to_vec(),
        }
    }

    fn number(&self, pointer: &str) -> usize {
        let found = self.json.pointer(pointer).and_then(Value::as_u64);
        found.unwrap_or_else(|| panic!("no {pointer}")) as usize
    }

    /// The numbers of an accessor, four bytes each.
    pub(crate) fn words(&self, accessor: usize) -> Vec<[u8; 4]> {
        let at = |key: &str| self.number(&format!("/accessors/{accessor}/{key}"));
        let view = format!("/bufferViews/{}/byteOffset", at("bufferView"));
        let widths = [("SCALAR", 1), ("VEC2", 2), ("VEC3", 3)];
        let form = &self.json["accessors"][accessor]["type"];
        let width = widths.iter().find(|(name, _)| form == name).unwrap().1;
        let data = &self.binary[self.number(&view)..];
        data[..4 * width * at("count")].as_chunks().0.to_vec()
    }

    /// The floats of an accessor.
    pub(crate) fn floats(&self, accessor: usize) -> Vec<f32> {
        let words = self.words(accessor).into_iter();
        words.map(f32::from_le_bytes).collect()
    }
}

#[test]
fn gltf_says_how_the_cloth_is_to_be_shown() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.glb");
    let with_normals = options(ExportFormat::Glb, |o| o.normals = true);
    write(&trajectory, &path, &with_normals);
    let glb = Glb::read(&path);
    let planned = planned_bytes(&trajectory, &with_normals).unwrap().unwrap();
    let bytes = glb.binary.len() as u64;
    assert!((bytes * 3 / 4..=bytes).contains(&planned), "{planned}");
    // The bounds of accessors are what other readers want.
    let change = glb.number("/meshes/0/primitives/0/targets/1/POSITION");
    let moved = points(&glb.floats(change)).into_iter();
    let least: fn(Vec3, Vec3) -> Vec3 = Vec3::min;
    for (name, pick) in [("min", least), ("max", Vec3::max)] {
        let said = glb.json["accessors"][change][name].as_array().unwrap();
        let said: Vec<f32> = said.iter().map(|b| b.as_f64().unwrap() as f32).collect();
        let expected = moved.clone().reduce(pick).unwrap();
        assert_eq!(said, expected.to_array(), "{name}");
    }
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
    let one = options(ExportFormat::Glb, |o| o.frames = span("4"));
    write(&trajectory, &path, &one);
    let glb = Glb::read(&path);
    assert!(glb.json.get("animations").is_none());
    assert!(glb.json["meshes"][0].get("weights").is_none());
    let base = glb.floats(glb.number("/meshes/0/primitives/0/attributes/POSITION"));
    assert_eq!(points(&base), trajectory.frame(4));
}

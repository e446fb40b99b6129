//! What is written is read back to the last bit; what cannot be used is an error that says what.

use serde_json::{Value, json};

use super::*;
use crate::spec::Encoder;

fn normalizer(width: usize, first: f64) -> Normalizer {
    let mean = (0..width).map(|k| first + k as f64 / 3.0).collect();
    let deviation = (0..width).map(|k| (k % 4) as f64 / 7.0).collect();
    Normalizer::new(mean, deviation).expect("statistics")
}

pub(crate) fn model(spec: &ModelSpec) -> Model {
    let normalizers = Normalizers {
        nodes: normalizer(spec.node_width(), 0.1),
        edges: normalizer(spec.edge_width(), -0.2),
        acceleration: normalizer(OUTPUTS, 1e-9),
    };
    let training = r#"{"steps": 3, "note": "ünï \"quoted\""}"#;
    crate::test_cloth::model(spec, normalizers, training)
}

fn specs() -> [ModelSpec; 3] {
    [
        ModelSpec::physical(Encoder::Gru { window: 2 }, 4, 1),
        ModelSpec::physical(Encoder::MLP, 5, 2),
        ModelSpec::mesh_graph_nets(4, 1),
    ]
}

fn tiny() -> Vec<u8> {
    model(&specs()[2]).to_bytes().expect("bytes")
}

/// Header and body of a safetensors file.
fn split(bytes: &[u8]) -> (Value, Vec<u8>) {
    let (length, rest) = bytes.split_at(8);
    let length = u64::from_le_bytes(length.try_into().expect("8 bytes")) as usize;
    let header = serde_json::from_slice(&rest[..length]).expect("a header");
    (header, rest[length..].to_vec())
}

fn joined(header: &Value, body: &[u8]) -> Vec<u8> {
    let text = serde_json::to_vec(header).expect("JSON");
    [&(text.len() as u64).to_le_bytes(), &*text, body].concat()
}

/// The message for the tiny model's file after `edit` of its header and body.
fn message(edit: impl FnOnce(&mut Value, &mut Vec<u8>)) -> String {
    let (mut header, mut body) = split(&tiny());
    edit(&mut header, &mut body);
    let error = Model::from_bytes(&joined(&header, &body)).expect_err("a defect");
    error.to_string()
}

fn offsets(header: &Value, name: &str) -> [usize; 2] {
    serde_json::from_value(header[name]["data_offsets"].clone()).expect("offsets")
}

/// Writes another value into a header, or into the spec in it: `place = JSON`.
fn set(header: &mut Value, setting: &str) {
    let (place, value) = setting.split_once(" = ").expect("a value");
    let value = serde_json::from_str(value).expect("JSON");
    match place.strip_prefix("spec/") {
        Some(field) => {
            let text = header["__metadata__"]["spec"].as_str().expect("a spec");
            let mut spec: Value = serde_json::from_str(text).expect("JSON");
            spec[field] = value;
            header["__metadata__"]["spec"] = json!(spec.to_string());
        }
        None => *header.pointer_mut(place).expect(place) = value,
    }
}

#[test]
fn half_the_bytes_are_read_as_the_nearest_weights() {
    for spec in specs() {
        let model = model(&spec);
        let whole = model.to_bytes().expect("bytes").len();
        for (to, relative) in [
            (WeightType::F16, 2f32.powi(-11)),
            (WeightType::Bf16, 2f32.powi(-8)),
        ] {
            let bytes = model.to_bytes_as(to).expect("small weights");
            assert!(
                bytes.len() + 2 * model.weights().len() <= whole + 64,
                "{to:?}"
            );
            let back = Model::from_bytes(&bytes).expect("its own file");
            assert_eq!(back.normalizers(), model.normalizers());
            for (x, y) in back.weights().iter().zip(model.weights()) {
                // Half a step; of a binary16 below 2^-14 a step is 2^-24.
                assert!(
                    (x - y).abs() <= relative * y.abs() + 2f32.powi(-25),
                    "{to:?}: {x} {y}"
                );
            }
            assert_eq!(back.to_bytes_as(to).expect("the same again"), bytes);
        }
    }
}

#[test]
fn a_weight_that_is_too_large_for_half_precision_is_named() {
    let spec = &specs()[2];
    let good = model(spec);
    let mut weights = good.weights().to_vec();
    weights[5] = 1e5;
    let large = Model::new(spec, weights, good.normalizers().clone(), String::new());
    let large = large.expect("finite");
    let error = large.to_bytes_as(WeightType::F16).expect_err("too large");
    let expected = "weight encoder.nodes.0.weight[5] is 100000, more than F16 holds";
    assert!(error.to_string().contains(expected), "{error}");
    let bytes = large.to_bytes_as(WeightType::Bf16).expect("wide enough");
    let back = Model::from_bytes(&bytes).expect("a model").weights()[5];
    // bf16 keeps eight bits.
    assert!((back / 1e5 - 1.0).abs() <= 2.0_f32.powi(-8), "{back}");
}

#[test]
fn bytes_to_model_to_bytes_is_the_identity() {
    for spec in specs() {
        let model = model(&spec);
        let bytes = model.to_bytes().expect("bytes");
        assert_eq!(bytes, model.to_bytes().expect("the same bytes"));
        let back = Model::from_bytes(&bytes).expect("its own file");
        assert_eq!(back.spec(), &spec);
        assert_eq!(back.weights(), model.weights());
        assert_eq!(back.normalizers(), model.normalizers());
        assert_eq!(back.training, model.training);
        assert_eq!(back.to_bytes().expect("bytes"), bytes);
    }
}

#[test]
fn every_tensor_is_where_another_reader_finds_it() {
    let model = model(&specs()[0]);
    let bytes = model.to_bytes().expect("bytes");
    let tensors = SafeTensors::deserialize(&bytes).expect("a container");
    assert_eq!(tensors.len(), model.network().parameters().len() + 6);
    for parameter in model.network().parameters() {
        let view = tensors.tensor(&parameter.name).expect("a tensor");
        assert_eq!(view.shape(), parameter.shape);
        let weights = &model.weights()[parameter.range.clone()];
        assert_eq!(view.data(), bytes_of(weights, f32::to_le_bytes));
    }
    for (name, view) in tensors.tensors() {
        let width = if view.dtype() == Dtype::F64 { 8 } else { 4 };
        let start = view.data().as_ptr() as usize - bytes.as_ptr() as usize;
        assert_eq!(start % width, 0, "{name} starts at byte {start}");
    }
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let bytes = tiny();
    for length in 0..bytes.len() {
        assert!(Model::from_bytes(&bytes[..length]).is_err(), "{length}");
    }
    let longer = [&*bytes, &[0]].concat();
    assert!(Model::from_bytes(&longer).is_err());
}

#[test]
fn no_damaged_byte_of_a_header_panics() {
    let mut bytes = tiny();
    let (_, body) = split(&bytes);
    for place in 0..bytes.len() - body.len() {
        let whole = bytes[place];
        for damage in [whole ^ 1, whole ^ 8, b'9', b'"', 0xff] {
            bytes[place] = damage;
            // Some damage is only another name of the training.
            let _ = Model::from_bytes(&bytes);
        }
        bytes[place] = whole;
    }
}

/// What is changed in the header or its spec; below, how the message begins. The largest network
/// that a spec may name is no reason to ask for its memory.
const HEADERS: &str = r#"
/__metadata__/format = "selvedge-checkpoint"
metadata "format" is "selvedge-checkpoint", expected "selvedge-model"
/__metadata__/version = "2"
metadata "version" is "2", expected "1"
/__metadata__ = {}
metadata "format" is missing
/__metadata__ = { "format": "selvedge-model" }
metadata "version" is missing
/__metadata__ = { "format": "selvedge-model", "version": "1" }
metadata "spec" is missing
/decoder.4.weight/shape = [4, 3]
tensor decoder.4.weight is F32 [4, 3], but the spec of the model needs F32 [3, 4]
/decoder.4.weight/dtype = "I32"
tensor decoder.4.weight is I32 [3, 4], but the spec of the model needs F32 [3, 4]
spec/colour = 3
metadata "spec": unknown field `colour`
spec/latent = 0
model.latent must be between 4 and 4096, found 0
spec/latent = 8
tensor encoder.nodes.0.weight is F32 [4, 12], but the spec of the model needs F32 [8, 12]
spec/latent = 4096; spec/blocks = 256
tensor encoder.nodes.0.weight is F32 [4, 12], but the spec of the model needs F32 [4096, 12]
spec/blocks = 2
tensor processor.1.edge.0.weight is missing
spec/node_features = ["velocity", "kinetic-energy", "node-type"]
tensor encoder.nodes.0.weight is F32 [4, 12], but the spec of the model needs F32 [4, 13]
"#;

#[test]
fn headers_of_something_else_are_named() {
    let lines: Vec<&str> = HEADERS.trim().lines().collect();
    for [edits, expected] in lines.as_chunks().0 {
        let found = message(|header, _| edits.split("; ").for_each(|edit| set(header, edit)));
        assert!(found.starts_with(expected), "{edits}: {found}");
    }
    let remedy = message(|header, _| set(header, "spec/colour = 3"));
    assert!(remedy.ends_with("train one anew"), "{remedy}");
    let error = Model::from_bytes(b"solid cube").expect_err("no container");
    assert!(error.to_string().contains("not a whole safetensors file"));
}

#[test]
fn missing_and_extra_tensors_are_named() {
    let last = "decoder.4.bias";
    let text = message(|header, body| {
        let [start, end] = offsets(header, last);
        assert_eq!(end, body.len(), "the last tensor");
        body.truncate(start);
        header.as_object_mut().expect("an object").remove(last);
    });
    assert!(text.starts_with("tensor decoder.4.bias is missing"));
    let text = message(|header, body| {
        let end = body.len();
        header["decoder.6.bias"] =
            json!({"dtype": "F32", "shape": [1], "data_offsets": [end, end + 4]});
        body.extend([0; 4]);
    });
    assert!(text.starts_with("tensor decoder.6.bias is in the file, but"));
}

#[test]
fn values_that_cannot_be_used_are_named() {
    let with = |tensor: &str, place: usize, value: &[u8]| {
        message(|header, body| {
            let start = offsets(header, tensor)[0] + place;
            body[start..][..value.len()].copy_from_slice(value);
        })
    };
    let text = with("decoder.4.weight", 20, &f32::NAN.to_le_bytes());
    assert_eq!(text, "weight decoder.4.weight[5] is not finite");
    let text = with("normalizer.edges.deviation", 8, &(-1.0_f64).to_le_bytes());
    let expected =
        "normalizer.edges: deviation of component 1 must be finite and not negative, found -1";
    assert_eq!(text, expected);
    let infinite = f64::INFINITY.to_le_bytes();
    let text = with("normalizer.acceleration.mean", 0, &infinite);
    assert!(text.starts_with("normalizer.acceleration: mean of component 0 must be finite"));
}

#[test]
fn statistics_of_another_width_are_named() {
    // The mean takes a value from the deviation beside it.
    let text = message(|header, _| {
        let [start, middle] = offsets(header, "normalizer.acceleration.mean");
        let [_, end] = offsets(header, "normalizer.acceleration.deviation");
        let entry = |shape: usize, from: usize, to: usize| json!({"dtype": "F64", "shape": [shape], "data_offsets": [from, to]});
        header["normalizer.acceleration.mean"] = entry(4, start, middle + 8);
        header["normalizer.acceleration.deviation"] = entry(2, middle + 8, end);
    });
    let expected =
        "tensor normalizer.acceleration.mean is F64 [4], but the spec of the model needs F64 [3]";
    assert_eq!(text, expected);
    // The same, not through a file.
    let error = Normalizer::new(vec![0.0; 4], vec![1.0; 2]).expect_err("a defect");
    assert_eq!(error.to_string(), "deviation has 2 components, expected 4");
    let normalizers = Normalizers {
        nodes: normalizer(11, 0.0),
        ..model(&specs()[2]).normalizers().clone()
    };
    let model = model(&specs()[2]);
    let weights = model.weights().to_vec();
    let error = Model::new(model.spec(), weights, normalizers, String::new()).expect_err("narrow");
    let expected = "normalizer.nodes has 11 values, but the spec of the model needs 12";
    assert_eq!(error.to_string(), expected);
}

#[test]
fn a_tensor_that_is_described_twice_is_refused() {
    let (header, body) = split(&tiny());
    let text = header.to_string();
    let twice = text.replacen(r#""dtype":"#, r#""dtype":"F32","dtype":"#, 1);
    let bytes = [&(twice.len() as u64).to_le_bytes(), twice.as_bytes(), &body].concat();
    let error = Model::from_bytes(&bytes).expect_err("a defect").to_string();
    assert!(error.contains("duplicate field `dtype`"), "{error}");
}

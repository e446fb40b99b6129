//! Model files: one `.safetensors` with the weights under their module paths (f32, or in half the
//! size f16 or bf16, which are f32 again once they are read), the normaliser's statistics (f64),
//! and metadata: format, version, the resolved spec and how the model was trained, both as JSON.
//!
//! This module works on bytes; it reads and writes no files.

use std::collections::BTreeSet;

use half::{bf16, f16};
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use serde::Deserialize;
use thiserror::Error;

use crate::domain::Domain;
use crate::features::normalizer::Normalizer;
use crate::network::Network;
use crate::network::parameters::Parameter;
use crate::rollout::model::{Model, Normalizers};
use crate::rollout::names_once::check_names_once;
use crate::spec::{ModelSpec, OUTPUTS, SpecError};

/// `format` in the metadata of a model file.
pub const MODEL_FORMAT: &str = "selvedge-model";
const VERSION: &str = "1";

/// Bytes that are not a usable model.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ModelFileError {
    #[error("not a whole safetensors file ({0}): it may be truncated, or of another kind")]
    Container(#[from] SafeTensorError),
    #[error("metadata \"spec\": {0}: this version has no such network, train one anew")]
    SpecText(#[from] serde_json::Error),
    #[error("metadata \"training\": domain: {0}")]
    Domain(serde_json::Error),
    #[error(transparent)]
    Invalid(#[from] SpecError),
}

fn invalid(problem: String) -> ModelFileError {
    SpecError(problem).into()
}

/// Number type of the weights in a model file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WeightType {
    /// `f32`, exact.
    #[default]
    F32,
    /// IEEE 754 binary16. Half the size, a relative error of up to 2⁻¹¹; nothing beyond 65504.
    F16,
    /// bfloat16. Half the size, a relative error of up to 2⁻⁸.
    Bf16,
}

impl Model {
    /// Reads a model from the bytes of its file.
    ///
    /// # Errors
    /// [`ModelFileError`] names the metadata or the tensor that cannot be used.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelFileError> {
        let (length, header) = SafeTensors::read_metadata(bytes)?;
        check_names_once(bytes.get(8..8 + length).unwrap_or_default())?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let text = |key: &str| metadata.get(key).map(String::as_str);
        check_kind(text)?;
        let tensors = SafeTensors::deserialize(bytes)?;
        let no_spec =
            "metadata \"spec\" is missing: the file does not say which network its weights are of";
        let spec = text("spec").ok_or_else(|| invalid(no_spec.to_owned()))?;
        let spec: ModelSpec = serde_json::from_str(spec)?;
        let network = Network::new(&spec)?;
        check_names(&network, &tensors)?;
        let mut weights = Vec::new();
        for parameter in network.parameters() {
            read_weight(&tensors, parameter, &mut weights)?;
        }
        let [nodes, edges, acceleration] =
            statistics(&spec).map(|(name, width)| read_normalizer(&tensors, name, width));
        let normalizers = Normalizers {
            nodes: nodes?,
            edges: edges?,
            acceleration: acceleration?,
        };
        let training = text("training").unwrap_or_default().to_owned();
        Domain::in_account(&training).map_err(ModelFileError::Domain)?;
        Ok(Self::new(&spec, weights, normalizers, training)?)
    }

    /// The bytes of the model's file; the same model gives the same bytes.
    ///
    /// The container's own writer keeps metadata in a hash map, whose order differs from run to
    /// run; so the header (its length, then JSON, padded to 8 bytes) is written here.
    ///
    /// # Errors
    /// [`ModelFileError::SpecText`] when the header cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelFileError> {
        self.to_bytes_as(WeightType::F32)
    }

    /// [`Self::to_bytes`] with the weights rounded to another type.
    ///
    /// # Errors
    /// As [`Self::to_bytes`], and [`ModelFileError::Invalid`] for a weight beyond the range of the
    /// type.
    pub fn to_bytes_as(&self, weights: WeightType) -> Result<Vec<u8>, ModelFileError> {
        let mut header = serde_json::Map::new();
        let mut body = Vec::new();
        let mut add = |name: String, dtype: &str, shape: &[usize], bytes: &[u8]| {
            let offsets = [body.len(), body.len() + bytes.len()];
            body.extend_from_slice(bytes);
            let entry =
                serde_json::json!({"dtype": dtype, "shape": shape, "data_offsets": offsets});
            header.insert(name, entry);
        };
        // The widest values first, so that all are aligned.
        for (name, bytes) in statistics_bytes(self) {
            add(name, "F64", &[bytes.len() / 8], &bytes);
        }
        for parameter in self.network().parameters() {
            let values = &self.weights()[parameter.range.clone()];
            let (dtype, bytes) = weight_bytes(weights, &parameter.name, values)?;
            add(parameter.name.clone(), dtype, &parameter.shape, &bytes);
        }
        let metadata = serde_json::json!({
            "format": MODEL_FORMAT,
            "version": VERSION,
            "spec": serde_json::to_string(self.spec())?,
            "training": self.training,
        });
        header.insert("__metadata__".to_owned(), metadata);
        let mut text = serde_json::to_vec(&header)?;
        text.resize(text.len().next_multiple_of(8), b' ');
        let mut out = (text.len() as u64).to_le_bytes().to_vec();
        out.append(&mut text);
        out.append(&mut body);
        Ok(out)
    }
}

/// Names and widths of the statistics in a model file.
fn statistics(spec: &ModelSpec) -> [(&'static str, usize); 3] {
    [
        ("nodes", spec.node_width()),
        ("edges", spec.edge_width()),
        ("acceleration", OUTPUTS),
    ]
}

const STATISTIC_KINDS: [&str; 2] = ["mean", "deviation"];

fn statistic_name(of: &str, kind: &str) -> String {
    format!("normalizer.{of}.{kind}")
}

fn statistics_bytes(model: &Model) -> Vec<(String, Vec<u8>)> {
    let mut out = Vec::new();
    for (of, normalizer) in model.normalizers().named() {
        let both = [normalizer.mean(), normalizer.deviation()];
        for (kind, values) in STATISTIC_KINDS.into_iter().zip(both) {
            out.push((statistic_name(of, kind), bytes_of(values, f64::to_le_bytes)));
        }
    }
    out
}

fn bytes_of<T: Copy, const N: usize>(values: &[T], to: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&x| to(x)).collect()
}

/// Bytes of weights in a file, and the name of their type there.
fn weight_bytes(
    weights: WeightType,
    name: &str,
    values: &[f32],
) -> Result<(&'static str, Vec<u8>), ModelFileError> {
    let (to, bytes) = match weights {
        WeightType::F32 => return Ok(("F32", bytes_of(values, f32::to_le_bytes))),
        WeightType::F16 => ("F16", bytes_of(values, |x| f16::from_f32(x).to_le_bytes())),
        WeightType::Bf16 => (
            "BF16",
            bytes_of(values, |x| bf16::from_f32(x).to_le_bytes()),
        ),
    };
    let holds = |x: f32| match weights {
        WeightType::F16 => f16::from_f32(x).is_finite(),
        _ => bf16::from_f32(x).is_finite(),
    };
    match values.iter().position(|&x| !holds(x)) {
        Some(index) => Err(invalid(format!(
            "weight {name}[{index}] is {}, more than {to} holds: keep this model in f32, or in bf16",
            values[index]
        ))),
        None => Ok((to, bytes)),
    }
}

/// Adds the numbers of a weight of any of the types.
fn read_weight(
    tensors: &SafeTensors<'_>,
    parameter: &Parameter,
    weights: &mut Vec<f32>,
) -> Result<(), ModelFileError> {
    let (name, shape) = (&parameter.name, &parameter.shape);
    match tensors.tensor(name).map(|view| view.dtype()) {
        Ok(dtype @ Dtype::F16) => {
            let numbers = read(tensors, name, dtype, shape)?.as_chunks().0.iter();
            weights.extend(numbers.map(|b| f16::from_le_bytes(*b).to_f32()));
        }
        Ok(dtype @ Dtype::BF16) => {
            let numbers = read(tensors, name, dtype, shape)?.as_chunks().0.iter();
            weights.extend(numbers.map(|b| bf16::from_le_bytes(*b).to_f32()));
        }
        _ => {
            let numbers = read(tensors, name, Dtype::F32, shape)?.as_chunks().0.iter();
            weights.extend(numbers.map(|b| f32::from_le_bytes(*b)));
        }
    }
    Ok(())
}

fn check_kind<'a>(text: impl Fn(&str) -> Option<&'a str>) -> Result<(), ModelFileError> {
    for (key, expected) in [("format", MODEL_FORMAT), ("version", VERSION)] {
        if text(key) != Some(expected) {
            let found = text(key).map_or("missing".into(), |found| format!("\"{found}\""));
            return Err(invalid(format!(
                "metadata \"{key}\" is {found}, expected \"{expected}\": this file is no model that this version reads"
            )));
        }
    }
    Ok(())
}

fn check_names(network: &Network, tensors: &SafeTensors<'_>) -> Result<(), ModelFileError> {
    let statistics = statistics(network.spec()).into_iter();
    let statistics =
        statistics.flat_map(|(of, _)| STATISTIC_KINDS.map(|kind| statistic_name(of, kind)));
    let weights = network.parameters().iter().map(|p| p.name.clone());
    let known: BTreeSet<String> = statistics.chain(weights).collect();
    let mut names = tensors.names();
    names.sort_unstable();
    match names.into_iter().find(|name| !known.contains(*name)) {
        Some(name) => Err(invalid(format!(
            "tensor {name} is in the file, but the spec of the model has no such weight"
        ))),
        None => Ok(()),
    }
}

fn read<'a>(
    tensors: &SafeTensors<'a>,
    name: &str,
    dtype: Dtype,
    shape: &[usize],
) -> Result<&'a [u8], ModelFileError> {
    let view = tensors.tensor(name).map_err(|_| {
        invalid(format!(
            "tensor {name} is missing: the weights are of another spec than the file says"
        ))
    })?;
    if view.dtype() != dtype || view.shape() != shape {
        let (found_dtype, found) = (view.dtype(), view.shape());
        return Err(invalid(format!(
            "tensor {name} is {found_dtype:?} {found:?}, but the spec of the model needs {dtype:?} {shape:?}"
        )));
    }
    Ok(view.data())
}

fn read_normalizer(
    tensors: &SafeTensors<'_>,
    of: &str,
    width: usize,
) -> Result<Normalizer, ModelFileError> {
    let [mean, deviation] = STATISTIC_KINDS.map(|kind| -> Result<Vec<f64>, ModelFileError> {
        let bytes = read(tensors, &statistic_name(of, kind), Dtype::F64, &[width])?;
        let numbers = bytes.as_chunks().0.iter();
        Ok(numbers.map(|b| f64::from_le_bytes(*b)).collect())
    });
    Normalizer::new(mean?, deviation?)
        .map_err(|problem| invalid(format!("normalizer.{of}: {problem}")))
}

#[cfg(test)]
pub(crate) mod tests;

//! Trained models.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use selvedge_data::write_atomically;
use selvedge_lab::assets;
use selvedge_model::{Model as Trained, ModelSpec, Network, Normalizer, Normalizers, Parameter};

use crate::arrays::{self, Numbers};
use crate::errors::{raised, word, wrong};
use crate::json;
use crate::pickling::{self, Call};

/// A trained model: a network, its weights and the statistics of its inputs and its output.
///
/// `Model(name_or_file)` opens a model file (.safetensors) or a shipped model by its name, by
/// default "paper".
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Model {
    /// Its file, or the name of the shipped one.
    #[pyo3(get)]
    pub(crate) name: String,
    pub(crate) model: Arc<Trained>,
}

impl Model {
    pub(crate) fn named(&self) -> selvedge::Model {
        selvedge::Model {
            name: self.name.clone(),
            model: Arc::clone(&self.model),
        }
    }
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (name_or_file=None))]
    fn new(py: Python<'_>, name_or_file: Option<PathBuf>) -> PyResult<Self> {
        let opened = py.detach(|| selvedge::Model::open(name_or_file.as_deref()));
        let selvedge::Model { name, model } = opened.map_err(raised)?;
        Ok(Self { name, model })
    }

    /// Names of the shipped models.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        assets::MODELS.iter().map(|model| model.0).collect()
    }

    /// Makes a model of arrays by their names, as `state_dict` gives them; PyTorch's tensors are
    /// taken too. `spec` is a dictionary or its JSON text.
    #[staticmethod]
    #[pyo3(signature = (spec, state, training="", name="from a state dict"))]
    fn from_state_dict(
        spec: &Bound<'_, PyAny>,
        state: &Bound<'_, PyDict>,
        training: &str,
        name: &str,
    ) -> PyResult<Self> {
        let spec: ModelSpec = json::from_python(spec)?;
        let network = Network::new(&spec).map_err(raised)?;
        let mut given = given(state)?;
        let mut weights = Vec::with_capacity(network.parameter_count());
        for parameter in network.parameters() {
            take_weight(&mut given, parameter, &mut weights)?;
        }
        let normalizers = Normalizers {
            nodes: take_normalizer(&mut given, "nodes")?,
            edges: take_normalizer(&mut given, "edges")?,
            acceleration: take_normalizer(&mut given, "acceleration")?,
        };
        if let Some(name) = given.keys().next() {
            return Err(wrong(format!(
                "{name} is in the state dict, but the spec of the model has no such weight"
            )));
        }
        let made = Trained::new(&spec, weights, normalizers, training.to_owned());
        Ok(Self {
            name: name.to_owned(),
            model: Arc::new(made.map_err(raised)?),
        })
    }

    /// The weights (float32) by the names that PyTorch gives the same modules, shared and not
    /// copied, and the statistics (float64) as normalizer.nodes.mean and so on.
    fn state_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let model = &slf.get().model;
        let state = PyDict::new(slf.py());
        for parameter in model.network().parameters() {
            let (range, shape) = (parameter.range.clone(), parameter.shape.clone());
            let array = arrays::shared(slf, |own| &own.model.weights()[range], shape)?;
            state.set_item(&parameter.name, array)?;
        }
        type Of = fn(&Normalizers) -> &Normalizer;
        type Part = fn(&Normalizer) -> &[f64];
        let all: [(&str, Of); 3] = [
            ("nodes", |all| &all.nodes),
            ("edges", |all| &all.edges),
            ("acceleration", |all| &all.acceleration),
        ];
        for (name, of) in all {
            let parts: [(&str, Part); 2] = [
                ("mean", Normalizer::mean),
                ("deviation", Normalizer::deviation),
            ];
            for (kind, part) in parts {
                let count = part(of(model.normalizers())).len();
                let array = arrays::shared(slf, |own| part(of(own.model.normalizers())), count)?;
                state.set_item(format!("normalizer.{name}.{kind}"), array)?;
            }
        }
        Ok(state)
    }

    /// Writes the model (.safetensors) with weights in f32, f16 or bf16.
    #[pyo3(signature = (path, weights="f32"))]
    fn write(&self, path: PathBuf, weights: &str) -> PyResult<()> {
        let bytes = self.bytes_as(weights)?;
        write_atomically(&path, |out| out.write_all(&bytes)).map_err(raised)
    }

    /// The bytes of the model's file.
    #[pyo3(signature = (weights="f32"))]
    fn to_bytes<'py>(&self, py: Python<'py>, weights: &str) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.bytes_as(weights)?))
    }

    /// The choices that make the network, as a dictionary.
    #[getter]
    fn spec<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, self.model.spec())
    }

    /// Account of its training: JSON, or free text.
    #[getter]
    fn training(&self) -> &str {
        &self.model.training
    }

    /// Number of weights.
    #[getter]
    fn parameters(&self) -> usize {
        self.model.weights().len()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Call<'py>> {
        pickling::call(py, "_model", (self.to_bytes(py, "f32")?, &self.name))
    }

    fn __repr__(&self) -> String {
        format!("Model({:?}, {} weights)", self.name, self.parameters())
    }
}

impl Model {
    fn bytes_as(&self, weights: &str) -> PyResult<Vec<u8>> {
        let weights = word("weights", weights)?;
        self.model.to_bytes_as(weights).map_err(raised)
    }
}

/// The layout of the network of a spec: a list of names and shapes.
///
/// # Errors
/// A spec of no network.
#[pyfunction]
pub(crate) fn layout(spec: &Bound<'_, PyAny>) -> PyResult<Vec<(String, Vec<usize>)>> {
    let spec: ModelSpec = json::from_python(spec)?;
    let network = Network::new(&spec).map_err(raised)?;
    let parameters = network.parameters().iter();
    Ok(parameters
        .map(|p| (p.name.clone(), p.shape.clone()))
        .collect())
}

/// The columns of the nodes and of the arcs of a spec, by name, as its network sees them.
///
/// # Errors
/// A spec that is none.
#[pyfunction]
pub(crate) fn columns(spec: &Bound<'_, PyAny>) -> PyResult<(Vec<String>, Vec<String>)> {
    let spec: ModelSpec = json::from_python(spec)?;
    let named = |columns: Vec<selvedge_model::Column>| {
        let names = columns.iter().map(|column| column.name.to_owned());
        names.collect()
    };
    let (nodes, edges) = (
        selvedge_model::node_columns(&spec),
        selvedge_model::edge_columns(&spec),
    );
    Ok((named(nodes), named(edges)))
}

type Given<'py> = BTreeMap<String, Bound<'py, PyAny>>;

/// The arrays of a state dict; tensors become arrays.
fn given<'py>(state: &Bound<'py, PyDict>) -> PyResult<Given<'py>> {
    let mut given = BTreeMap::new();
    for (name, value) in state.iter() {
        let value = if value.hasattr("detach")? {
            value
                .call_method0("detach")?
                .call_method0("cpu")?
                .call_method0("numpy")?
        } else {
            value
        };
        given.insert(name.extract()?, value);
    }
    Ok(given)
}

fn take_weight(
    given: &mut Given<'_>,
    parameter: &Parameter,
    weights: &mut Vec<f32>,
) -> PyResult<()> {
    let name = &parameter.name;
    let Some(value) = given.remove(name) else {
        return Err(wrong(format!(
            "{name} is missing: the state dict is of another spec"
        )));
    };
    let array: numpy::PyArrayLikeDyn<'_, f32, numpy::AllowTypeChange> = value.extract()?;
    if array.shape() != parameter.shape {
        return Err(wrong(format!(
            "{name} must have the shape {:?}, found {:?}",
            parameter.shape,
            array.shape()
        )));
    }
    weights.extend(array.as_array().iter());
    Ok(())
}

fn take_normalizer(given: &mut Given<'_>, name: &str) -> PyResult<Normalizer> {
    let mut of = |kind: &str| {
        let name = format!("normalizer.{name}.{kind}");
        let Some(value) = given.remove(&name) else {
            return Err(wrong(format!(
                "{name} is missing: a model needs the statistics of its inputs and its output"
            )));
        };
        let array: Numbers<'_> = value.extract()?;
        Ok(array.as_array().iter().copied().collect())
    };
    Normalizer::new(of("mean")?, of("deviation")?).map_err(raised)
}

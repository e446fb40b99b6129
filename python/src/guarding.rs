//! Guards by their names, and their word on a frame.

use std::collections::BTreeMap;

use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge_guard::{Replacement, Trust};

/// The words of a word.
fn words(trust: &Trust) -> [(&'static str, &'static str); 3] {
    let replaced = trust.verdict.replaced_by();
    [
        ("verdict", trust.verdict.name()),
        ("contact", trust.contact.name()),
        ("replaced_by", replaced.map_or("", Replacement::name)),
    ]
}

/// The guard's word on a frame.
pub(crate) fn word<'py>(py: Python<'py>, trust: &Trust) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("frame", trust.frame)?;
    for (name, word) in words(trust) {
        dict.set_item(name, word)?;
    }
    for (name, number) in trust.numbers() {
        dict.set_item(name, number.unwrap_or(f64::NAN))?;
    }
    dict.set_item("physics_failed", trust.physics_failed)?;
    Ok(dict)
}

/// The words on all frames as columns: arrays of numbers, lists of words.
pub(crate) fn columns<'py>(py: Python<'py>, log: &[Trust]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let frames: Vec<u64> = log.iter().map(|trust| trust.frame as u64).collect();
    dict.set_item("frame", frames.into_pyarray(py))?;
    let mut of_words: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let mut of_numbers: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for trust in log {
        for (name, word) in words(trust) {
            of_words.entry(name).or_default().push(word);
        }
        for (name, number) in trust.numbers() {
            let numbers = of_numbers.entry(name).or_default();
            numbers.push(number.unwrap_or(f64::NAN));
        }
    }
    for (name, words) in of_words {
        dict.set_item(name, words)?;
    }
    for (name, numbers) in of_numbers {
        dict.set_item(name, numbers.into_pyarray(py))?;
    }
    let failed: Vec<bool> = log.iter().map(|trust| trust.physics_failed).collect();
    dict.set_item("physics_failed", failed.into_pyarray(py))?;
    Ok(dict)
}

//! Accessors: arrays of numbers in the binary part of a .glb.
//!
//! Read are floats and, for rotations, normalised integers. Packed accessors, and buffers in other
//! files, are errors where they are needed.

use serde::Deserialize;

use super::{File, part};
use crate::formats::packing::little;
use crate::rig::node::RigError;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    form: String,
    sparse: Option<Sparse>,
}

/// Elements of an accessor in place of those of its view, or of zeros where it has none.
#[derive(Deserialize)]
struct Sparse {
    count: usize,
    indices: SparsePart,
    values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparsePart {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    /// Of the indices.
    #[serde(default)]
    component_type: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
    #[serde(default)]
    extensions: serde_json::Map<String, serde_json::Value>,
}

#[derive(Deserialize)]
pub(super) struct Buffer {
    uri: Option<String>,
}

const CUT: &str = "it reaches beyond the end of the file";
const UNKNOWN: &str =
    "it has numbers of a type that is not understood here: export without quantisation";

/// Bytes of a number, and the function that reads it.
type Component = (usize, fn(&[u8]) -> f64);

impl File<'_> {
    /// The numbers of an accessor whose elements have `width` of them.
    pub(super) fn numbers(&self, accessor: usize, width: usize) -> Result<Vec<f64>, RigError> {
        self.read(accessor, width, component)
    }

    /// The indices of an accessor whose elements have `width` of them.
    pub(super) fn indices(&self, accessor: usize, width: usize) -> Result<Vec<u32>, RigError> {
        let numbers = self.read(accessor, width, |kind, _| index(kind))?;
        Ok(numbers.into_iter().map(|number| number as u32).collect())
    }

    fn read(
        &self,
        accessor: usize,
        width: usize,
        component: fn(u32, bool) -> Option<Component>,
    ) -> Result<Vec<f64>, RigError> {
        let read = self.elements_of(accessor, width, component);
        read.map_err(|problem| part(format!("accessor {accessor}"), problem))
    }

    fn elements_of(
        &self,
        accessor: usize,
        width: usize,
        component: fn(u32, bool) -> Option<Component>,
    ) -> Result<Vec<f64>, String> {
        let found = self.document.accessors.get(accessor);
        let found = found.ok_or("there is none of this number")?;
        let forms = ["SCALAR", "VEC2", "VEC3", "VEC4"];
        let expected = forms.get(width - 1).unwrap_or(&"MAT4");
        if found.form != *expected {
            return Err(format!("expected {expected}, found {}", found.form));
        }
        let own = component(found.component_type, found.normalized).ok_or(UNKNOWN)?;
        let mut numbers = match found.buffer_view {
            Some(view) => self.elements(view, found.byte_offset, found.count, width, own)?,
            // No file has a byte less than its elements.
            None if found.count > self.binary.len() => return Err(CUT.to_owned()),
            None => vec![0.0; found.count * width],
        };
        if let Some(sparse) = &found.sparse {
            let (at, of) = (&sparse.indices, &sparse.values);
            let kind = index(at.component_type).ok_or(UNKNOWN)?;
            let places = self.elements(at.buffer_view, at.byte_offset, sparse.count, 1, kind)?;
            let values = self.elements(of.buffer_view, of.byte_offset, sparse.count, width, own)?;
            for (place, value) in places.into_iter().zip(values.chunks_exact(width)) {
                let element = numbers.chunks_exact_mut(width).nth(place as usize);
                let count = found.count;
                let beyond = || format!("it is sparse, with an element {place} of {count}");
                element.ok_or_else(beyond)?.copy_from_slice(value);
            }
        }
        Ok(numbers)
    }

    /// `count` elements of `width` numbers each, from byte `first` of a view on.
    fn elements(
        &self,
        view: usize,
        first: usize,
        count: usize,
        width: usize,
        (size, read): Component,
    ) -> Result<Vec<f64>, String> {
        let (view, bytes) = self.view(view)?;
        let stride = view.byte_stride.unwrap_or(size * width);
        if count > bytes.len() {
            return Err(CUT.to_owned());
        }
        let mut numbers = Vec::with_capacity(count * width);
        for element in 0..count {
            let start = element.checked_mul(stride);
            let start = start.and_then(|at| at.checked_add(first));
            let element = start
                .and_then(|start| bytes.get(start..start.checked_add(size * width)?))
                .ok_or(CUT)?;
            numbers.extend(element.chunks_exact(size).map(read));
        }
        Ok(numbers)
    }

    /// The view of this number, and its bytes.
    fn view(&self, number: usize) -> Result<(&View, &[u8]), String> {
        let document = &self.document;
        let view = document.buffer_views.get(number);
        let view = view.ok_or("it has no view of the binary part")?;
        let buffer = document.buffers.get(view.buffer);
        if view.buffer != 0 || buffer.is_none_or(|buffer| buffer.uri.is_some()) {
            return Err("its buffer is in another file: export as one .glb".to_owned());
        }
        if let Some(name) = view.extensions.keys().next() {
            return Err(format!(
                "it is packed by {name}, which is not understood here: export without"
            ));
        }
        let end = view.byte_offset.checked_add(view.byte_length).ok_or(CUT)?;
        let bytes = self.binary.get(view.byte_offset..end).ok_or(CUT)?;
        Ok((view, bytes))
    }
}

/// The indices of an accessor.
fn index(component_type: u32) -> Option<Component> {
    let size = match component_type {
        5121 => 1,
        5123 => 2,
        5125 => 4,
        _ => return None,
    };
    Some((size, |bytes| little(bytes) as f64))
}

/// The numbers of an accessor, where animations may have such.
fn component(component_type: u32, normalized: bool) -> Option<Component> {
    match (component_type, normalized) {
        (5126, false) => Some((4, |b| f64::from(f32::from_bits(little(b) as u32)))),
        (5120, true) => Some((1, |b| (f64::from(b[0] as i8) / 127.0).max(-1.0))),
        (5121, true) => Some((1, |b| f64::from(b[0]) / 255.0)),
        (5122, true) => Some((2, |b| (f64::from(little(b) as i16) / 32767.0).max(-1.0))),
        (5123, true) => Some((2, |b| little(b) as f64 / 65535.0)),
        _ => None,
    }
}

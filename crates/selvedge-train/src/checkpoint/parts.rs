//! A checkpoint in several files, where one would be large: many places take no file above 16 MB.
//!
//! Tensors are cut, and a piece is named after its tensor and its first element
//! (`weights+3000000`). The other files are named after their contents and listed in the first one,
//! which is written last: until then the checkpoint before is whole. Then what belongs to no
//! checkpoint any more is removed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use safetensors::SafeTensors;
use selvedge_data::{TensorOut, TensorValues, WriteError, read_header, write_tensors};

use super::error::ResumeError;

/// Most bytes of the numbers in one file; their names take a little more.
pub(super) const MOST_BYTES: usize = 15_000_000;

/// Metadata of the first file: the names of the others, separated by spaces.
const KEY: &str = "parts";

/// Numbers of a tensor from some element on.
struct Piece<'a> {
    name: String,
    shape: Vec<usize>,
    values: &'a [f32],
}

impl Piece<'_> {
    fn out(&self) -> TensorOut<'_> {
        TensorOut {
            name: &self.name,
            shape: self.shape.clone(),
            values: TensorValues::F32(self.values),
        }
    }
}

/// A tensor of a checkpoint: its name, its shape, its numbers.
pub(super) type Tensor<'a> = (&'a str, Vec<usize>, &'a [f32]);

/// Writes tensors to `path`, and to files beside it what would make it larger than `most` bytes.
pub(super) fn write(
    path: &Path,
    tensors: &[Tensor<'_>],
    metadata: &BTreeMap<&str, String>,
    most: usize,
) -> Result<(), WriteError> {
    let parts = cut(tensors, most);
    let mut names = Vec::new();
    for part in &parts[1..] {
        let name = part_name(path, part);
        let out: Vec<TensorOut<'_>> = part.iter().map(Piece::out).collect();
        write_tensors(&path.with_file_name(&name), &out, &BTreeMap::new())?;
        names.push(name);
    }
    let mut metadata = metadata.clone();
    if !names.is_empty() {
        metadata.insert(KEY, names.join(" "));
    }
    let out: Vec<TensorOut<'_>> = parts[0].iter().map(Piece::out).collect();
    write_tensors(path, &out, &metadata)?;
    remove_others(path, &names);
    Ok(())
}

/// The pieces of each file; there is at least one file.
fn cut<'a>(tensors: &[Tensor<'a>], most: usize) -> Vec<Vec<Piece<'a>>> {
    let most = (most / size_of::<f32>()).max(1);
    let (mut parts, mut room) = (vec![Vec::new()], most);
    for (name, shape, values) in tensors {
        let mut first = 0;
        loop {
            if room == 0 {
                parts.push(Vec::new());
                room = most;
            }
            let end = values.len().min(first + room);
            let whole = first == 0 && end == values.len();
            let count = parts.len() - 1;
            parts[count].push(Piece {
                name: if whole {
                    (*name).to_owned()
                } else {
                    format!("{name}+{first}")
                },
                shape: if whole {
                    shape.clone()
                } else {
                    vec![end - first]
                },
                values: &values[first..end],
            });
            room -= end - first;
            first = end;
            if first == values.len() {
                break;
            }
        }
    }
    parts
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

fn part_name(path: &Path, part: &[Piece<'_>]) -> String {
    let mut hasher = blake3::Hasher::new();
    for piece in part {
        hasher.update(piece.name.as_bytes());
        for value in piece.values {
            hasher.update(&value.to_le_bytes());
        }
    }
    let hash = hasher.finalize().to_hex();
    format!("{}.part-{}.safetensors", stem(path), &hash[..16])
}

/// Parts beside `path` that are not in `names`; that one cannot be removed does no harm.
fn remove_others(path: &Path, names: &[String]) {
    let begin = format!("{}.part-", stem(path));
    let Some(folder) = path.parent() else { return };
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_part = name.starts_with(&begin) && name.ends_with(".safetensors");
        if is_part && !names.contains(&name) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// The other files that the metadata of the first one at `path` list, with their contents.
pub(super) fn read_others(
    path: &Path,
    bytes: &[u8],
) -> Result<Vec<(PathBuf, Vec<u8>)>, ResumeError> {
    let header = read_header(bytes).map_err(|source| ResumeError::Container {
        path: path.to_owned(),
        source,
    })?;
    let names = header.metadata().as_ref().and_then(|m| m.get(KEY).cloned());
    let names = names.unwrap_or_default();
    let others = names.split_whitespace().map(|name| {
        // Only names beside the checkpoint, whatever a damaged file says.
        let name = Path::new(name).file_name().unwrap_or_default();
        let other = path.with_file_name(name);
        let bytes = read(&other)?;
        Ok((other, bytes))
    });
    others.collect()
}

/// The numbers of a tensor that lies in pieces in these files, whole, in order; none where there is
/// no piece.
pub(super) fn joined<'a>(
    files: impl Iterator<Item = &'a SafeTensors<'a>>,
    name: &str,
) -> Option<Vec<f32>> {
    let begin = format!("{name}+");
    let mut pieces: Vec<(usize, &[u8])> = Vec::new();
    for file in files {
        for (piece, view) in file.iter() {
            let first = piece
                .strip_prefix(&begin)
                .and_then(|rest| rest.parse().ok());
            pieces.extend(first.map(|first| (first, view.data())));
        }
    }
    pieces.sort_by_key(|(first, _)| *first);
    let mut values = Vec::new();
    for (first, bytes) in &pieces {
        if *first != values.len() {
            return None;
        }
        let numbers = bytes.as_chunks().0.iter();
        values.extend(numbers.map(|bytes| f32::from_le_bytes(*bytes)));
    }
    (!pieces.is_empty()).then_some(values)
}

/// The bytes of a file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, ResumeError> {
    selvedge_data::read_file(path).map_err(|source| ResumeError::Read {
        path: path.to_owned(),
        source,
    })
}

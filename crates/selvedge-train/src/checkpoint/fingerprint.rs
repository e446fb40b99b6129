//! The fingerprint of a data set, by which a checkpoint knows its own.

use selvedge_data::Dataset;

/// The fingerprint of a data set: its name and the hashes of its training trajectories.
pub(super) fn fingerprint(dataset: &Dataset) -> Result<String, serde_json::Error> {
    let index = dataset.index();
    let mut text = index.name.clone();
    for entry in &index.splits.train {
        text.push(' ');
        text.push_str(&entry.blake3);
    }
    text.push_str(&format!(" {}", serde_json::to_string(&index.sections)?));
    Ok(text)
}

/// The name of the data set in its fingerprint.
pub(super) fn name_in(fingerprint: &str) -> String {
    let name = fingerprint.split(' ').next();
    name.unwrap_or_default().to_owned()
}

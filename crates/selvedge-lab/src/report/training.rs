//! The log of a training.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

/// A line of a log: means since the last one.
#[derive(Debug, Deserialize)]
pub struct LogRow {
    /// The last step that it is of.
    pub step: u64,
    /// The whole loss.
    pub loss: f64,
    /// At its end.
    pub learning_rate: f64,
}

/// Reads the log of a training; a last line that was cut short is left out.
///
/// # Errors
/// When it cannot be read, with the line that is none.
pub fn training_log(path: &Path) -> Result<Vec<LogRow>> {
    let shown = path.display();
    let text =
        selvedge_data::read_text(path).with_context(|| format!("{shown}: could not be read"))?;
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let rows = (1..).zip(whole.lines()).map(|(number, line)| {
        serde_json::from_str(line)
            .with_context(|| format!("{shown}: line {number} is no line of a log"))
    });
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_lines_are_read_and_a_wrong_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        let line = |step: u32, loss: f64| {
            format!(
                "{{\"step\":{step},\"loss\":{loss},\"learning_rate\":1e-4,\"edge_length\":null,\"frames\":1}}\n"
            )
        };
        let text = [line(10, 4.0), line(20, 1.0), "{\"step\":30,\"lo".to_owned()].concat();
        std::fs::write(&path, &text).unwrap();
        let rows = training_log(&path).unwrap();
        let rows: Vec<_> = rows.iter().map(|row| (row.step, row.loss)).collect();
        assert_eq!(rows, [(10, 4.0), (20, 1.0)]);
        std::fs::write(&path, format!("{text}\n")).unwrap();
        let error = training_log(&path).err().unwrap();
        assert!(error.to_string().contains("line 3"), "{error}");
    }
}

//! The log of a training as curves: the loss by step, and the parts that it is made of.

use std::path::Path;

use anyhow::{Context, Result};
use selvedge_view::plot::{Line, LineChart, Role, Scale};
use serde::Deserialize;

use super::plots::axis;

/// The lines of a log.
pub struct TrainingLog {
    rows: Vec<LogRow>,
}

/// A line of a log: means since the last one.
#[derive(Debug, Deserialize)]
pub struct LogRow {
    /// The last step that it is of.
    pub step: u64,
    /// The whole loss.
    pub loss: f64,
    /// At its end.
    pub learning_rate: f64,
    acceleration: Option<f64>,
    kinetic_energy: Option<f64>,
    edge_vector: Option<f64>,
    edge_length: Option<f64>,
    bending_angle: Option<f64>,
}

impl TrainingLog {
    /// Reads the log of a training; a last line that was cut short is left out.
    ///
    /// # Errors
    /// When it cannot be read, with the line that is none.
    pub fn read(path: &Path) -> Result<Self> {
        let shown = path.display();
        let text = selvedge_data::read_text(path)
            .with_context(|| format!("{shown}: could not be read"))?;
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        let rows = (1..).zip(whole.lines()).map(|(number, line)| {
            serde_json::from_str(line)
                .with_context(|| format!("{shown}: line {number} is no line of a log"))
        });
        Ok(Self {
            rows: rows.collect::<Result<_>>()?,
        })
    }

    /// From the first to the last.
    pub fn rows(&self) -> &[LogRow] {
        &self.rows
    }
}

/// The curves of a training called `name`: the loss and, where there are several, its parts, before
/// their weights.
pub fn training_chart(name: &str, log: &TrainingLog) -> LineChart {
    type Part = fn(&LogRow) -> Option<f64>;
    let parts: [(&str, Part); 5] = [
        ("acceleration", |row| row.acceleration),
        ("kinetic energy", |row| row.kinetic_energy),
        ("edge vector", |row| row.edge_vector),
        ("edge length", |row| row.edge_length),
        ("bending angle", |row| row.bending_angle),
    ];
    let line = |name: &str, of: Part| {
        let points = log
            .rows
            .iter()
            .filter_map(|row| Some([row.step as f64, of(row)?]));
        Line {
            name: name.to_owned(),
            role: Role::Subject,
            points: points.collect(),
        }
    };
    let mut lines = vec![line("loss", |row| Some(row.loss))];
    let parts = parts.map(|(name, of)| line(name, of));
    let shown: Vec<Line> = parts
        .into_iter()
        .filter(|part| !part.points.is_empty())
        .collect();
    if shown.len() > 1 {
        lines.extend(shown);
    }
    LineChart {
        title: format!("Loss of {name}"),
        x: axis("step", Scale::Linear),
        y: axis(
            "mean over the steps of a line of the log",
            Scale::Logarithmic,
        ),
        lines,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_the_numbers_of_the_log() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        let line = |step: u32, loss: f64| {
            format!(
                "{{\"step\":{step},\"loss\":{loss},\"learning_rate\":1e-4,\"acceleration\":{},\"edge_length\":null,\"frames\":1}}\n",
                loss / 2.0
            )
        };
        let text = [line(10, 4.0), line(20, 1.0), "{\"step\":30,\"lo".to_owned()].concat();
        std::fs::write(&path, &text).unwrap();
        let log = TrainingLog::read(&path).unwrap();
        let chart = training_chart("x", &log);
        // One part is the loss itself but for its weight: it is not shown.
        assert_eq!(chart.lines.len(), 1);
        assert_eq!(chart.lines[0].points, [[10.0, 4.0], [20.0, 1.0]]);
        std::fs::write(&path, format!("{text}\n")).unwrap();
        let error = TrainingLog::read(&path).err().unwrap();
        assert!(error.to_string().contains("line 3"), "{error}");
    }
}

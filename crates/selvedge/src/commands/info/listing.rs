//! A report for people: the keys of an object under each other, objects in lists as tables.

use std::collections::BTreeSet;
use std::fmt::Write;

use serde_json::{Map, Value};

use crate::output::{Table, folded};

/// What only programs are told.
const FOR_PROGRAMS: [&str; 4] = ["config", "scene", "file", "blake3"];
/// Rows of a table that people are shown.
const ROWS: usize = 40;

/// The report of a file, in words.
pub(super) fn listed(report: &Map<String, Value>) -> String {
    let text = |key: &str| report.get(key).map_or_else(String::new, brief);
    let mut words = format!("{}  {}\n", text("kind"), text("file"));
    list(report, "", &mut words);
    words
}

fn is_shown((key, value): &(&String, &Value)) -> bool {
    let is_empty = value.is_null() || value.as_array().is_some_and(Vec::is_empty);
    !is_empty && *key != "kind" && !FOR_PROGRAMS.contains(&key.as_str())
}

fn list(object: &Map<String, Value>, pad: &str, text: &mut String) {
    let shown = || object.iter().filter(is_shown);
    let width = shown().map(|(key, _)| key.len()).max().unwrap_or(0);
    for (key, value) in shown() {
        let name = key.replace('_', " ");
        match value {
            Value::Object(inner) => {
                let _ = writeln!(text, "{pad}{name}");
                list(inner, &format!("{pad}  "), text);
            }
            Value::Array(rows) if rows.iter().any(Value::is_object) => {
                let _ = writeln!(text, "{pad}{name}\n{}", table(rows));
            }
            value => {
                let _ = writeln!(text, "{pad}{name:<width$}  {}", brief(value));
            }
        }
    }
}

/// Objects as rows, the name first.
fn table(rows: &[Value]) -> Table {
    let objects = || rows.iter().filter_map(Value::as_object);
    let shown = objects().flatten().filter(is_shown);
    let keys: BTreeSet<&String> = shown.map(|(key, _)| key).collect();
    let mut keys: Vec<&String> = keys.into_iter().collect();
    keys.sort_by_key(|key| *key != "name");
    let mut table = Table::new(keys.iter().map(|key| key.as_str()));
    for row in objects().take(ROWS) {
        table.row(
            keys.iter()
                .map(|key| row.get(*key).map_or_else(String::new, brief)),
        );
    }
    if rows.len() > ROWS {
        table.row([format!("and {} more", rows.len() - ROWS)]);
    }
    table
}

/// A value in a line; numbers with five digits.
fn brief(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Bool(holds) => if *holds { "yes" } else { "no" }.to_owned(),
        Value::Number(number) if number.is_f64() => {
            let rounded = format!("{:.4e}", number.as_f64().unwrap_or(f64::NAN));
            match rounded.parse::<f64>() {
                Ok(n) if n == 0.0 || (1e-4..1e9).contains(&n.abs()) => n.to_string(),
                Ok(n) => format!("{n:e}"),
                Err(_) => rounded,
            }
        }
        Value::Array(items) => folded(items.iter().map(brief)),
        Value::Null => "none".to_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn keys_are_told_with_their_values_and_objects_of_a_list_as_rows() {
        let report = json!({
            "kind": "mesh",
            "file": "a.obj",
            "faces": 2,
            "mean_edge": 0.123_456_789,
            "tiny": 1.25e-17,
            "nothing": [],
            "pattern": { "seam_edges": 3, "is_flat": true },
            "nodes": [{ "moves": null, "name": "a" }, { "moves": [0, 1.5], "name": "b" }],
        });
        let rows = "nodes\nname   moves\n------------\na       none\nb     0, 1.5\n";
        let expected = format!(
            "mesh  a.obj\nfaces      2\nmean edge  0.12346\n{rows}\npattern\n  is flat     yes\n  seam edges  3\ntiny       1.25e-17\n"
        );
        assert_eq!(listed(report.as_object().unwrap()), expected);
    }
}

//! Damage to JSON and TOML that leaves them readable: values of another kind, missing and unknown
//! keys, longer and shorter lists.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use super::pick::pick;
use super::text;

/// `input`, a JSON text, with one value changed; none if it is no JSON. One in four is damaged as
/// text, which makes keys that stand twice.
pub(super) fn damage(input: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    if rng.random_ratio(1, 4) {
        return Some(text::damage(input, input, rng));
    }
    let mut value: Value = serde_json::from_slice(input).ok()?;
    change(&mut value, rng);
    Some(value.to_string().into_bytes())
}

/// `input`, lines of JSON, with one line changed or its text.
pub(super) fn damage_line(input: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let all = std::str::from_utf8(input).ok()?;
    let mut lines: Vec<String> = all.lines().map(str::to_owned).collect();
    if lines.is_empty() || rng.random_ratio(1, 4) {
        return Some(text::damage(input, input, rng));
    }
    let at = rng.random_range(0..lines.len());
    let mut value: Value = serde_json::from_str(&lines[at]).ok()?;
    change(&mut value, rng);
    lines[at] = value.to_string();
    Some((lines.join("\n") + "\n").into_bytes())
}

/// `input`, a TOML text, with one value changed; none if it is no TOML.
pub(super) fn damage_toml(input: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    if rng.random_ratio(1, 3) {
        return Some(text::damage(input, input, rng));
    }
    let table: toml::Table = toml::from_str(std::str::from_utf8(input).ok()?).ok()?;
    let mut value = serde_json::to_value(table).ok()?;
    change(&mut value, rng);
    // TOML has no null, and its outermost value is a table.
    let table: toml::Table = serde_json::from_value(value).ok()?;
    Some(toml::to_string(&table).ok()?.into_bytes())
}

/// Changes one value somewhere in `value`. Text that is JSON itself is changed within.
pub(super) fn change(value: &mut Value, rng: &mut ChaCha8Rng) {
    let deeper = rng.random_ratio(9, 10);
    match value {
        Value::Object(map) if !map.is_empty() && deeper => {
            let at = rng.random_range(0..map.len());
            if let Some((_, inner)) = map.iter_mut().nth(at) {
                return change(inner, rng);
            }
        }
        Value::Array(list) if !list.is_empty() && deeper => {
            let at = rng.random_range(0..list.len());
            return change(&mut list[at], rng);
        }
        Value::String(text) if text.starts_with('{') && deeper => {
            if let Ok(mut inner) = serde_json::from_str(text) {
                change(&mut inner, rng);
                *text = inner.to_string();
                return;
            }
        }
        _ => {}
    }
    match value {
        Value::Object(map) if rng.random() => change_keys(map, rng),
        Value::Array(list) if rng.random() => change_list(list, rng),
        Value::Number(number) if rng.random() => {
            let scale = *pick(&[-1.0, 0.5, 2.0, 1e-9, 1e9, 1e300], rng);
            *value = json!(number.as_f64().unwrap_or(1.0) * scale);
        }
        _ => *value = surprise(rng),
    }
}

fn change_keys(map: &mut serde_json::Map<String, Value>, rng: &mut ChaCha8Rng) {
    let keys: Vec<String> = map.keys().cloned().collect();
    if keys.is_empty() {
        map.insert("extra".to_owned(), surprise(rng));
        return;
    }
    let key = pick(&keys, rng);
    match rng.random_range(0..3) {
        0 => drop(map.remove(key)),
        1 => {
            map.insert(format!("{key}x"), surprise(rng));
        }
        _ => {
            if let (Some(value), to) = (map.get(key).cloned(), pick(&keys, rng)) {
                map.insert(to.clone(), value);
            }
        }
    }
}

fn change_list(list: &mut Vec<Value>, rng: &mut ChaCha8Rng) {
    if list.is_empty() {
        list.push(surprise(rng));
        return;
    }
    let at = rng.random_range(0..list.len());
    match rng.random_range(0..4) {
        0 => drop(list.remove(at)),
        1 => list.insert(at, list[at].clone()),
        2 => list.truncate(at),
        _ => {
            let times = *pick(&[2, 30, 400], rng);
            list.extend(std::iter::repeat_n(list[at].clone(), times));
        }
    }
}

/// A value that is likely unexpected where it stands.
fn surprise(rng: &mut ChaCha8Rng) -> Value {
    let all = [
        json!(null),
        json!(true),
        json!(0),
        json!(-1),
        json!(1),
        json!(0.5),
        json!(-0.0),
        json!(7),
        json!(1e-300),
        json!(1e39),
        json!(1e300),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(""),
        json!("a"),
        json!("../../x"),
        json!("x".repeat(3000)),
        json!("é\u{0}\n\u{feff}"),
        json!([]),
        json!({}),
        json!([[[[[[]]]]]]),
        json!({ "a": { "a": { "a": 1 } } }),
        json!([1, 2, 3]),
        json!([0.0, 0.0, 0.0]),
    ];
    pick(&all, rng).clone()
}

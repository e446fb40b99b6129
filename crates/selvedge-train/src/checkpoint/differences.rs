//! The places where two configurations differ.

use selvedge_model::ModelSpec;
use serde_json::Value;

/// A place where two values differ, and both texts.
pub(crate) struct Difference {
    pub(crate) path: String,
    pub(crate) made: String,
    pub(crate) now: String,
}

/// The places where two networks differ but for their encoders, in words; none where they are the
/// same.
pub(crate) fn differences_but_encoder(
    made: &ModelSpec,
    now: &ModelSpec,
) -> Result<String, serde_json::Error> {
    let network = |spec: &ModelSpec| {
        serde_json::to_value(ModelSpec {
            encoder: now.encoder,
            ..spec.clone()
        })
    };
    let words = differences(&network(made)?, &network(now)?)
        .into_iter()
        .map(|Difference { path, made, now }| format!("model.{path} is {made} there, {now} here"));
    Ok(words.collect::<Vec<_>>().join("; "))
}

/// The places where two values differ. Tables of other keys (another kind of schedule) differ as a
/// whole.
pub(crate) fn differences(made: &Value, now: &Value) -> Vec<Difference> {
    if made == now {
        return Vec::new();
    }
    if let (Value::Object(made), Value::Object(now)) = (made, now)
        && made.keys().eq(now.keys())
    {
        let fields = made.iter().zip(now.values());
        let within = fields.flat_map(|((key, made), now)| {
            differences(made, now).into_iter().map(move |inner| {
                let dot = if inner.path.is_empty() { "" } else { "." };
                let path = format!("{key}{dot}{}", inner.path);
                Difference { path, ..inner }
            })
        });
        return within.collect();
    }
    vec![Difference {
        path: String::new(),
        made: made.to_string(),
        now: now.to_string(),
    }]
}

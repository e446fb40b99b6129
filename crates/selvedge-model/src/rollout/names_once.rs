//! A check that no object in a header has a name twice: readers of JSON silently take the last.

use std::collections::BTreeSet;
use std::fmt;

use safetensors::SafeTensorError;
use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Checks the names of the JSON text `header`.
pub(super) fn check_names_once(header: &[u8]) -> Result<(), SafeTensorError> {
    let checked = serde_json::from_slice(header);
    checked
        .map(|NamesOnce| ())
        .map_err(SafeTensorError::InvalidHeaderDeserialization)
}

/// A value of any kind, without its contents.
struct NamesOnce;

impl<'de> Deserialize<'de> for NamesOnce {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AnyValue)
    }
}

struct AnyValue;

impl<'de> Visitor<'de> for AnyValue {
    type Value = NamesOnce;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_bool<E>(self, _: bool) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_u64<E>(self, _: u64) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_i64<E>(self, _: i64) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_f64<E>(self, _: f64) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_str<E>(self, _: &str) -> Result<NamesOnce, E> {
        Ok(NamesOnce)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<NamesOnce, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(NamesOnce)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NamesOnce, A::Error> {
        let mut names = BTreeSet::new();
        while let Some(name) = map.next_key::<String>()? {
            map.next_value::<NamesOnce>()?;
            if let Some(twice) = names.replace(name) {
                let problem = format!("the key {twice:?} stands twice in one object: keep one");
                return Err(A::Error::custom(problem));
            }
        }
        Ok(NamesOnce)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_stands_twice_is_named() {
        let whole = br#"{"__metadata__":{"k":"1"},"a":{"k":[1,-2.5,null,true]},"b":3}"#;
        check_names_once(whole).unwrap();
        let twice: [&[u8]; 2] = [br#"{"k":1,"k":2}"#, br#"{"m":{"k":"1","k":"2"}}"#];
        for header in twice {
            let error = check_names_once(header).unwrap_err().to_string();
            assert!(error.contains("\"k\" stands twice"), "{error}");
        }
        assert!(check_names_once(b"{").is_err());
    }
}

//! A check that no object in a header has a name twice: readers of JSON silently take the last.

use std::collections::BTreeSet;
use std::fmt;

use safetensors::SafeTensorError;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, Visitor};

/// Checks the names in the JSON text `header` and in its metadata. Those in what it says of a
/// tensor are fields, which are read once or refused.
pub(super) fn check_names_once(header: &[u8]) -> Result<(), SafeTensorError> {
    let checked = NamesOnce.deserialize(&mut serde_json::Deserializer::from_slice(header));
    checked.map_err(SafeTensorError::InvalidHeaderDeserialization)
}

struct NamesOnce;

impl<'de> DeserializeSeed<'de> for NamesOnce {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for NamesOnce {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut names = BTreeSet::new();
        while let Some(name) = map.next_key::<String>()? {
            match &*name {
                "__metadata__" => map.next_value_seed(Self)?,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
            if let Some(twice) = names.replace(name) {
                let problem = format!("the key {twice:?} stands twice in one object: keep one");
                return Err(A::Error::custom(problem));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_stands_twice_is_named() {
        let whole = br#"{"__metadata__":{"k":"1"},"a":{"k":[1,-2.5,null,true]},"b":3}"#;
        check_names_once(whole).unwrap();
        let twice: [&[u8]; 2] = [
            br#"{"k":1,"k":2}"#,
            br#"{"__metadata__":{"k":"1","k":"2"}}"#,
        ];
        for header in twice {
            let error = check_names_once(header).unwrap_err().to_string();
            assert!(error.contains("\"k\" stands twice"), "{error}");
        }
        assert!(check_names_once(b"{").is_err());
    }
}

//! What decides a result, as JSON.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Everything that decides a result, in canonical JSON: names in alphabetical order, no space between. Equal settings have
/// the same text, of which kept results carry the digest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Canonical(Value);

impl Canonical {
    /// What `settings` serialises to.
    ///
    /// # Panics
    /// If it has no JSON form: a map whose keys are no text.
    #[allow(clippy::expect_used, reason = "a fault of the type, not of what it holds")]
    pub fn of(settings: impl Serialize) -> Self {
        Self(serde_json::to_value(settings).expect("settings have a JSON form"))
    }
}

impl fmt::Display for Canonical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Kept results are found by this text: it must not change.
    #[test]
    fn the_text_does_not_depend_on_the_order_in_which_settings_are_named() {
        let one =
            Canonical::of(json!({ "steps": 3, "fit": Canonical::of(json!({ "rate": 0.1, "a": null })) }));
        assert_eq!(one.to_string(), r#"{"fit":{"a":null,"rate":0.1},"steps":3}"#);
        assert_eq!(one, serde_json::from_str(r#"{"steps": 3, "fit": {"rate": 0.1, "a": null}}"#).unwrap());
    }
}

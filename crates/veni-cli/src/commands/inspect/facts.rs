//! What is said of a path or a device.

use std::fmt::Write as _;

use serde_json::{Map, Value};

/// What a path or a device turned out to be, and its properties in the order to show them.
pub(super) struct Facts {
    kind: &'static str,
    rows: Vec<(&'static str, String)>,
    json: Map<String, Value>,
}

impl Facts {
    pub(super) fn new(kind: &'static str) -> Self {
        Self { kind, rows: Vec::new(), json: Map::new() }
    }

    /// A property: a line of text, and the same for machines.
    pub(super) fn add(&mut self, name: &'static str, text: impl Into<String>, json: impl Into<Value>) {
        self.rows.push((name, text.into()));
        self.json.insert(name.replace([' ', '-'], "_"), json.into());
    }

    /// A property whose name comes from the file; machines find it under `attributes`.
    pub(super) fn attribute(&mut self, name: &str, value: &str) {
        let all = self.json.entry("attributes").or_insert_with(|| Value::Object(Map::new()));
        if let Value::Object(all) = all {
            all.insert(name.to_owned(), value.into());
        }
        self.rows.push(("attribute", format!("{name} = {value}")));
    }

    /// Sentences; machines find them as a list.
    pub(super) fn notes(&mut self, sentences: &[String]) {
        if !sentences.is_empty() {
            self.rows.extend(sentences.iter().map(|sentence| ("note", sentence.clone())));
            self.json.insert("notes".to_owned(), sentences.into());
        }
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.json.contains_key(name)
    }

    /// All of it below a title: "name: kind".
    pub(super) fn text(&self, name: &str) -> String {
        let mut text = format!("{name}: {}", self.kind);
        let width = self.rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (name, value) in &self.rows {
            // writing to a String cannot fail
            let _ = write!(text, "\n  {name:width$}  {value}");
        }
        text
    }

    /// All of it as one object, whose first field `key` is the name.
    pub(super) fn json(&self, key: &str, name: &str) -> Value {
        let mut object = Map::new();
        object.insert(key.into(), name.into());
        object.insert("kind".into(), self.kind.into());
        object.extend(self.json.clone());
        object.into()
    }
}

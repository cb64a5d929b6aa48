//! What the writer of a model file adds to its metadata: JSON that the evaluator keeps as text and does not read.

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

/// One JSON value, as it was written.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Notes(Box<RawValue>);

impl Notes {
    /// # Errors
    /// Text that is no JSON.
    pub fn new(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }

    /// The text.
    pub fn text(&self) -> &str {
        self.0.get()
    }
}

impl Default for Notes {
    fn default() -> Self {
        Notes(RawValue::NULL.to_owned())
    }
}

impl PartialEq for Notes {
    fn eq(&self, other: &Self) -> bool {
        self.text() == other.text()
    }
}

//! What can be wrong with a model file, or with what a model is asked for.

use std::fmt;

/// A sentence that names the place, the value and the remedy.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A value outside its domain.
    Input(String),
    /// A model file that is cut short, inconsistent or holds values it may not.
    ModelFile(String),
}

impl Error {
    /// An [`Error::Input`] with this sentence.
    pub fn input(sentence: impl Into<String>) -> Self {
        Error::Input(sentence.into())
    }

    /// An [`Error::ModelFile`] with this sentence.
    pub(crate) fn model_file(sentence: impl Into<String>) -> Self {
        Error::ModelFile(sentence.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Input(sentence) => f.write_str(sentence),
            Error::ModelFile(sentence) => write!(f, "not a usable model file: {sentence}"),
        }
    }
}

impl std::error::Error for Error {}

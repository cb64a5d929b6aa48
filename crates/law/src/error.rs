//! Errors of a requested law.

use std::fmt;

/// An error of a law.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A value outside its domain, or a formula that cannot be read; the sentence names the place, the value and the remedy.
    Input(String),
    /// A law that does not exist.
    UnknownLaw {
        /// The name given.
        name: String,
        /// The known names.
        known: String,
    },
}

impl Error {
    /// An [`Error::Input`] with this sentence.
    pub fn input(sentence: impl Into<String>) -> Self {
        Error::Input(sentence.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Input(sentence) => f.write_str(sentence),
            Error::UnknownLaw { name, known } => {
                write!(f, "no law is called {name:?}; there are {known}")
            }
        }
    }
}

impl std::error::Error for Error {}

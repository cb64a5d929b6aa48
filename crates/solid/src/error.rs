//! The one error type of the core: bad input, in a sentence with its place and value.
//!
//! Failure to converge is no error but a status in a result (`crate::equilibrium`).

use std::fmt;
use viscera_linear::FactorError;

/// Errors of bad input, and of work that was cancelled.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A value outside its domain; the sentence names the place, the value and the remedy.
    Input(String),
    /// A law that does not exist.
    Law(viscera_law::Error),
    /// A model file that is cut short, inconsistent or holds values it may not.
    ModelFile(String),
    /// A linear system that could not be factorised or solved.
    Factor(FactorError),
    /// The caller's progress callback asked to stop.
    Cancelled,
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
            Error::Law(error) => error.fmt(f),
            Error::ModelFile(sentence) => write!(f, "not a usable model file: {sentence}"),
            Error::Factor(error) => error.fmt(f),
            Error::Cancelled => f.write_str("stopped on request"),
        }
    }
}

impl std::error::Error for Error {}

impl From<FactorError> for Error {
    fn from(error: FactorError) -> Self {
        Error::Factor(error)
    }
}

impl From<viscera_law::Error> for Error {
    fn from(error: viscera_law::Error) -> Self {
        match error {
            viscera_law::Error::Input(sentence) => Error::Input(sentence),
            unknown @ viscera_law::Error::UnknownLaw { .. } => Error::Law(unknown),
        }
    }
}

//! Errors of a model as errors of the solvers.

use crate::error::Error;

/// Turns an error of a model into one of the reduction.
pub fn refused(error: viscera_touch::Error) -> Error {
    match error {
        viscera_touch::Error::Input(sentence) => Error::Input(sentence),
        viscera_touch::Error::ModelFile(sentence) => Error::ModelFile(sentence),
    }
}

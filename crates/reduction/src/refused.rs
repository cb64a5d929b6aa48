//! Errors of a model as errors of the solvers.

use crate::error::Error;

/// Turns an error of a model into one of the reduction.
pub fn refused(error: viscera_touch::Error) -> Error {
    match error {
        viscera_touch::Error::Input(sentence) => Error::Input(sentence),
        viscera_touch::Error::ModelFile(sentence) => Error::ModelFile(sentence),
    }
}

/// The same of a model that was just put together: there is no file that could be damaged.
pub(super) fn unusable(error: viscera_touch::Error) -> Error {
    let (viscera_touch::Error::Input(sentence) | viscera_touch::Error::ModelFile(sentence)) = error;
    Error::input(format!("the reduced model cannot be evaluated: {sentence}"))
}

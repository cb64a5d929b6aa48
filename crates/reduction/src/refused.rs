//! What a model says is wrong, among the errors of the solvers.

use crate::error::Error;

/// An error of a model as one of what made it.
pub fn refused(error: viscera_touch::Error) -> Error {
    match error {
        viscera_touch::Error::Input(sentence) => Error::Input(sentence),
        viscera_touch::Error::ModelFile(sentence) => Error::ModelFile(sentence),
    }
}

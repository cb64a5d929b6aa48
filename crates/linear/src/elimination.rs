//! How the values of a factor are computed: front by front or, where it is large, by faer.

use faer::dyn_stack::{MemBuffer, StackReq};

use super::analysis::Analysis;
use super::fronts::Fronts;
use super::{FactorError, Precision};

/// The two ways.
pub(super) enum Elimination<T> {
    /// By subtrees, on all threads.
    Fronts(Fronts<T>),
    /// By faer, on all threads, in this memory.
    Shared(MemBuffer),
}

impl<T: Precision> Elimination<T> {
    /// The one for the size of the factor; `request` tells the memory that faer would need.
    ///
    /// # Errors
    /// No memory.
    pub fn new(
        analysis: &Analysis<T>,
        request: impl FnOnce(&Analysis<T>) -> StackReq,
    ) -> Result<Self, FactorError> {
        if !analysis.is_large {
            return Ok(Elimination::Fronts(Fronts::new(&analysis.supernodes, &analysis.lower)?));
        }
        let memory = MemBuffer::try_new(request(analysis)).map_err(|_| FactorError::OutOfMemory)?;
        Ok(Elimination::Shared(memory))
    }
}

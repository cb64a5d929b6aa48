//! The file of a Galerkin model: that of its series, with the cells of every region as further arrays.

use super::model::{Galerkin, Sampling};
use crate::error::Error;
use crate::reduced::ReducedModel;
use crate::reduced::file::{broken, decode, encode};
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

/// Key of the settings in the file's header.
const KEY: &str = "viscera galerkin";
const START: &str = "sampled_start";
const CELLS: &str = "sampled_cells";

/// What the header says.
#[derive(Serialize, Deserialize)]
struct Header {
    order: usize,
    tolerance: f64,
    depth: f64,
    seconds: f64,
}

impl Galerkin {
    /// The model file, which those who know of single touches only can read as well.
    ///
    /// # Errors
    /// Metadata that cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        let Sampling { order, tolerance, depth } = self.sampling;
        let header = Header { order, tolerance, depth, seconds: self.seconds };
        let text = serde_json::to_string(&header)
            .map_err(|e| Error::ModelFile(format!("settings cannot be written: {e}")))?;
        let mut start = vec![0u32];
        for cells in &self.cells {
            start.push(start[start.len() - 1] + cells.len() as u32);
        }
        let arrays = vec![encode(START, &start, 1), encode(CELLS, &self.cells.concat(), 1)];
        self.model.to_bytes_with(arrays, vec![(KEY.to_string(), text)])
    }

    /// Reads a model file, checking everything before anything is used.
    ///
    /// # Errors
    /// [`Error::ModelFile`]: whatever is wrong with the series model, or a file without cells, with cells that do not
    /// exist, or that do not belong to its regions.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let model = ReducedModel::from_bytes(bytes)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(broken)?;
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let text = header.metadata().as_ref().and_then(|map| map.get(KEY)).ok_or_else(|| {
            Error::ModelFile(
                "it is of single touches only; make one of several with galerkin()".into(),
            )
        })?;
        let Header { order, tolerance, depth, seconds } = serde_json::from_str(text)
            .map_err(|e| Error::ModelFile(format!("settings are damaged: {e}")))?;
        let (start, cells): (Vec<u32>, Vec<u32>) =
            (decode(&tensors, START, 1)?, decode(&tensors, CELLS, 1)?);
        if start.len() != model.n_regions() + 1
            || !start.is_sorted()
            || start.first() != Some(&0)
            || start.last() != Some(&(cells.len() as u32))
        {
            return Err(Error::ModelFile(format!(
                "{START} does not divide {} cells among {} regions",
                cells.len(),
                model.n_regions()
            )));
        }
        let limit = model.arrays().cells.len() / 4;
        if let Some(place) = cells.iter().position(|&cell| cell as usize >= limit) {
            return Err(Error::ModelFile(format!(
                "{CELLS}[{place}] = {}; it must be below {limit}",
                cells[place]
            )));
        }
        let of_region = |w: &[u32]| cells[w[0] as usize..w[1] as usize].to_vec();
        let cells = start.windows(2).map(of_region).collect();
        Galerkin::with_cells(model, Sampling { order, tolerance, depth }, cells, seconds)
    }
}

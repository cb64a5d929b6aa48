//! A case in the form that a page receives: safetensors bytes with an organ, the laws to choose from, and its name.

use safetensors::{Dtype, SafeTensors};
use serde::Deserialize;
use std::collections::BTreeMap;
use viscera_core::Error;
use viscera_core::body::Body;
use viscera_core::element::Element;
use viscera_core::law::{self, Material};

/// Key of the metadata string among the bytes.
const METADATA_KEY: &str = "viscera";

/// The metadata of a case.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Name to show.
    pub name: String,
    /// The initial law.
    pub law: String,
    /// The core's name for each law; its parameters are the array of the law's own name.
    pub laws: BTreeMap<String, String>,
    /// Name of the element.
    pub element: String,
    /// Of the contact patch of a hand [m].
    pub radius: f64,
    /// Of the bounding box [m].
    pub diagonal: f64,
    /// To begin with [m/s^2].
    pub gravity: [f64; 3],
    /// Kinds of loads of the case file that are not applied.
    #[serde(default)]
    pub left_out: Vec<String>,
}

/// An organ, and the laws to choose from.
#[derive(Clone, Debug)]
pub struct Case {
    /// The metadata.
    pub about: About,
    /// Fixed nodes, ascending.
    pub fixed: Vec<u32>,
    /// One density or one per cell [kg/m^3].
    pub density: Vec<f64>,
    points: Vec<[f64; 3]>,
    cells: Vec<[u32; 4]>,
    materials: BTreeMap<String, Material>,
}

impl Case {
    /// Reads the bytes of a case.
    ///
    /// # Errors
    /// A sentence that says what is missing or wrong.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let refuse = |what: String| Error::input(format!("not a usable case: {what}"));
        let (_, header) =
            SafeTensors::read_metadata(bytes).map_err(|error| refuse(error.to_string()))?;
        let text = header.metadata().as_ref().and_then(|notes| notes.get(METADATA_KEY));
        let text = text.ok_or_else(|| refuse("it has no metadata".into()))?;
        let about: About =
            serde_json::from_str(text).map_err(|error| refuse(format!("metadata: {error}")))?;
        let arrays = SafeTensors::deserialize(bytes).map_err(|error| refuse(error.to_string()))?;
        let is_length = |x: f64| x > 0.0 && x.is_finite();
        if !is_length(about.radius) || !is_length(about.diagonal) {
            return Err(refuse(format!(
                "radius {} m and diagonal {} m; both must be positive",
                about.radius, about.diagonal
            )));
        }
        if !about.laws.contains_key(&about.law) {
            return Err(refuse(format!("the law {:?} is not among its laws", about.law)));
        }
        let mut materials = BTreeMap::new();
        for (name, core_name) in &about.laws {
            let columns = Material::parameter_names(core_name)?.len();
            let rows = doubles(&arrays, name)?;
            let rows = rows.chunks(columns).map(<[f64]>::to_vec).collect();
            materials.insert(name.clone(), Material::new(core_name, rows)?);
        }
        let mut fixed = indices(&arrays, "fixed")?;
        fixed.sort_unstable();
        Ok(Case {
            points: rows(doubles(&arrays, "points")?),
            cells: rows(indices(&arrays, "cells")?),
            density: doubles(&arrays, "density")?,
            fixed,
            materials,
            about,
        })
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// The organ under a law.
    ///
    /// # Errors
    /// An unknown law; a mesh or an element that is none.
    pub fn body(&self, law: &str) -> Result<Body, Error> {
        let material = self.materials.get(law).ok_or_else(|| {
            let known: Vec<&str> = self.materials.keys().map(String::as_str).collect();
            law::Error::UnknownLaw { name: law.into(), known: known.join(", ") }
        })?;
        let element = Element::named(&self.about.element)?;
        Body::with_element(element, self.points.clone(), self.cells.clone(), material.clone())
    }
}

fn array<'a>(arrays: &'a SafeTensors<'_>, name: &str, dtype: Dtype) -> Result<&'a [u8], Error> {
    match arrays.tensor(name) {
        Ok(view) if view.dtype() == dtype => Ok(view.data()),
        _ => Err(Error::input(format!("not a usable case: it has no array {name:?} of {dtype:?}"))),
    }
}

fn doubles(arrays: &SafeTensors<'_>, name: &str) -> Result<Vec<f64>, Error> {
    let bytes = array(arrays, name, Dtype::F64)?.chunks_exact(8);
    Ok(bytes.map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default())).collect())
}

fn indices(arrays: &SafeTensors<'_>, name: &str) -> Result<Vec<u32>, Error> {
    let bytes = array(arrays, name, Dtype::U32)?.chunks_exact(4);
    Ok(bytes.map(|b| u32::from_le_bytes(b.try_into().unwrap_or_default())).collect())
}

fn rows<T: Copy, const N: usize>(values: Vec<T>) -> Vec<[T; N]> {
    values.chunks_exact(N).map(|row| std::array::from_fn(|i| row[i])).collect()
}

//! Checksums against damage: the CRC-32 of zlib over every array, and over the metadata that list them.
//!
//! The metadata end with the two entries that are written here:
//!   {..., "array_crc32": {"cells": 1, ...}, "crc32": 2}
//! `crc32` is that of all text before the comma that precedes it.

use crate::Error;
use safetensors::SafeTensors;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

/// What precedes the checksum of the metadata.
const LAST_ENTRY: &str = ",\"crc32\":";

/// The checksums of a file's arrays, by name.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Checksums {
    array_crc32: BTreeMap<String, u32>,
}

/// The entries of sealed metadata, either of which tells that there were checksums.
#[derive(Deserialize)]
struct Entries {
    array_crc32: Option<IgnoredAny>,
    crc32: Option<IgnoredAny>,
}

impl Checksums {
    /// Whether metadata have checksums, whatever version they state: a flipped bit of the version must not hide them.
    pub fn are_in(metadata: &str) -> bool {
        let entries = serde_json::from_str(metadata);
        entries.is_ok_and(|Entries { array_crc32, crc32 }| array_crc32.is_some() || crc32.is_some())
    }

    pub fn add(&mut self, name: &str, bytes: &[u8]) {
        self.array_crc32.insert(name.to_string(), crc32fast::hash(bytes));
    }

    /// Metadata, which are a JSON object, with all checksums.
    pub fn sealed(&self, metadata: &str) -> String {
        let entries: Vec<String> =
            self.array_crc32.iter().map(|(name, crc)| format!("\"{name}\":{crc}")).collect();
        let open = metadata.strip_suffix('}').unwrap_or(metadata);
        let text = format!("{open},\"array_crc32\":{{{}}}", entries.join(","));
        let crc = crc32fast::hash(text.as_bytes());
        format!("{text}{LAST_ENTRY}{crc}}}")
    }

    /// The checksums in the text of sealed metadata.
    ///
    /// # Errors
    /// Metadata that are not as they were written.
    pub fn read(metadata: &str) -> Result<Self, Error> {
        let (text, crc) = metadata
            .rsplit_once(LAST_ENTRY)
            .ok_or_else(|| Error::model_file("its metadata are damaged: they have no checksum"))?;
        if crc != format!("{}}}", crc32fast::hash(text.as_bytes())) {
            return Err(damaged("its metadata are"));
        }
        serde_json::from_str(metadata)
            .map_err(|e| Error::model_file(format!("metadata is damaged: {e}")))
    }

    /// Compares the arrays of a file with their checksums.
    ///
    /// # Errors
    /// An array that is missing, not listed, or not as it was written.
    pub fn check(&self, arrays: &SafeTensors) -> Result<(), Error> {
        for (name, &crc) in &self.array_crc32 {
            match arrays.tensor(name) {
                Ok(array) if crc32fast::hash(array.data()) == crc => (),
                Ok(_) => return Err(damaged(&format!("array {name} is"))),
                Err(_) => return Err(Error::model_file(format!("array {name} is missing"))),
            }
        }
        match arrays.iter().find(|(name, _)| !self.array_crc32.contains_key(*name)) {
            Some((name, _)) => Err(Error::model_file(format!("array {name} has no checksum"))),
            None => Ok(()),
        }
    }
}

fn damaged(what: &str) -> Error {
    Error::model_file(format!("{what} damaged: the checksum differs; get the file anew"))
}

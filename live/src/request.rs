//! The requests of a page, with checks of their words and numbers.

use serde::Deserialize;
use viscera_core::Error;

/// A request; entries that are absent change nothing.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Request {
    pub laws: Option<Vec<String>>,
    pub release: Option<bool>,
    pub grab: Option<[f64; 3]>,
    #[serde(rename = "move")]
    pub displacement: Option<[f64; 3]>,
    pub second: Gesture,
    pub gravity: Option<[f64; 3]>,
    pub stress: Option<bool>,
}

/// The action of one hand; the entries of the first hand are in the request itself.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Gesture {
    pub release: Option<bool>,
    pub grab: Option<[f64; 3]>,
    #[serde(rename = "move")]
    pub displacement: Option<[f64; 3]>,
}

/// No number of a request is as large as this.
const LARGEST: f64 = 1e6;

impl Request {
    /// Reads a JSON object.
    pub fn read(text: &str) -> Result<Self, Error> {
        if !text.trim_start().starts_with('{') {
            return Err(Error::input("a request is a JSON object"));
        }
        let request: Request = serde_json::from_str(text)
            .map_err(|error| Error::input(format!("a request cannot be read: {error}")))?;
        let [first, second] = request.gestures();
        let vectors = [
            ("grab", first.grab),
            ("move", first.displacement),
            ("grab of the second hand", second.grab),
            ("move of the second hand", second.displacement),
            ("gravity", request.gravity),
        ];
        for (name, vector) in vectors {
            if let Some(x) = vector.into_iter().flatten().find(|x| x.abs() >= LARGEST) {
                return Err(Error::input(format!("{name} is {x:e}; it must be below {LARGEST:e}")));
            }
        }
        match &request.laws {
            Some(laws) if !(1..=2).contains(&laws.len()) => Err(Error::input(format!(
                "laws are a list of one or two names, got {}",
                laws.len()
            ))),
            _ => Ok(request),
        }
    }

    /// The actions of the first and the second hand.
    pub fn gestures(&self) -> [Gesture; 2] {
        let first =
            Gesture { release: self.release, grab: self.grab, displacement: self.displacement };
        [first, self.second]
    }
}

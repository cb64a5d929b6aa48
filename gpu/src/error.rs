//! Errors of the device, each a sentence for the user.

use std::fmt;

/// Why a call to the device failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// There is no device that can compute.
    Missing(String),
    /// The device is gone: unplugged, reset by its driver, or shut down.
    Lost(String),
    /// The device has not enough memory.
    Memory(String),
    /// The problem exceeds a limit of the device.
    Limit(String),
    /// The input is not valid.
    Input(String),
    /// The driver refused a program or a command.
    Refused(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Missing(why) => write!(f, "there is no graphics processor to compute on: {why}"),
            Error::Lost(why) => write!(f, "the graphics processor was lost: {why}"),
            Error::Memory(what) => {
                write!(f, "the graphics processor does not have enough memory for {what}")
            }
            Error::Limit(what) => write!(f, "{what}"),
            Error::Input(what) => write!(f, "{what}"),
            Error::Refused(why) => write!(f, "the graphics driver refused: {why}"),
        }
    }
}

impl std::error::Error for Error {}

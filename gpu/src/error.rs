//! What can go wrong on a device, in one sentence for people.

use std::fmt;

/// Why the device did not do what it was asked to.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// There is no device, or none that computes.
    Missing(String),
    /// The device is gone: unplugged, reset by its driver, or shut down.
    Lost(String),
    /// The device has not enough memory.
    Memory(String),
    /// The problem exceeds a limit of the device.
    Limit(String),
    /// The input makes no sense.
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
                write!(f, "the graphics processor has not enough memory for {what}")
            }
            Error::Limit(what) => write!(f, "{what}"),
            Error::Input(what) => write!(f, "{what}"),
            Error::Refused(why) => write!(f, "the graphics driver refused: {why}"),
        }
    }
}

impl std::error::Error for Error {}

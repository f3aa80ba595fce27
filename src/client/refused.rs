//! The value that a client returns if it does not queue a request.

use super::request::ClientRequest;
use crate::error::Error;
use core::fmt;

/// A request that [`Client::queue`](super::Client::queue) has refused, and hands back. In a
/// function that returns [`Error`], `?` passes the reason on and drops the request.
pub struct Refused<J>(pub J);

impl<J: ClientRequest> Refused<J> {
    /// Why it was refused.
    pub fn error(&self) -> Error {
        match self.0.state().status.result() {
            Err(error) => error,
            // The program has changed the state since.
            Ok(()) => Error::INVALID_ARGUMENT,
        }
    }
}

impl<J: ClientRequest> From<Refused<J>> for Error {
    fn from(refused: Refused<J>) -> Error {
        refused.error()
    }
}

impl<J: ClientRequest> fmt::Debug for Refused<J> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter
            .debug_tuple("Refused")
            .field(&self.error())
            .finish()
    }
}

impl<J: ClientRequest> fmt::Display for Refused<J> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        fmt::Display::fmt(&self.error(), formatter)
    }
}

impl<J: ClientRequest> core::error::Error for Refused<J> {}

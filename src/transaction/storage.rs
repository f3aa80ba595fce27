//! What the caller lends to a transaction: a frame buffer, and counters to count in.

/// What is counted, in the order of the counters' storage.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Counter {
    /// Requests sent, retries included.
    Requests,
    /// Replies that answered a request, exceptions included.
    Replies,
    /// Replies that were exceptions.
    Exceptions,
    /// Complete replies with a wrong CRC.
    BadCrc,
    /// Requests that were not answered in time.
    Timeouts,
    /// Frames with a right CRC that were not for us or no answer.
    ForeignFrames,
    /// Replies that were found behind bytes that were no frame.
    Resynchronisations,
    /// Bytes sent.
    BytesSent,
    /// Bytes received.
    BytesReceived,
}

/// How many kinds of [`Counter`] there are.
pub const COUNTERS: usize = 9;

/// What the caller lends to a transaction.
pub trait Storage {
    /// One frame: of a request first, then of what arrives.
    fn frame(&mut self) -> &mut [u8];

    /// Adds to a counter, if there is storage for counters.
    fn count(&mut self, _counter: Counter, _more: u16) {}
}

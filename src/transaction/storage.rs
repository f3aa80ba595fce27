//! What the caller lends to a transaction: buffers, and counters to count in.

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

    /// The words that writing requests send.
    fn transmit(&mut self) -> &mut [u16] {
        &mut []
    }

    /// The words that a successful read fills.
    fn response(&mut self) -> &mut [u16] {
        &mut []
    }

    /// Frame and transmit words at once.
    fn frame_and_transmit(&mut self) -> (&mut [u8], &[u16]) {
        (self.frame(), &[])
    }

    /// Frame and response words at once.
    fn frame_and_response(&mut self) -> (&[u8], &mut [u16]) {
        (self.frame(), &mut [])
    }

    /// Adds to a counter, if there is storage for counters.
    fn count(&mut self, _counter: Counter, _more: u16) {}
}

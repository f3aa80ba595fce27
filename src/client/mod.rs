//! A client that never waits. The caller queues requests; `poll` advances them and
//! returns each request that has ended.
//!
//! A serial line carries one request at a time, a TCP stream as many as the program allows. [`Request`] is a request with its data in slices. A program that keeps the data
//! in another way, as the C API does, implements [`ClientRequest`]. The client copies data only
//! between a request and a frame buffer.

mod accessors;
#[cfg(feature = "embedded-io-async")]
mod asynchronous;
mod blocking;
mod call;
mod calls;
mod lenient;
mod link;
mod policy;
mod queue;
mod ready;
mod request;
mod serial;
mod storage;
mod tcp;
mod transaction;
mod units;

#[cfg(feature = "embedded-io-async")]
pub use asynchronous::AsyncClient;
pub use blocking::BlockingClient;
// Only the calls of a client that waits have it.
#[doc(hidden)]
pub use call::Call;
pub use call::{CommEventCounter, CommEventLog, ReadRecords, WriteRecords, CALL_BYTES};
// For the C API; it may change in any version.
#[doc(hidden)]
pub use link::{Link, LinkEvent, LinkHooks, LinkState, MOST_REPLACE_AFTER};
// For the C API; it may change in any version.
#[doc(hidden)]
pub use policy::{again, again_when_busy};
pub use policy::{Backoff, Policy, Waits, NO_RETRIES};
// A client has it inside.
#[doc(hidden)]
pub use queue::RequestQueue;
pub use ready::Request;
pub use request::{ClientRequest, Refused, RequestState};
// For the C API; it may change in any version.
#[doc(hidden)]
pub use serial::late_rest;
pub use storage::{ClientStorage, TcpBuffers};
pub use tcp::{Tcp, TolerantTcp, ACCEPT_TRANSACTION, ACCEPT_UNIT};
// `Serial` is a name of it.
#[doc(hidden)]
pub use transaction::ClientTransaction;
pub use transaction::Serial;
pub use units::UnitRecord;
// For the C API; it may change in any version.
#[doc(hidden)]
pub use units::{find, note, rest};

pub use crate::engine::{Count, Counter, Frame, MicrosSetting, Settings, Storage};

#[cfg(doc)]
use crate::error::{Error, Status};
use crate::time::millis;

/// The pause, in microseconds, that ends a frame of a serial line in a TCP stream.
pub const STREAM_SILENCE: u32 = millis(20);

/// The pause between two characters, in microseconds, that ends an incomplete ASCII
/// frame (serial line guide V1.02, 2.5.2.1).
pub const ASCII_SILENCE: u32 = millis(1000);

/// Time until the next attempt to write, in microseconds, after a port did not accept
/// all bytes.
const WRITE_RETRY_DELAY: u32 = millis(1);

/// A client on a [`Transport`], for up to `N` pending requests.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
/// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
/// use mbm::port::Port;
///
/// let mut words = [0; 2];
/// let mut client: Client<_, _, 4> = Client::new(line);
/// client.settings().response_timeout.set_timeout(500)?;
/// client.policy().retries = 2;
/// client.queue(Request::read_holding_registers(17, 107, &mut words)?)?;
/// assert_eq!(client.pending(), 1);
///
/// // In the main loop:
/// # let ended = loop {
/// let now = client.port().micros(); // Or another clock.
/// if let Some(request) = client.poll(now) {
///     request.result()?;
///     assert_eq!(request.registers(), [555, 100]);
/// #   break request;
/// }
/// let sleep = client.poll_delay(now); // Microseconds.
/// # };
/// assert!(client.is_connected());
/// assert_eq!(client.unanswered(), 0);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Client<L, J, const N: usize> {
    queue: RequestQueue<J, N>,
    /// The last poll returned a request, so the next one continues it: it reads no new bytes.
    is_continued: bool,
    /// The serial line or TCP stream.
    pub line: L,
}

impl<L, J, const N: usize> Client<L, J, N> {
    /// The policy for retries.
    pub fn policy(&mut self) -> &mut Policy {
        &mut self.queue.policy
    }

    /// False after the link was lost, until a reply arrives, or until the caller calls
    /// [`Client::reconnect`].
    pub const fn is_connected(&self) -> bool {
        self.queue.connected
    }

    /// Takes the line back after [`Client::suspend`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut client: Client<_, Request, 4> = Client::new(line);
    /// assert!(client.suspend());
    /// // Another object has used the line.
    /// client.take_back();
    /// # Ok(())
    /// # }
    /// ```
    pub fn take_back(&mut self) {
        self.queue.suspended = false;
    }

    /// Number of pending requests: queued or in flight.
    pub fn pending(&self) -> usize {
        self.queue.pending()
    }
}

impl<L: Transport<J>, J: ClientRequest, const N: usize> Client<L, J, N> {
    /// A client without requests.
    pub const fn new(line: L) -> Self {
        let mut queue = RequestQueue::new();
        queue.has_broadcast = L::HAS_BROADCAST;
        queue.has_transaction_ids = L::HAS_TRANSACTION_IDS;
        Client {
            queue,
            is_continued: false,
            line,
        }
    }

    /// Timeouts and other settings of requests. On a serial line set the baud rate:
    /// `client.settings().set_baud_rate(19200)`. On TCP only the response timeout matters, and the
    /// turnaround delay for requests without a response.
    pub fn settings(&mut self) -> &mut Settings {
        self.line.settings()
    }

    /// The port. Call [`Client::reconnect`] after a new socket was put in its place.
    pub fn port(&mut self) -> &mut L::Port {
        self.line.port()
    }

    /// The buffers.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// use mbm::client::Storage;
    ///
    /// // A program that has its own storage finds its counters there.
    /// fn memory<L: mbm::client::Transport<J>, J: mbm::client::ClientRequest>(
    ///     client: &mut Client<L, J, 4>,
    /// ) -> &mut L::Storage {
    ///     client.storage()
    /// }
    /// let mut client: Client<_, Request, 4> = Client::new(line);
    /// memory(&mut client);
    /// # Ok(())
    /// # }
    /// ```
    pub fn storage(&mut self) -> &mut L::Storage {
        self.line.storage()
    }

    /// Queues a request. [`Client::poll`] returns it when it has ended.
    ///
    /// # Errors
    /// [`Refused`] has the request, and one of these errors: [`Error::QueueFull`];
    /// [`Error::BroadcastNotAllowed`] for unit 0, but not in TCP frames; on TCP [`Error::DuplicateTransaction`] if its
    /// transaction number is not 0 and another pending request has the same number;
    /// [`Error::InvalidArgument`] if its timeout is longer than 1 000 000 ms.
    pub fn queue(&mut self, request: J) -> Result<(), Refused<J>> {
        self.queue.enqueue(request).map_err(Refused)
    }

    /// Advances all requests to the time `now`, without waiting, and returns one request
    /// that has ended. Call it until it returns `None`: `while let Some(request) =
    /// client.poll(now)`. The time is in microseconds, and wraps at 2^32. It is that of the clock of
    /// the port, [`Port::micros`](crate::port::Port::micros).
    #[must_use = "it is a request that has ended"]
    pub fn poll(&mut self, now: u32) -> Option<J> {
        if self.queue.suspended {
            return None;
        }
        let ended = self.line.advance(&mut self.queue, now, !self.is_continued);
        self.is_continued = ended.is_some();
        ended
    }

    /// Time in microseconds from `now` until poll has something to do, if no byte arrives
    /// before. Returns `u32::MAX` if no request is pending; poll does not read bytes then.
    /// Returns 1000 while a TCP port does not accept the bytes to send.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.line.poll_delay(&self.queue, now)
    }

    /// Cancels the first pending request for which `matches` returns true, and returns the
    /// request; `None` if there is no such request.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_single_coil(17, 3, true)?)?;
    /// let cancelled = client.cancel(|request| request.state.unit == 17).unwrap();
    /// assert_eq!(cancelled.result(), Err(mbm::Error::Cancelled));
    /// # Ok(())
    /// # }
    /// ```
    pub fn cancel(&mut self, matches: impl Fn(&J) -> bool) -> Option<J> {
        let request = self.queue.cancel_one(matches)?;
        if request.state().is_sent() {
            self.line.release(Some(&request));
        }
        Some(request)
    }

    /// Number of requests in a row that timed out, up to 127, repetitions included. An answer begins
    /// anew with 0. A device may keep a TCP connection open on which it answers no more: a program
    /// that finds more than one here makes a new connection, and calls [`Client::reconnect`].
    pub fn unanswered(&self) -> u8 {
        self.queue.unanswered.max(0) as u8
    }

    /// Call this after the link was opened anew. The client discards partly received and
    /// partly sent frames. The next polls return the requests in flight with
    /// [`Status::LINK_LOST`]. Queued requests are sent over the new link.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut client: Client<_, Request, 4> = Client::new(line);
    /// *client.port() = tcp(); // A new connection.
    /// client.reconnect();
    /// # Ok(())
    /// # }
    /// ```
    pub fn reconnect(&mut self) {
        self.line.release(None);
        if !self.queue.has_broadcast {
            self.line.forget_late_replies();
        }
        self.queue.interrupt();
        self.queue.note_answered(0);
    }

    /// Leaves the line to another user of the port until [`Client::take_back`]. Returns
    /// false, and changes nothing, if a request is in flight or another user has the line.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut client: Client<_, Request, 4> = Client::new(line);
    /// if client.suspend() {
    ///     // Another object uses the line meanwhile.
    ///     client.take_back();
    /// }
    /// # Ok(())
    /// # }
    /// ```
    #[must_use = "the line may be in use"]
    pub fn suspend(&mut self) -> bool {
        self.line.suspend(&mut self.queue)
    }
}

/// A serial line, or a TCP stream.
///
/// ```
/// use mbm::client::{Client, Request, Transport};
///
/// /// Queues a request, on whichever line the client is.
/// fn switch_on<L: Transport<Request<'static>>>(
///     client: &mut Client<L, Request<'static>, 4>,
/// ) -> Result<(), mbm::Error> {
///     client.queue(Request::write_single_coil(17, 3, true)?)?;
///     Ok(())
/// }
/// # Ok::<(), mbm::Error>(())
/// ```
pub trait Transport<J> {
    /// True if unit 0 addresses all units (broadcast).
    const HAS_BROADCAST: bool;

    /// True if the transaction numbers of pending requests must differ.
    const HAS_TRANSACTION_IDS: bool;

    /// The type of the port.
    type Port;

    /// The type of the buffers.
    type Storage;

    /// See [`Client::settings`](Client::settings).
    // The client calls it.
    #[doc(hidden)]
    fn settings(&mut self) -> &mut Settings;

    /// See [`Client::port`](Client::port).
    // The client calls it.
    #[doc(hidden)]
    fn port(&mut self) -> &mut Self::Port;

    /// See [`Client::storage`](Client::storage).
    // The client calls it.
    #[doc(hidden)]
    fn storage(&mut self) -> &mut Self::Storage;

    /// The port, and the `length` bytes that it has accepted in its last write. They stay where they
    /// are until a later one.
    // The client calls it.
    #[doc(hidden)]
    fn accepted(&mut self, length: u16) -> (&mut Self::Port, &[u8]);

    /// Advances the requests to the time `now`, and returns one that has ended. `fresh` is
    /// true in the first call of each poll, when new bytes may have arrived.
    // The client calls it.
    #[doc(hidden)]
    fn advance<const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J>;

    /// Notes that the last request, which was cancelled while it was sent, has left only now: its
    /// unit may answer from now on.
    // The client calls it.
    #[doc(hidden)]
    fn note_sent_late(&mut self, now: u32) {
        let _ = now;
    }

    /// Discards the state of one request in flight; with `None`, of all requests and of
    /// all partly received or partly sent frames.
    // The client calls it.
    #[doc(hidden)]
    fn release(&mut self, request: Option<&J>);

    /// Forgets which units may still answer earlier requests: the link is a new one, on which they
    /// cannot come.
    // The client calls it.
    #[doc(hidden)]
    fn forget_late_replies(&mut self) {}

    /// True if no bytes of cancelled requests wait to be sent.
    // The client calls it.
    #[doc(hidden)]
    fn is_idle(&self) -> bool {
        true
    }

    /// Microseconds until the line has something to do; `None` if the queue decides.
    // The client calls it.
    #[doc(hidden)]
    fn delay(&mut self, now: u32) -> Option<u32>;

    /// See [`Client::suspend`](Client::suspend).
    // The client calls it.
    #[doc(hidden)]
    fn suspend<const N: usize>(&self, queue: &mut RequestQueue<J, N>) -> bool
    where
        J: ClientRequest,
    {
        let free = !queue.suspended && queue.is_idle() && self.is_idle();
        queue.suspended |= free;
        free
    }

    /// See [`Client::poll_delay`](Client::poll_delay).
    // The client calls it.
    #[doc(hidden)]
    fn poll_delay<const N: usize>(&mut self, queue: &RequestQueue<J, N>, now: u32) -> u32
    where
        J: ClientRequest,
    {
        if queue.suspended {
            return u32::MAX;
        }
        match self.delay(now) {
            Some(delay) => delay,
            None => queue.delay(now),
        }
    }
}

//! mbm: Modbus for firmware. A master, a client, a plan of values to read, a server, a gateway, a
//! sniffer and a trace, on serial lines (RTU and ASCII) and on TCP. The crate does not use a
//! heap and never panics.
//!
//! # Read two registers
//!
//! Over TCP, with the feature `std`:
//!
#![cfg_attr(feature = "std", doc = "```no_run")]
#![cfg_attr(not(feature = "std"), doc = "```ignore")]
//! use mbm::client::BlockingClient;
//! use mbm::port::StdIo;
//!
//! let mut client = BlockingClient::tcp(StdIo::connect("192.168.1.10:502")?);
//! // Registers 107 and 108 of unit 17.
//! let [flow, total] = client.holding_registers(17, 107)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! On a serial line of firmware, with the feature `embedded-io`. `uart` is that of a HAL, `micros` a
//! clock in microseconds:
//!
#![cfg_attr(feature = "embedded-io", doc = "```")]
#![cfg_attr(not(feature = "embedded-io"), doc = "```ignore")]
//! use embedded_io::{Read, ReadReady, Write, WriteReady};
//! use mbm::master::{Buffers, Master};
//! use mbm::port::EmbeddedIo;
//!
//! # fn read(
//! #     uart: impl Read + ReadReady + Write + WriteReady,
//! #     micros: fn() -> u32,
//! # ) -> Result<[u16; 2], mbm::Error> {
//! // The frame buffer, the words that a read fills, the words that a write sends.
//! let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
//! let mut master = Master::new(17, EmbeddedIo::serial(uart, micros), buffers);
//! master.settings().set_baud_rate(19200);
//! let [flow, total] = master.holding_registers(107)?;
//! # Ok([flow, total])
//! # }
//! ```
//!
//! As a future, with the feature `embedded-io-async`. `socket` is a socket of embedded-io-async, `Delay`
//! is `DelayNs` of embedded-hal-async, which every executor's timer has. On a serial line it is
//! `AsyncClient::rtu(AsyncIo::serial(uart, micros, Delay))`:
//!
#![cfg_attr(feature = "embedded-io-async", doc = "```")]
#![cfg_attr(not(feature = "embedded-io-async"), doc = "```ignore")]
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
//! use mbm::client::AsyncClient;
//! use mbm::port::AsyncIo;
//!
//! async fn read() -> Result<[u16; 2], mbm::Error> {
//!     let mut client = AsyncClient::tcp(AsyncIo::stream(socket(), micros, Delay));
//!     client.holding_registers(17, 107).await
//! }
//! # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
//! ```
//!
//! # Serve four registers
//!
//! Over TCP, with the feature `std`. On a serial line it is `Server::rtu(port)`:
//!
#![cfg_attr(feature = "std", doc = "```no_run")]
#![cfg_attr(not(feature = "std"), doc = "```ignore")]
//! use mbm::port::StdIo;
//! use mbm::server::{Server, Tables, Unit};
//! use std::net::TcpListener;
//!
//! // Registers 107 to 110 of unit 17.
//! let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
//! let listener = TcpListener::bind("0.0.0.0:502")?;
//! loop {
//!     let connection = StdIo::accepted(listener.accept()?.0)?;
//!     Server::tcp(connection).run(&mut unit);
//! }
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! As a future, with the feature `embedded-io-async`. On a serial line it is
//! `AsyncServer::rtu(AsyncIo::serial(uart, micros, Delay))`:
//!
#![cfg_attr(feature = "embedded-io-async", doc = "```")]
#![cfg_attr(not(feature = "embedded-io-async"), doc = "```ignore")]
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
//! use mbm::port::AsyncIo;
//! use mbm::server::{AsyncServer, Tables, Unit};
//!
//! # fn accept() -> Wire { wire(&[0, 1, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78]) }
//! async fn serve() -> mbm::Error {
//!     let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
//!     let mut server = AsyncServer::tcp(AsyncIo::stream(accept(), micros, Delay));
//!     // Until the connection ends.
//!     server.run(&mut unit).await
//! }
//! # fn main() { assert_eq!(block_on(serve()), mbm::Error::LinkLost); }
//! ```
//!
//! # Which type
//!
//! | you want | type |
//! |---|---|
//! | every function, on RTU, ASCII, TCP or RTU over TCP, in calls that wait | [`client::BlockingClient`] |
//! | the same with futures | `client::AsyncClient` |
//! | the same without waiting: many requests, queued, repeated, several in flight | [`client::Client`] with [`client::Request`] |
//! | one RTU line in little memory, in calls that wait or with `poll` | [`master::Master`] |
//! | that with futures | `master::AsyncMaster` |
//! | a server of your values | [`server::Server`] with a [`server::Device`] of yours, or with [`server::Tables`] |
//! | that with futures | `server::AsyncServer`; `server::AsyncUnits` for values that are awaited |
//! | values read at intervals | [`plan`] |
//! | a gateway from TCP to lines | [`gateway`] |
//! | the traffic of others | [`sniffer`], [`trace`] |
//!
//! Functions return `Result` with [`Error`], an enum. A server refuses a request with an
//! [`Exception`].
//!
//! # A port
//!
//! A [`port::Port`] is the way to a UART or socket, and has a clock in microseconds, which may wrap.
//! `port::StdIo`, `port::EmbeddedIo` and `port::PolledIo` are ports. For other hardware, implement the trait:
//!
//! ```
//! use mbm::port::Port;
//! use mbm::Error;
//!
//! struct Uart { /* ... */ }
//!
//! impl Port for Uart {
//!     fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
//!         Ok(0) // The number of received bytes that were copied to `bytes`.
//!     }
//!     fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
//!         Ok(bytes.len()) // The number of these bytes that will be sent.
//!     }
//!     fn micros(&mut self) -> u32 {
//!         0 // The time in microseconds.
//!     }
//! }
//! ```
//!
//! # Without waiting
//!
//! A main loop that has other work starts a request, and polls:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! # use mbm::master::{Buffers, Master};
//! # fn main() -> Result<(), mbm::Error> {
//! # let mut master = Master::new(17, uart(), Buffers::new([0; 256], [0; 125], [0; 123]));
//! master.start_read_holding_registers(107, 2)?;
//! while master.poll().is_pending() { /* The firmware does its other work here. */ }
//! assert_eq!(master.response(), [555, 100]);
//! # Ok(())
//! # }
//! ```
//!
//! [`client::Client`] queues requests of every function, and retries them as its policy says.
//! On TCP it may have many requests in flight at the same time. [`client::Request`] is a request with
//! its data in slices:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::client::{Client, Frame, Request, Serial};
//!
//! # fn main() -> Result<(), mbm::Error> {
//! # let uart = uart();
//! let mut words = [0; 2];
//! // Up to four requests are pending.
//! let mut client: Client<_, _, 4> = Client::new(Serial::new(uart, Frame::new([0; 256])));
//! client.settings().set_baud_rate(9600);
//! client.queue(Request::read_holding_registers(17, 107, &mut words)?)?;
//!
//! # for now in (0..1_000_000).step_by(100) {
//! // In the main loop, with the time of the clock:
//! while let Some(request) = client.poll(now) {
//!     request.result()?;
//!     assert_eq!(request.registers(), [555, 100]);
//! #   return Ok(());
//! }
//! # }
//! # panic!("the request does not end")
//! # }
//! ```
//!
//! [`server::Server::serve`] does what there is to do, and returns:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::server::{Server, Tables, Unit};
//!
//! # fn main() -> Result<(), mbm::Error> {
//! # let arriving = &[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
//! # let uart = Uart { sends: &[], now: 0, arriving, sent: 0 };
//! let mut server = Server::rtu(uart);
//! server.set_baud_rate(9600);
//! let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
//!
//! # for now in (0..100_000).step_by(100) {
//! // In the main loop, with the time of the clock:
//! server.serve(now, &mut unit)?;
//! # }
//! // A master wrote 888 to register 109.
//! assert_eq!(unit.device.holding_registers.cells, [555, 100, 888, 0]);
//! # Ok(())
//! # }
//! ```
//!
//! # Packets
//!
//! You can also decode and encode frames and PDUs by themselves. [`frame::Framing`] decodes
//! and encodes frames, [`pdu::request::Request`] and [`pdu::response::Response`] decode and
//! encode PDUs, and [`packet`] handles user-defined functions.
//!
//! ```
//! use mbm::frame::{ascii, Framing};
//! use mbm::pdu::request::Request;
//!
//! let request = Request::WriteSingleRegister { address: 109, value: 888 };
//! let mut buffer = [0; 256];
//! let length = Framing::Rtu.emit(&mut buffer, 0, 17, ascii::END, |pdu| request.emit(pdu))?;
//! assert_eq!(buffer[..length], [17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
//!
//! let frame = Framing::Rtu.parse(&mut buffer[..length], ascii::END)?;
//! assert_eq!(frame.unit, 17);
//! assert_eq!(Request::parse(frame.pdu)?, request);
//! # Ok::<(), mbm::Error>(())
//! ```
//!
//! # Modules
//!
//! [`plan`], [`gateway`], [`sniffer`] and [`trace`] have no example here: their first lines say how
//! they work. [`data`] has numbers and texts of several registers, [`ring`] is a receive buffer that
//! an interrupt fills, [`dma_ring`] one that a DMA fills.
//!
//! No module allocates memory, has global variables or panics. The calls that wait are those of
//! [`client::BlockingClient`] and [`master::Master`], and [`server::Server::run`]; nothing else does. The
//! C ABI is the crate `mbm-c`.
//!
//! # Features
//!
//! | feature | what it adds |
//! |---|---|
//! | `embedded-io` | `port::EmbeddedIo`, a port over embedded-io |
//! | `embedded-io-async` | `client::AsyncClient`, `master::AsyncMaster` and `server::AsyncServer`, a client, a master and a server with futures, over embedded-io-async and embedded-hal-async; `port::PolledIo`, a port over embedded-io-async |
//! | `std` | `port::StdIo`, a port over a socket or serial port of the standard library |
//! | `defmt` | `defmt::Format` for [`Status`], [`Error`] and [`Exception`] |

#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, missing_debug_implementations)]
#![warn(clippy::indexing_slicing, clippy::unwrap_used)]
#![cfg_attr(test, allow(clippy::indexing_slicing, clippy::unwrap_used))]
// docs.rs shows which feature an item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(any(test, feature = "std"))]
extern crate std;

/// The atomic types of the ring. `tests/ring_orders.rs` compiles `ring.rs` with loom's types of
/// the same names, to try every order in which writer and reader may run.
mod atomic {
    #[cfg(not(target_pointer_width = "16"))]
    pub use core::sync::atomic::{AtomicU16 as AtomicPlace, AtomicU32 as AtomicWord};
    #[cfg(target_pointer_width = "16")]
    pub use core::sync::atomic::{AtomicU8 as AtomicPlace, AtomicU8 as AtomicWord};
    pub use core::sync::atomic::{AtomicU8, Ordering};
}

mod bytes;
pub mod dma_ring;
// Its types are at the root of the crate.
#[doc(hidden)]
pub mod error;
pub mod port;
pub mod ring;
pub mod time;

pub mod data;
pub mod frame;
pub mod packet;
pub mod pdu;
pub mod sniffer;
pub mod text;
pub mod trace;

// The crate mbm-c uses these too. They may change in any version.
#[doc(hidden)]
pub mod engine;

// The examples of the guide are tests.
#[cfg(all(
    doctest,
    feature = "embedded-io",
    feature = "embedded-io-async",
    feature = "std"
))]
#[doc = include_str!("../docs/guide-rust.md")]
#[doc = include_str!("../docs/values.md")]
#[doc = include_str!("../README.md")]
struct Guide;

/// The example of a call of a client or master. The documentation hides the lines that make the client or
/// master. It shows what is before the call, the call, and what is after it.
macro_rules! call_example {
    ([] $made:literal, $before:literal, $call:literal, $after:literal) => {
        concat!(
            "\n```\n# include!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/tests/doc/pump.rs\"));\n",
            "# fn main() -> Result<(), mbm::Error> {\n",
            $made,
            $before,
            "\n",
            $call,
            "?;\n",
            $after,
            "\n# Ok(())\n# }\n```"
        )
    };
    ([async] $made:literal, $before:literal, $call:literal, $after:literal) => {
        concat!(
            "\n```\n# include!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/tests/doc/pump.rs\"));\n",
            "# include!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/tests/doc/executor.rs\"));\n",
            "# async fn example() -> Result<(), mbm::Error> {\n",
            $made,
            $before,
            "\n",
            $call,
            ".await?;\n",
            $after,
            "\n# Ok(())\n# }\n",
            "# fn main() { assert_eq!(block_on(example()), Ok(())); }\n```"
        )
    };
}

pub mod client;
pub mod gateway;
pub mod master;
pub mod plan;
pub mod server;

pub use error::{Error, Exception, Status};

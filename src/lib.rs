//! mbm: Modbus for firmware. A master, a client, a plan of values to read, a server, a gateway, a
//! sniffer and a trace, on serial lines (RTU and ASCII) and on TCP. The crate does not use a
//! heap and never panics.
//!
//! # A master
//!
//! [`master::Master`] sends one request at a time on an RTU line. This example reads two
//! registers of unit 17:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::master::{Buffers, Master};
//!
//! # fn main() -> Result<(), mbm::Error> {
//! # let uart = uart();
//! // The frame buffer, the words that a read fills, the words that a write sends.
//! let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
//! let mut master = Master::new(17, uart, buffers);
//! master.settings().set_baud_rate(9600);
//!
//! assert_eq!(master.holding_registers(107)?, [555, 100]);
//!
//! // Without waiting:
//! master.start_read_holding_registers(107, 2)?;
//! while master.poll().is_pending() { /* The firmware does its other work here. */ }
//! assert_eq!(master.response(), [555, 100]);
//! # Ok(())
//! # }
//! ```
//!
//! [`master::Master::poll`] does not wait: a main loop calls it until it returns `Poll::Ready` with the
//! result of the request.
//! Functions return `Result` with [`Error`].
//!
//! # A port
//!
//! `uart` is a [`port::Port`], which your firmware implements for its UART or socket. Its clock is
//! in microseconds and may wrap:
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
//! With the feature `embedded-io`, `port::EmbeddedIo` is such a port over the UART of a HAL.
//! `docs/guide-rust.md` has one for `std::net::TcpStream`. The examples here use a `Uart` with a
//! simulated device on its line.
//!
//! # Futures
//!
//! With the feature `embedded-io-async`, `master::AsyncMaster` has the same functions as futures.
//! `uart` is a UART of embedded-io-async, `micros` a clock, and `Delay` is `DelayNs` of
//! embedded-hal-async, which every executor's timer has:
//!
#![cfg_attr(feature = "embedded-io-async", doc = "```")]
#![cfg_attr(not(feature = "embedded-io-async"), doc = "```ignore")]
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
//! use mbm::master::{AsyncMaster, Buffers};
//!
//! async fn read() -> Result<[u16; 2], mbm::Error> {
//!     let buffers = Buffers::new([0; 32], [0; 10], [0; 10]);
//!     let mut master = AsyncMaster::new(17, uart(), micros, Delay, buffers);
//!     master.settings().set_baud_rate(9600);
//!
//!     let mut words = [0; 2];
//!     master.read_holding_registers(107, &mut words).await?;
//!     Ok(words)
//! }
//! # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
//! ```
//!
//! # A client
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
//! # A server
//!
//! [`server::Server`] finds requests on a line or connection. Each unit has a list of
//! services, which answer them:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::frame::Framing;
//! use mbm::server::storage::{HoldingRegisters, RegisterArray};
//! use mbm::server::{Server, ServiceUnit};
//!
//! # fn main() -> Result<(), mbm::Error> {
//! let mut words = [555, 100, 0];
//! # {
//! # let arriving = &[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
//! # let uart = Uart { sends: &[], now: 0, arriving, sent: 0 };
//! let mut server = Server::with_framing(Framing::Rtu, uart, [0; 256]);
//! server.set_baud_rate(9600);
//! let mut registers = HoldingRegisters(RegisterArray::new(107, &mut words));
//! let mut units = [ServiceUnit {
//!     id: 17,
//!     services: &mut [&mut registers],
//!     diagnostics: None,
//! }];
//!
//! # for now in (0..100_000).step_by(100) {
//! // In the main loop, with the time of the clock:
//! server.serve(now, &mut units[..])?;
//! # }
//! # }
//! // A master wrote 888 to register 109.
//! assert_eq!(words, [555, 100, 888]);
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
//! an interrupt fills.
//!
//! No module allocates memory, has global variables or panics, and none waits but
//! [`master::Master::wait`]. The C ABI is the crate `mbm-c`.
//!
//! # Features
//!
//! | feature | what it adds |
//! |---|---|
//! | `embedded-io` | `port::EmbeddedIo`, a port over embedded-io |
//! | `embedded-io-async` | `master::AsyncMaster`, a master with futures, over embedded-io-async and embedded-hal-async |
//! | `defmt` | `defmt::Format` for [`Status`] and [`Error`] |

#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, missing_debug_implementations)]
#![warn(clippy::indexing_slicing, clippy::unwrap_used)]
#![cfg_attr(test, allow(clippy::indexing_slicing, clippy::unwrap_used))]
// docs.rs shows which feature an item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(test)]
extern crate std;

/// The atomic types of the ring. `tests/ring_orders.rs` compiles `ring.rs` with loom's types of
/// the same names, to try every order in which writer and reader may run.
mod atomic {
    #[cfg(not(target_pointer_width = "16"))]
    pub use core::sync::atomic::AtomicU16 as AtomicPlace;
    #[cfg(target_pointer_width = "16")]
    pub use core::sync::atomic::AtomicU8 as AtomicPlace;
    pub use core::sync::atomic::{AtomicU8, Ordering};
}

mod bytes;
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
#[cfg(all(doctest, feature = "embedded-io", feature = "embedded-io-async"))]
#[doc = include_str!("../docs/guide-rust.md")]
#[doc = include_str!("../docs/values.md")]
#[doc = include_str!("../README.md")]
struct Guide;

pub mod client;
pub mod gateway;
pub mod master;
pub mod plan;
pub mod server;

pub use error::{Error, Exception, Status};

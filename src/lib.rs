//! mbm: Modbus for firmware. A master, a client, a plan of values to read, a server, a gateway, a
//! sniffer and a trace, on serial lines (RTU and ASCII) and on TCP. The crate does not use a
//! heap and never panics.
//!
//! You call `poll` often; each call does what can be done without waiting. Functions return
//! `Result` with [`error::Error`]. Time is a clock in microseconds, which may wrap. Your firmware implements [`port::Port`] for its UART or
//! socket, to read and write bytes:
//!
//! ```
//! use mbm::port::Port;
//!
//! struct Uart { /* ... */ }
//!
//! impl Port for Uart {
//!     fn read(&mut self, bytes: &mut [u8]) -> i16 {
//!         0 // The number of received bytes that were copied to `bytes`.
//!     }
//!     fn write(&mut self, bytes: &[u8]) -> i16 {
//!         bytes.len() as i16 // The number of these bytes that will be sent.
//!     }
//!     fn micros(&mut self) -> u32 {
//!         0 // The time in microseconds.
//!     }
//! }
//! ```
//!
//! With the feature `embedded-io`, `port::EmbeddedIo` is such a port over the UART of a HAL.
//! The examples below use a `Uart` with a simulated device on its line.
//!
//! # A master
//!
//! [`master::Master`] sends one request at a time on an RTU line. This example reads two
//! registers of unit 17:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::engine::Buffers;
//! use mbm::master::Master;
//!
//! # fn main() -> Result<(), mbm::error::Error> {
//! # let uart = uart();
//! // The frame buffer, the words that a read fills, the words that a write sends.
//! let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
//! let mut master = Master::new(17, uart, buffers);
//! master.settings().set_baud_rate(9600);
//!
//! master.read_holding_registers(107, 2)?;
//! master.wait(|| { /* The firmware does its other work here. */ })?;
//! assert_eq!(master.response(), [555, 100]);
//! # Ok(())
//! # }
//! ```
//!
//! [`master::Master::poll`] does not wait: a main loop calls it until it returns `Poll::Ready`.
//!
//! With the feature `embedded-io-async`, `master::AsyncMaster` has the same functions as futures.
//! `uart` is a UART of embedded-io-async, `micros` a clock, and `Delay` is `DelayNs` of
//! embedded-hal-async, which every executor's timer has:
//!
#![cfg_attr(feature = "embedded-io-async", doc = "```")]
#![cfg_attr(not(feature = "embedded-io-async"), doc = "```ignore")]
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
//! use mbm::engine::Buffers;
//! use mbm::error::Error;
//! use mbm::master::AsyncMaster;
//!
//! async fn read() -> Result<[u16; 2], Error> {
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
//! On TCP it has many requests in flight at the same time. [`client::Request`] is a request with
//! its data in slices:
//!
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/uart.rs"));
//! use mbm::client::{Client, Request, Serial};
//! use mbm::engine::Frame;
//!
//! # fn main() -> Result<(), mbm::error::Error> {
//! # let uart = uart();
//! let mut words = [0; 2];
//! // Up to four requests are queued or in flight.
//! let mut client: Client<_, _, 4> = Client::new(Serial::new(uart, Frame::new([0; 256])));
//! let request = Request::read_holding_registers(17, 107, &mut words)?;
//! assert!(client.queue(request).is_ok());
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
//! use mbm::server::{Server, Unit};
//!
//! # fn main() -> Result<(), mbm::error::Error> {
//! let mut words = [555, 100, 0];
//! # {
//! # let arriving = &[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
//! # let uart = Uart { sends: &[], now: 0, arriving, sent: 0 };
//! let mut server = Server::with_framing(Framing::Rtu, uart, [0; 256]);
//! let mut registers = HoldingRegisters(RegisterArray::new(107, &mut words));
//! let mut units = [Unit {
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
//! # Ok::<(), mbm::error::Error>(())
//! ```
//!
//! # Layers
//!
//! A module uses only modules to its left:
//!
//! ```text
//! bytes -> frame -> pdu -> packet -> text -> {sniffer, trace, engine} -> {master, client, plan, server, gateway}
//! ```
//!
//! Each of them may use `atomic`, `error`, `time`, `port`, `ring` and `data`. `make check`
//! enforces this rule.
//!
//! No module allocates memory, has global variables or panics, and none waits but
//! [`master::Master::wait`]. The C ABI is the crate `mbm-c`.
//!
//! # Features
//!
//! | feature | what it adds |
//! |---|---|
//! | `diagnosis` (default) | a failed request says why: see [`error::Error::INVALID_SLAVE_ID`]. Frames are counted, and deviating replies can be accepted |
//! | `embedded-io` | `port::EmbeddedIo`, a port over embedded-io |
//! | `embedded-io-async` | `master::AsyncMaster`, a master with futures, over embedded-io-async and embedded-hal-async |
//! | `defmt` | `defmt::Format` for [`error::Status`] and [`error::Error`] |

#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::indexing_slicing, clippy::unwrap_used)]
#![cfg_attr(test, allow(clippy::indexing_slicing, clippy::unwrap_used))]

#[cfg(test)]
extern crate std;

mod atomic;
pub mod error;
pub mod port;
pub mod ring;
pub mod time;

pub mod bytes;
pub mod data;
pub mod engine;
pub mod frame;
pub mod packet;
pub mod pdu;
pub mod sniffer;
pub mod text;
pub mod trace;

// The examples of the guide are tests.
#[cfg(all(doctest, feature = "embedded-io", feature = "embedded-io-async"))]
#[doc = include_str!("../docs/guide-rust.md")]
struct Guide;

pub mod client;
pub mod gateway;
pub mod master;
pub mod node;
pub mod plan;
pub mod server;

//! mbm: Modbus for firmware. A master, a client, a plan of values to read, a server, a gateway, a
//! sniffer and a trace, on serial lines (RTU and ASCII) and on TCP. The crate does not use a
//! heap, never waits and never panics.
//!
//! You call `poll` often; each call does what can be done without waiting. Time is a clock in
//! microseconds, which may wrap. Your firmware implements [`port::Port`] for its UART or
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
//! The examples below use a `Uart` with a simulated device on its line.
//!
//! # A master
//!
//! [`master::Master`] sends one request at a time on an RTU line. This example reads two
//! registers of unit 17:
//!
//! ```
//! # use mbm::port::Port;
//! # struct Uart { sends: &'static [u8], now: u32, arriving: &'static [u8], sent: usize }
//! # impl Port for Uart {
//! #     fn read(&mut self, bytes: &mut [u8]) -> i16 {
//! #         let count = bytes.len().min(self.arriving.len());
//! #         let (now, later) = self.arriving.split_at(count);
//! #         bytes[..count].copy_from_slice(now);
//! #         self.arriving = later;
//! #         count as i16
//! #     }
//! #     fn write(&mut self, bytes: &[u8]) -> i16 {
//! #         self.sent += bytes.len();
//! #         self.arriving = self.sends;
//! #         bytes.len() as i16
//! #     }
//! #     fn micros(&mut self) -> u32 { self.now += 100; self.now }
//! # }
//! use mbm::engine::Buffers;
//! use mbm::error::Status;
//! use mbm::master::Master;
//!
//! # let sends = &[17, 3, 4, 0x02, 0x2B, 0x00, 0x64, 0x9B, 0xA9];
//! # let uart = Uart { sends, now: 0, arriving: &[], sent: 0 };
//! // The frame buffer, the words to be read, the words to be written.
//! let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
//! let mut master = Master::new(17, uart, buffers);
//! master.settings().set_baud_rate(9600);
//!
//! assert_eq!(master.read_holding_registers(107, 2), Status::PENDING);
//! while master.poll() == Status::PENDING {
//!     // The firmware does its other work here.
//! }
//! assert_eq!(master.status(), Status::OK);
//! assert_eq!([master.response_word(0), master.response_word(1)], [555, 100]);
//! ```
//!
//! # A client
//!
//! [`client::Client`] queues requests of every function, and retries them as its policy says.
//! On TCP it has many requests in flight at the same time. You implement [`client::ClientRequest`] for
//! your request, which holds the data to send and the data received:
//!
//! ```
//! # use mbm::port::Port;
//! # struct Uart { sends: &'static [u8], now: u32, arriving: &'static [u8], sent: usize }
//! # impl Port for Uart {
//! #     fn read(&mut self, bytes: &mut [u8]) -> i16 {
//! #         let count = bytes.len().min(self.arriving.len());
//! #         let (now, later) = self.arriving.split_at(count);
//! #         bytes[..count].copy_from_slice(now);
//! #         self.arriving = later;
//! #         count as i16
//! #     }
//! #     fn write(&mut self, bytes: &[u8]) -> i16 {
//! #         self.sent += bytes.len();
//! #         self.arriving = self.sends;
//! #         bytes.len() as i16
//! #     }
//! #     fn micros(&mut self) -> u32 { self.now += 100; self.now }
//! # }
//! use mbm::client::{Client, ClientRequest, Serial, RequestState};
//! use mbm::engine::Frame;
//! use mbm::error::Status;
//! use mbm::pdu::functions::FunctionSpec;
//!
//! struct Read {
//!     state: RequestState,
//!     received: [u8; 4],
//! }
//!
//! impl ClientRequest for Read {
//!     fn state(&self) -> &RequestState {
//!         &self.state
//!     }
//!     fn state_mut(&mut self) -> &mut RequestState {
//!         &mut self.state
//!     }
//!     fn byte(&self, _: usize) -> u8 {
//!         0 // A read sends no data.
//!     }
//!     fn store(&mut self, data: &[u8], _: u8) {
//!         self.received[..data.len()].copy_from_slice(data);
//!     }
//! }
//!
//! let mut state = RequestState::NONE;
//! state.unit = 17;
//! state.capacity = 4;
//! let status = state.header.set(FunctionSpec::READ_HOLDING_REGISTERS, 107, 2);
//! assert_eq!(status, Status::OK);
//!
//! # let sends = &[17, 3, 4, 0x02, 0x2B, 0x00, 0x64, 0x9B, 0xA9];
//! # let uart = Uart { sends, now: 0, arriving: &[], sent: 0 };
//! let line = Serial::new(uart, Frame::new([0; 256]));
//! // Up to four requests are queued or in flight.
//! let mut client: Client<_, Read, 4> = Client::new(line);
//! assert!(client.queue(Read { state, received: [0; 4] }).is_ok());
//!
//! let mut now = 0;
//! let read = loop {
//!     now += 100; // The clock of the port.
//!     if let Some(read) = client.poll(now, true) {
//!         break read;
//!     }
//! };
//! assert_eq!(read.state.status, Status::OK);
//! assert_eq!(read.received, [0x02, 0x2B, 0x00, 0x64]);
//! ```
//!
//! # A server
//!
//! [`server::Server`] finds requests on a line or connection. Each unit has a list of
//! services, which answer them:
//!
//! ```
//! # use mbm::port::Port;
//! # struct Uart { sends: &'static [u8], now: u32, arriving: &'static [u8], sent: usize }
//! # impl Port for Uart {
//! #     fn read(&mut self, bytes: &mut [u8]) -> i16 {
//! #         let count = bytes.len().min(self.arriving.len());
//! #         let (now, later) = self.arriving.split_at(count);
//! #         bytes[..count].copy_from_slice(now);
//! #         self.arriving = later;
//! #         count as i16
//! #     }
//! #     fn write(&mut self, bytes: &[u8]) -> i16 {
//! #         self.sent += bytes.len();
//! #         self.arriving = self.sends;
//! #         bytes.len() as i16
//! #     }
//! #     fn micros(&mut self) -> u32 { self.now += 100; self.now }
//! # }
//! use mbm::error::Status;
//! use mbm::frame::Framing;
//! use mbm::server::storage::{HoldingRegisters, RegisterArray};
//! use mbm::server::{Server, Unit};
//!
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
//! let status = server.serve(now, &mut units[..]);
//! assert_eq!(status, Status::OK);
//! # }
//! # }
//! // A master wrote 888 to register 109.
//! assert_eq!(words, [555, 100, 888]);
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
//! # Ok::<(), mbm::error::Status>(())
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
//! No module allocates memory, has global variables, waits or panics. The C ABI is the crate
//! `mbm-c`.

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

pub mod client;
pub mod gateway;
pub mod master;
pub mod node;
pub mod plan;
pub mod server;

//! The sniffer on a simulated bus.

mod bench;
mod bus;
mod exchanges;
mod faults;
mod random;
mod times;

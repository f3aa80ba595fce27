//! The sniffer on a simulated bus.

mod bench;
mod bus;
mod exchanges;
mod faults;
#[path = "../common/frame.rs"]
mod frame;
mod random;
mod times;

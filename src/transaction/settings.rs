//! How transactions behave.

use crate::time;

/// How a transaction behaves; kept from one to the next.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Silence before a request, in microseconds.
    pub gap: u32,
    /// The silence t3.5 that ends a frame, in microseconds.
    pub silence: u32,
    /// One character, in microseconds.
    pub character: u16,
    /// From the end of the request to the end of the reply, in milliseconds.
    pub response_timeout: u16,
    /// What slaves are given to carry out a broadcast, in milliseconds.
    pub turnaround_delay: u16,
    /// What a late reply is given after a request that got none, in
    /// milliseconds.
    pub quiet_time: u16,
    /// How often a request is repeated that was not answered.
    pub retries: u8,
    /// How long the driver is held on after the flush, in characters.
    pub post_flush_hold: u8,
    /// Whether each request comes back before its reply.
    pub echo_discard: bool,
}

impl Settings {
    /// What holds until somebody says otherwise.
    pub const DEFAULT: Settings = Settings {
        gap: time::DEFAULT_SILENCE,
        silence: time::DEFAULT_SILENCE,
        character: time::DEFAULT_CHARACTER,
        response_timeout: 2000,
        turnaround_delay: 100,
        quiet_time: 100,
        retries: 0,
        post_flush_hold: 0,
        echo_discard: false,
    };
}

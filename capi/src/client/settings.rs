//! The settings of a client.

use super::object::{mbm_client, queue, DEPTH};
use super::object::{transport, SerialTransport};
use super::request::RequestPtr;
use super::storage::ClientBuffers;
use crate::framing::MBM_FRAMING_TCP;
use crate::pointers;
use crate::storage::mbm_counters;
use mbm::client::RequestQueue;
use mbm::engine::Settings;
use mbm::error::Status;

/// The parts of a client that the settings change.
pub(super) struct Parts<'a> {
    pub(super) settings: &'a mut Settings,
    pub(super) storage: &'a mut ClientBuffers,
    pub(super) queue: &'a mut RequestQueue<RequestPtr, DEPTH>,
}

/// Changes a setting.
pub(super) unsafe fn set(client: *mut mbm_client, change: impl FnOnce(Parts) -> Status) -> u8 {
    pointers::with(client, |object| {
        let kind = &*(*object).kind;
        change(Parts {
            settings: kind.settings(object),
            storage: kind.storage(object),
            queue: queue(object),
        })
    })
}

/// Changes a setting that has no effect on TCP, and whose code only those programs contain that
/// set it.
unsafe fn set_extra(client: *mut mbm_client, change: impl FnOnce(&mut Settings)) -> u8 {
    pointers::change(client, |object| {
        let kind = &*(*object).kind;
        change(kind.settings(object));
        if kind.framing != MBM_FRAMING_TCP {
            transport::<SerialTransport>(object).use_extras();
        }
    })
}

functions! {
    (client: *mut mbm_client)

    /// Sets the response timeout. On a serial line and in RTU over TCP, the time starts when the
    /// request has been sent. In TCP frames it starts when mbm_client_poll puts the request into
    /// the outgoing buffer, also if the port accepts it later. `timeoutMs` of a request or of a
    /// unit replaces this time.
    ///
    /// @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
    fn mbm_client_setResponseTimeout(timeoutMs: u32)
        = set(|parts| parts.settings.response_timeout.set_timeout(timeoutMs).into());

    /// Sets the baud rate from which the client computes the gap before an RTU request (t3.5,
    /// serial line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure
    /// the serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
    ///
    /// @param baud  bits per second; 0 (the default): unknown
    fn mbm_client_setBaudRate(baud: u32)
        = set(|parts| {
            parts.settings.set_baud_rate(baud);
            Status::OK
        });

    /// Sets the silence before a request, instead of t3.5. A later call of
    /// mbm_client_setBaudRate sets it back to t3.5. It has no effect on TCP.
    ///
    /// @param gapUs  microseconds from the last byte received or sent; a value above 2^31 (36
    ///               minutes) means 2^31
    fn mbm_client_setGap(gapUs: u32)
        = set(|parts| {
            parts.settings.set_gap(gapUs);
            Status::OK
        });

    /// Sets the turnaround delay: how long the client waits after a request that no device
    /// answers. These requests are a broadcast (serial line guide V1.02, 2.4.1), and 08 with
    /// sub-function 04.
    ///
    /// @param delayMs  milliseconds, 0 to 65535; the default is 100
    fn mbm_client_setTurnaroundDelay(delayMs: u32)
        = set(|parts| parts.settings.turnaround_delay.set_delay(delayMs).into());

    /// Sets the quiet time of a serial line. It prevents that the client accepts a late reply as
    /// the reply to a later request: see mbm_line_setQuietTime. It has no effect in TCP frames,
    /// whose transaction identifier shows to which request a reply belongs.
    ///
    /// The client does not hold the reply to mbm_client_diagnostics with sub-function 0, which
    /// repeats data of your choice. If no other request has the same data, no late reply can be
    /// taken for it, and after its reply the next replies of that unit are not held either.
    ///
    /// @param quietMs  milliseconds, 0 to 65535; the default is 100; 0 holds no reply
    fn mbm_client_setQuietTime(quietMs: u32)
        = set(|parts| parts.settings.quiet_time.set_delay(quietMs).into());

    /// Switches echo discarding on or off. Switch it on if the receiver also receives the bytes
    /// that the driver sends: then the client discards the copy of each request that arrives before
    /// the reply. It has no effect on TCP.
    ///
    /// @param on  0 (the default) or 1
    fn mbm_client_setEchoDiscard(on: u8) = set_extra(|settings| settings.echo_discard = on != 0);

    /// Sets how long the driver stays on after the port's flush, for platforms whose flush
    /// returns before the last bit was sent. It has no effect on TCP.
    ///
    /// @param characters  the time in characters at the baud rate of mbm_client_setBaudRate
    ///                    (without one, at 9600); the default is 0
    fn mbm_client_setPostFlushHold(characters: u8)
        = set_extra(|settings| settings.post_flush_characters = characters);
}

/// Sets your storage for counters, in which the client counts from now on. You may read and
/// zero the counters at any time, but not from an interrupt. In TCP frames, foreignFrames
/// counts frames whose transaction identifier and unit match no pending request, and
/// resynchronisations counts sequences of bytes that were not a frame.
///
/// @param counters  your counters, initialised with MBM_INIT; NULL stops counting
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setCounters(
    client: *mut mbm_client,
    counters: *mut mbm_counters,
) -> u8 {
    pointers::change(client, |object| {
        let kind = &*(*object).kind;
        kind.storage(object).counters = counters;
        if kind.framing != MBM_FRAMING_TCP {
            transport::<SerialTransport>(object).set_counting();
        }
    })
}

//! The settings of a line, and who else uses it.

use super::{mbm_line, with_hooks, Core};
use crate::pointers::{change, check, with};
use crate::storage::mbm_counters;
use mbm::error::Status;
use mbm::port::Port;

functions! {
    (line: *mut mbm_line)

    /// Sets the baud rate from which the master computes the gap before a request (t3.5, serial
    /// line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure the
    /// serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
    ///
    /// @param baud  bits per second; 0 (the default): unknown
    fn mbm_line_setBaudRate(baud: u32) = change(|line| line.settings.set_baud_rate(baud));

    /// Sets the silence before a request, instead of t3.5. Use 0 if no device on the line needs
    /// the gap, and more than t3.5 for devices that need longer before they can receive again.
    /// A later call of mbm_line_setBaudRate sets it back to t3.5.
    ///
    /// @param gapUs  microseconds from the last byte received or sent; a value above 2^31 (36
    ///               minutes) means 2^31
    fn mbm_line_setGap(gapUs: u32) = change(|line| line.settings.set_gap(gapUs));

    /// Sets the turnaround delay: how long the master waits after a broadcast, which no device
    /// answers (serial line guide V1.02, 2.4.1).
    ///
    /// @param delayMs  milliseconds, 0 to 65535; the default is 100
    fn mbm_line_setTurnaroundDelay(delayMs: u32)
        = with(|line| line.settings.turnaround_delay.set_delay(delayMs).into());

    /// Sets the quiet time. It prevents that the master accepts a late reply as the reply to a
    /// later request. In RTU the two cannot be distinguished if unit, function and length are the
    /// same, or if the late reply is an exception to the same function.
    ///
    /// After a request without a right reply, the master waits for the quiet time before it sends
    /// the next request, and discards bytes that arrive meanwhile. It counts how many replies each
    /// unit owes; a frame of the unit takes one away. After a timeout it holds the next reply of
    /// that unit until no byte has arrived for the response timeout; after MBM_INVALID_CRC for the
    /// quiet time, because the damaged reply is not late. A second reply replaces the held one,
    /// because a device answers in order. If the second reply is damaged, the request fails. The
    /// last reply that the unit owes is not held. After a request that was cancelled, the next one
    /// to that unit is sent when the unit owes none, at the latest two response timeouts and the
    /// quiet time after the cancelled one was sent; meanwhile other nodes can use the line.
    ///
    /// So a device that answers in order never gives the data of another request if a late reply
    /// comes at most one response timeout after its request has timed out, whatever its usual
    /// latency; and it is heard again in bounded time. A request ends at the latest three response
    /// timeouts after it was sent. A wrong reading remains possible if the device takes longer than
    /// the response timeout for two requests in a row, or loses the reply after a late one.
    ///
    /// With a quiet time of 0 the master waits and holds nothing: a reply that is later than the
    /// response timeout may be taken for the reply to the next request, and so may all that
    /// follow.
    ///
    /// @param quietMs  milliseconds, 0 to 65535; the default is 100
    fn mbm_line_setQuietTime(quietMs: u32)
        = with(|line| line.settings.quiet_time.set_delay(quietMs).into());

    /// Sets how often the master repeats a request whose reply is missing, damaged or malformed.
    /// It does not repeat a request that was answered with an exception.
    ///
    /// @param retries  0 to 255; the default is 0
    fn mbm_line_setRetries(retries: u8)
        = change(|line| {
            line.settings.retries = retries;
            line.use_extras();
        });

    /// Switches echo discarding on or off. Switch it on if the receiver also receives the bytes
    /// that the driver sends: then the master discards the copy of each request that arrives before
    /// the reply.
    ///
    /// @param on  0 (the default) or 1
    fn mbm_line_setEchoDiscard(on: u8)
        = change(|line| {
            line.settings.echo_discard = on != 0;
            line.use_extras();
        });

    /// Sets how long the driver stays on after the port's flush, for platforms whose flush
    /// returns before the last bit was sent.
    ///
    /// @param characters  the time in characters at the baud rate of mbm_line_setBaudRate (without
    ///                    one, at 9600); the default is 0
    fn mbm_line_setPostFlushHold(characters: u8)
        = change(|line| {
            line.settings.post_flush_characters = characters;
            line.use_extras();
        });

    /// Sets your storage for counters, in which the master counts from now on. You may read and
    /// zero the counters at any time, but not from an interrupt.
    ///
    /// @param counters  your counters, initialised with MBM_INIT; NULL stops counting
    fn mbm_line_setCounters(counters: *mut mbm_counters)
        = change(|line| {
            line.storage.counters = counters;
            line.set_counting();
        });

    /// Reports when another user of the wire, for example another object, used it last.
    /// The gap before the next request counts from that time. A time before the last use that
    /// the object knows changes nothing.
    ///
    /// @param timeUs  the time in microseconds on the clock of the object's port, at most 2^31
    ///                microseconds (36 minutes) ago
    fn mbm_line_usedAt(timeUs: u32) = note_use(|core| core.line_used_at(timeUs));

    /// Reports that another user of the wire has just used it: as mbm_line_usedAt with the
    /// present time.
    fn mbm_line_used() = note_use(|core| core.line_used());
}

/// Notes a use of the line, which asks the clock of its port.
unsafe fn note_use(line: *mut mbm_line, note: impl FnOnce(&mut Core)) -> u8 {
    let status = check(line);
    if status == Status::OK {
        with_hooks(line, |core| {
            if core.port.is_ready() {
                note(core);
            }
        });
    }
    status.code()
}

//! Moves a request on, from its start to its end.

use super::{Count, Engine, Phase, Probation, Receive, RequestSpec, RxFault, Settings, Storage};
use crate::error::Status;
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::rtu;
use crate::port::Port;
use crate::time::{elapsed, has_elapsed, LONGEST};

impl<P, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
    /// An engine without a request.
    pub const fn new(port: P, storage: S) -> Self {
        Engine {
            phase: Phase::Idle,
            phase_begins: false,
            waiting: false,
            unit: 0,
            retries: 0,
            exception: 0,
            length: S::Count::ZERO,
            end: S::Count::ZERO,
            processed: S::Count::ZERO,
            needed: S::Count::ZERO,
            held: S::Count::ZERO,
            probation: Probation::Off,
            late: false,
            echo: false,
            resynced: false,
            fault: RxFault::NOTHING,
            foreign_frames: 0,
            skipped: 0,
            skipped_as: RxFault::NOTHING,
            crc_skipped: Crc16::START,
            crc: Crc16::START,
            weight: Crc16::RESIDUE,
            request: Q::NONE,
            phase_start: 0,
            wait: 0,
            last_byte: 0,
            now: 0,
            has_slow_unit: false,
            late_units: [0; 4],
            storage,
            settings: Settings::DEFAULT,
            port,
        }
    }

    /// True while a request is pending.
    pub fn is_pending(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// True if the last poll found nothing to do and the driver is off. The caller may do
    /// something else for a while.
    pub const fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// The request that [`Engine::start`] sends.
    pub fn request(&mut self) -> &mut Q {
        &mut self.request
    }

    /// The raw exception code of the last reply; 0 if the reply was no exception.
    pub const fn exception_code(&self) -> u8 {
        self.exception
    }

    /// Clears the outcome of the last request.
    pub fn clear_outcome(&mut self) {
        self.exception = 0;
    }

    /// Makes `now` the zero of the clock. Times before `now - longest` become `now - longest`.
    /// For model checkers: two engines that will behave alike become equal.
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        for time in [&mut self.phase_start, &mut self.last_byte, &mut self.now] {
            *time = 0u32.wrapping_sub(elapsed(now, *time).min(longest));
        }
    }

    /// Appends the CRC to the `length` bytes in the frame buffer, and makes them the frame to
    /// send.
    #[inline(always)]
    pub(crate) fn append_crc(&mut self, length: S::Count) {
        let [low, high] = crc16(self.storage.bytes(S::Count::ZERO, length)).to_bytes();
        self.storage.set_byte(length, low);
        self.storage.set_byte(length + 1u8.into(), high);
        self.set_frame_length(length + rtu::CRC.into());
    }

    /// Writes the frame of a request whose PDU is a function code and two words. On hosts
    /// only: most requests are of this form, and this function takes half the time.
    #[inline(always)]
    pub(crate) fn write_short(&mut self, words: [u8; 4]) {
        let frame = rtu::short(self.unit, self.request.function(), words);
        let length = S::Count::from(frame.len() as u8);
        if let Some(place) = self.storage.bytes(S::Count::ZERO, length).first_chunk_mut() {
            *place = frame;
        }
        self.set_frame_length(length);
    }

    /// Sets how many bytes of the frame buffer are to be sent.
    #[inline(always)]
    pub(crate) fn set_frame_length(&mut self, length: S::Count) {
        self.end = length;
        self.processed = S::Count::ZERO;
    }

    /// Enters a phase that may last `wait` microseconds from the next look at the clock on.
    pub(super) fn enter(&mut self, phase: Phase, wait: u32) {
        self.phase = phase;
        self.wait = wait;
        self.phase_begins = true;
    }

    pub(super) fn wait(&mut self) -> Status {
        self.waiting = true;
        Status::PENDING
    }

    /// Stores the time `now`, and starts the time of a phase that has just begun.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn look_at_clock(&mut self, now: u32) {
        self.now = now;
        if self.phase_begins {
            self.phase_begins = false;
            self.phase_start = now;
            // The silence is measured from the end of our request; before a request, from the
            // last received byte.
            if self.phase != Phase::Gap {
                self.last_byte = now;
            }
        }
    }

    /// True once the time of the phase has expired.
    pub(super) fn has_expired(&self) -> bool {
        self.has_elapsed_since(self.wait, false)
    }

    /// True once the line has been silent for `time` microseconds.
    #[inline(always)]
    pub(super) fn is_silent(&self, time: u32) -> bool {
        self.has_elapsed_since(time, true)
    }

    /// True once `time` microseconds have passed since the line was last in use, or since the
    /// phase began. One function does both, because 32-bit arithmetic is large on an AVR.
    #[cfg_attr(target_os = "none", inline(never))]
    fn has_elapsed_since(&self, time: u32, since_last_byte: bool) -> bool {
        let phase_start = if since_last_byte {
            self.last_byte
        } else {
            self.phase_start
        };
        has_elapsed(time, self.now, phase_start)
    }

    /// Waits for the turnaround delay, in which the slaves carry out a broadcast.
    #[inline(always)]
    pub(super) fn turn_around(&mut self) -> Status {
        if self.has_expired() {
            Status::OK
        } else {
            self.wait()
        }
    }

    /// The status of a request that cannot go on, because the line is not silent or the port
    /// accepts nothing: `PENDING`, or `LINE_BUSY` once the phase has expired.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn stalled(&self) -> Status {
        if self.has_expired() {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }
}

impl<P: Port, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
    /// Notes that the line is in use now. The gap counts from now.
    pub fn line_used(&mut self) {
        self.last_byte = self.port.micros();
    }

    /// Notes that the line was in use at `time`, by the clock of the port. The gap counts from
    /// `time`, unless the line was in use later.
    pub fn line_used_at(&mut self, time: u32) {
        if time.wrapping_sub(self.last_byte) < LONGEST {
            self.last_byte = time;
        }
    }

    /// The time at which the line was last in use, by the clock of the port.
    pub fn last_use(&self) -> u32 {
        self.last_byte
    }

    /// Does what the request has to do at the time `now`, without waiting. Returns
    /// [`Status::PENDING`] until the request has ended, then its status.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll(&mut self, now: u32) -> Status {
        self.poll_with(now, None)
    }

    /// As [`Engine::poll`], but `receive` waits for the reply if there is such a function.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll_with(&mut self, now: u32, receive: Option<Receive<Self>>) -> Status {
        self.waiting = false;
        self.look_at_clock(now);
        let status = if self.phase < Phase::Reply {
            match self.phase {
                Phase::Idle => return Status::OK,
                Phase::Gap => self.wait_for_silence(),
                _ => self.send(),
            }
        } else if let Some(receive) = receive {
            receive(self)
        } else if self.phase == Phase::Reply {
            self.receive::<false>()
        } else {
            self.turn_around()
        };
        if status.is_failure() {
            self.cancel();
        } else if status != Status::PENDING {
            self.end();
        }
        status
    }

    /// Cancels the request and switches the driver off. If the request was sent completely,
    /// its reply may still come.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn cancel(&mut self) {
        if self.phase > Phase::Gap {
            self.line_used();
        }
        if self.phase > Phase::Send {
            self.expect_late_reply();
        }
        self.end();
    }

    /// Ends the request and switches the driver off.
    #[cfg_attr(target_os = "none", inline(never))]
    fn end(&mut self) {
        self.take_back();
        if matches!(self.phase, Phase::Send | Phase::Flush | Phase::PostFlush) {
            self.port.post_transmission();
        }
        self.phase = Phase::Idle;
        self.waiting = false;
    }

    /// Microseconds from `now` for which poll will find nothing to do unless a byte arrives;
    /// `u32::MAX` if no request is pending. A phase that has just begun counts its time from
    /// this call, so the caller may sleep for the returned time.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.look_at_clock(now);
        let (time, phase_start) = if self.phase < Phase::Reply {
            match self.phase {
                Phase::Idle => return u32::MAX,
                Phase::Gap => (self.required_silence(), self.last_byte),
                _ => return 0,
            }
        } else if self.phase == Phase::Turnaround {
            (self.wait, self.phase_start)
        } else if self.probation == Probation::Held {
            (self.hold(), self.last_byte)
        } else if !self.resynced {
            (self.settings.silence, self.last_byte)
        } else {
            (self.wait, self.phase_start)
        };
        time.saturating_sub(elapsed(now, phase_start))
    }
}

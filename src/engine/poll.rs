//! Moves a request on, from its start to its end.

use super::{Count, Engine, Phase, Probation, Receive, Request, Seen, Settings, Storage};
use crate::error::Status;
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::rtu;
use crate::port::Port;
use crate::time::{elapsed, has_elapsed, LONGEST};

impl<P, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// No request yet.
    pub const fn new(port: P, storage: S) -> Self {
        Engine {
            phase: Phase::Idle,
            stamp: false,
            waiting: false,
            unit: 0,
            retries: 0,
            exception: 0,
            length: S::Count::ZERO,
            end: S::Count::ZERO,
            done: S::Count::ZERO,
            least: S::Count::ZERO,
            held: S::Count::ZERO,
            probation: Probation::Off,
            late_unit: 0,
            late: false,
            echo: false,
            skimmed: false,
            seen: Seen::NOTHING,
            foreign: 0,
            passed: 0,
            passed_as: Seen::NOTHING,
            crc_passed: Crc16::START,
            crc: Crc16::START,
            weight: Crc16::RESIDUE,
            request: Q::NONE,
            since: 0,
            wait: 0,
            last_byte: 0,
            now: 0,
            storage,
            settings: Settings::DEFAULT,
            port,
        }
    }

    /// True while a request is under way.
    pub fn is_pending(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// True if the last poll found nothing to do and the driver is off, so
    /// that the caller may do something else for a while.
    pub const fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// The request, which [`Engine::start`] sends.
    pub fn request(&mut self) -> &mut Q {
        &mut self.request
    }

    /// The raw exception code of the last reply; 0 if it was none.
    pub const fn exception_code(&self) -> u8 {
        self.exception
    }

    /// Forgets the outcome of the last request.
    pub fn forget(&mut self) {
        self.exception = 0;
    }

    /// Moves the clock's zero to `now`; what is longer ago than `longest` counts as
    /// that long ago. For model checkers, to which two objects are equal if they
    /// will behave alike.
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        for time in [&mut self.since, &mut self.last_byte, &mut self.now] {
            *time = 0u32.wrapping_sub(elapsed(now, *time).min(longest));
        }
    }

    /// Completes a frame to be sent, of which `length` bytes are in the frame buffer, with
    /// its CRC.
    #[inline(always)]
    pub(crate) fn append_crc(&mut self, length: S::Count) {
        let [low, high] = crc16(self.storage.bytes(S::Count::ZERO, length)).to_bytes();
        self.storage.set_byte(length, low);
        self.storage.set_byte(length + 1u8.into(), high);
        self.set_frame_length(length + rtu::CRC.into());
    }

    /// Writes the frame of the request if that is a function code and two words. For hosts:
    /// such requests are most, and this costs half.
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
        self.done = S::Count::ZERO;
    }

    /// Enters a phase that lasts `wait`, from the next look at the clock on.
    pub(super) fn enter(&mut self, phase: Phase, wait: u32) {
        self.phase = phase;
        self.wait = wait;
        self.stamp = true;
    }

    pub(super) fn wait(&mut self) -> Status {
        self.waiting = true;
        Status::PENDING
    }

    /// Notes the time `now`, and starts the time of a phase that just began.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn look_at_clock(&mut self, now: u32) {
        self.now = now;
        if self.stamp {
            self.stamp = false;
            self.since = now;
            // The silence is measured from the end of our request. Before a
            // request it is measured from the last byte received.
            if self.phase != Phase::Gap {
                self.last_byte = now;
            }
        }
    }

    /// True once the phase has lasted as long as it may.
    pub(super) fn is_over(&self) -> bool {
        self.has_passed(self.wait, false)
    }

    /// True once the line has been silent for `time`.
    #[inline(always)]
    pub(super) fn is_silent(&self, time: u32) -> bool {
        self.has_passed(time, true)
    }

    /// True once `time` has passed since the line was last busy, or since the phase
    /// began. (One function: 32 bits are much work for an AVR.)
    #[cfg_attr(target_os = "none", inline(never))]
    fn has_passed(&self, time: u32, since_last_byte: bool) -> bool {
        let since = if since_last_byte {
            self.last_byte
        } else {
            self.since
        };
        has_elapsed(time, self.now, since)
    }

    /// Waits until the slaves have carried out a broadcast.
    #[inline(always)]
    pub(super) fn turn_around(&mut self) -> Status {
        if self.is_over() {
            Status::OK
        } else {
            self.wait()
        }
    }

    /// What a line that is not silent, or a port that does not move, makes of a
    /// request.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn stalled(&self) -> Status {
        if self.is_over() {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }
}

impl<P: Port, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// Says that the line was busy just now, so the gap counts from here.
    pub fn line_used(&mut self) {
        self.last_byte = self.port.micros();
    }

    /// Says that the line was used at that time, by the clock of the port. The gap
    /// counts from then, unless the line was used later.
    pub fn line_used_at(&mut self, time: u32) {
        if time.wrapping_sub(self.last_byte) < LONGEST {
            self.last_byte = time;
        }
    }

    /// When the line was last seen in use, by the clock of the port.
    pub fn last_use(&self) -> u32 {
        self.last_byte
    }

    /// Moves the request on to the time `now`, without waiting:
    /// [`Status::PENDING`] until it has ended, then how.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll(&mut self, now: u32) -> Status {
        self.poll_with(now, None)
    }

    /// As [`Engine::poll`], but `receive` waits for the reply if there is such a function.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll_with(&mut self, now: u32, receive: Option<Receive<Self>>) -> Status {
        self.waiting = false;
        self.look_at_clock(now);
        let status = match self.phase {
            Phase::Idle => return Status::OK,
            Phase::Gap => self.listen(),
            Phase::Send | Phase::Flush | Phase::Hold => self.send(),
            phase => match receive {
                Some(receive) => receive(self),
                None if phase == Phase::Reply => self.receive::<false>(),
                None => self.turn_around(),
            },
        };
        if status.is_failure() {
            self.cancel();
        } else if status != Status::PENDING {
            self.end();
        }
        status
    }

    /// Gives the request up, with the driver off. Bytes of it may be on the
    /// wire, and a whole one may be answered late.
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

    /// Ends the request, with the driver off.
    #[cfg_attr(target_os = "none", inline(never))]
    fn end(&mut self) {
        self.take_back();
        if matches!(self.phase, Phase::Send | Phase::Flush | Phase::Hold) {
            self.port.post_transmission();
        }
        self.phase = Phase::Idle;
        self.waiting = false;
    }

    /// How long, in microseconds from `now`, poll will find nothing to do unless
    /// a byte arrives; the greatest value if there is no request. A phase that just
    /// began counts its time from this call, so the caller may sleep that long.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.look_at_clock(now);
        let settings = &self.settings;
        let (time, since) = match self.phase {
            Phase::Idle => return u32::MAX,
            Phase::Send | Phase::Flush | Phase::Hold => return 0,
            Phase::Gap => (self.silence_to_keep(), self.last_byte),
            Phase::Reply if self.probation == Probation::Held => {
                (settings.quiet_time, self.last_byte)
            }
            Phase::Reply if !self.skimmed => (settings.silence, self.last_byte),
            Phase::Reply | Phase::Turnaround => (self.wait, self.since),
        };
        time.saturating_sub(elapsed(now, since))
    }
}

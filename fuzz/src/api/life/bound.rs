//! How long a request may take. All terms are generous, but finite.

/// The greatest value that each setting of a line has had. Times are in microseconds.
#[derive(Clone, Copy)]
pub struct Limits {
    /// The response timeout of the client, of a unit or of a request.
    pub timeout: u64,
    pub quiet: u64,
    pub turnaround: u64,
    pub gap: u64,
    /// The time of one character.
    pub character: u64,
    pub retries: u64,
    pub busy_retries: u64,
    /// The wait before a retry.
    pub backoff: u64,
    /// The time for which the client leaves a unit alone.
    pub rest: u64,
    /// How long a connection may take to be made, and the wait before the next attempt.
    pub connect: u64,
    pub link_wait: u64,
}

impl Limits {
    /// The defaults of a client and its link.
    pub const DEFAULT: Limits = Limits {
        timeout: 2_000_000,
        quiet: 100_000,
        turnaround: 100_000,
        gap: 4_000,
        character: 1_200,
        retries: 0,
        busy_retries: 0,
        backoff: 0,
        rest: 0,
        connect: 10_000_000,
        link_wait: 30_000_000,
    };

    /// The longest time of one attempt, from the moment at which the line is free.
    fn attempt(&self) -> u64 {
        // The silence that the engine keeps after a failure, and after which it takes a held
        // reply. It may depend on how long earlier replies took.
        let hold = self.quiet.max(2 * self.timeout) + self.gap;
        // A unit that may still answer a cancelled request is left alone until it is clean.
        let late = 2 * self.timeout + self.quiet;
        // While the line is never silent, or the port takes nothing, an attempt ends after the
        // timeout. A byte that the port takes begins the time anew.
        let sending = 40 * (self.timeout + hold) + 300 * self.character;
        // The second is the silence that ends an ASCII frame.
        let reply = 2 * self.timeout + hold + self.turnaround + 1_000_000;
        late + hold + sending + reply + self.backoff + self.rest
    }

    /// The longest time until a request with `ahead` others before it has ended, while the
    /// client may use its line.
    pub fn request(&self, ahead: u64) -> u64 {
        let attempts = 1 + self.retries + self.busy_retries;
        (ahead + 1) * attempts * (self.attempt() + self.connect + self.link_wait)
    }
}

//! Random lives of clients on simulated lines, with a simulated clock: requests, links, masters
//! that use a client's line, a plan, a gateway, and rings that hold what arrives. The calls keep
//! to the rules of the header. Two properties hold:
//!
//! - A request that has ended is never sent. Each request has an address of its own, so the device
//!   knows which request it receives.
//! - Every request ends, once, within a time that the settings give. The clock moves on by the
//!   results of the pollDelay functions. In a quarter of the lives it jumps; then the time counts
//!   from the last jump.
//!
//! Some devices lack registers of the plan. If the plan divides its reads, only their fields have the
//! status of one that is not there, and the others have news in bounded time.

mod bound;
mod client;
mod gateway;
mod link;
mod plan;
mod state;
mod wire;

use state::{Life, LINES};

/// Makes one call or a few that belong together.
fn act(life: &Life) {
    let at = life.line();
    match life.w.byte() % 32 {
        0..=9 => client::queue(life, at),
        10 => client::cancel(life),
        11 | 12 => client::set(life, at),
        13 => client::lend(life, at),
        14 | 15 => client::take_back(life, at),
        16 | 17 => client::master_request(life, pass_times),
        18 => client::begin_again(life, at),
        19 => client::replace(life, at),
        20 | 21 => link::begin_or_end(life, at),
        22 => link::set(life, at),
        23 => link::reconnect(life, at),
        24 | 25 => link::change_wire(life, at),
        26 | 27 => gateway::act(life),
        28 => gateway::ask(life),
        29 => plan::act(life),
        30 if life.may_jump.get() && life.w.byte() & 3 == 0 => {
            let most = [5_000_000, 3_000_000_000, u32::MAX][usize::from(life.w.byte()) % 3];
            let jump = life.w.random() % most;
            let jump = if life.w.byte() & 1 == 0 {
                jump
            } else {
                0u32.wrapping_sub(jump)
            };
            life.jumped.set(life.jumped.get().wrapping_add(jump));
        }
        // The program polls late.
        30 => life.now.set(life.now.get() + u64::from(life.w.word())),
        31 if life.w.byte() & 1 == 0 => life.lines[at].wire.guess(life),
        _ => {
            let bytes: Vec<u8> = (0..life.w.byte() % 20).map(|_| life.w.byte()).collect();
            life.is_forged.set(true);
            life.lines[at].wire.arrive(life, &bytes);
        }
    }
}

/// Lets the time pass until something is due, and polls everything.
fn pass(life: &Life) {
    let w = &life.w;
    let now = life.now.get();
    let mut delay = u64::MAX;
    for line in &life.lines {
        let client = line.client.get();
        delay = delay.min(call!(w, mbm_client_pollDelay(client)).into());
        delay = delay.min(line.wire.delay(now));
    }
    for master in &life.masters {
        if master.pending.get().is_some() {
            let node = master.nodes[master.asker.get()];
            let own = call!(w, mbm_node_pollDelay(node));
            delay = delay.min(own.into());
        }
    }
    delay = delay
        .min(life.gateway.delay(life))
        .min(life.plan.delay(life));
    if delay == 0 {
        // Time passes also while the program polls without a pause, ever faster.
        delay = 1 << (life.at_once.get() / 2).min(17);
        life.at_once.set(life.at_once.get() + 1);
    } else {
        life.at_once.set(0);
    }
    // Not too far, so that the properties see which clients were awake meanwhile.
    delay = delay.min(5_000_000);
    for line in &life.lines {
        if life.is_awake(line) {
            line.awake.set(line.awake.get() + delay);
        }
    }
    life.now.set(now + delay);
    poll(life);
    check(life);
}

/// Lets the time pass a few times.
fn pass_times(life: &Life, times: u8) {
    for _ in 0..times {
        pass(life);
    }
}

fn poll(life: &Life) {
    life.plan.poll(life);
    for at in 0..LINES {
        let client = life.lines[at].client.get();
        call!(&life.w, mbm_client_poll(client));
    }
    life.gateway.poll(life);
    for master in &life.masters {
        client::poll_master(life, master);
    }
}

/// Fails if a request has lasted too long. While the clock jumps, nothing says how long.
fn check(life: &Life) {
    if life.may_jump.get() {
        return;
    }
    for job in &life.jobs {
        let line = &life.lines[job.line.get()];
        if let Some(since) = job.since.get() {
            let lasts = line.awake.get() - since;
            assert!(
                lasts <= life.bound(line),
                "request {:#x} on line {} has not ended after {lasts} us",
                job.id.get(),
                job.line.get()
            );
        }
    }
    for master in &life.masters {
        if let Some((id, since)) = master.pending.get() {
            let line = &life.lines[master.at.get()];
            let lasts = life.now.get() - since;
            assert!(
                lasts <= life.bound(line),
                "request {id:#x} of a master has not ended after {lasts} us"
            );
        }
    }
    life.gateway.check(life);
    life.plan.check(life);
}

/// True if a request is pending that has to end.
fn is_busy(life: &Life) -> bool {
    let jobs = life
        .jobs
        .iter()
        .any(|job| job.since.get().is_some() && life.is_awake(&life.lines[job.line.get()]));
    jobs || life
        .masters
        .iter()
        .any(|master| master.pending.get().is_some())
}
/// The times of all that is pending begin anew.
fn restart(life: &Life) {
    let awake = |at: usize| life.lines[at].awake.get();
    for job in &life.jobs {
        job.since
            .set(job.since.get().map(|_| awake(job.line.get())));
    }
    for master in &life.masters {
        let pending = master.pending.get();
        master
            .pending
            .set(pending.map(|(id, _)| (id, life.now.get())));
    }
    for socket in &life.gateway.sockets {
        for (line, since) in socket.asked.borrow_mut().values_mut() {
            *since = awake(*line);
        }
    }
    for news in &life.plan.news {
        news.set(awake(life.plan.line.get()));
    }
}

/// Runs one input.
pub fn run(data: &[u8]) {
    let life = Life::new(data, act);
    for at in 0..LINES {
        client::begin(&life, at);
    }
    while !life.w.is_over() {
        act(&life);
        for _ in 0..life.w.byte() % 4 {
            pass(&life);
        }
    }
    // Every request ends; `check` fails if one does not.
    life.inside.set(2);
    if life.may_jump.replace(false) {
        restart(&life);
    }
    life.w.note(|| "every request ends".to_string());
    let heals = life.w.byte() & 7 != 0;
    for line in life.lines.iter().filter(|_| heals) {
        line.wire.takes.set(u16::MAX);
        line.wire.flushes.set(true);
    }
    for at in 0..LINES {
        client::take_back(&life, at);
    }
    while is_busy(&life) || life.gateway.is_busy(&life) {
        pass(&life);
        for at in 0..LINES {
            if life.lines[at].is_suspended.get() {
                client::take_back(&life, at);
            }
        }
    }
}

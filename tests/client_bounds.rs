//! The engine of a client accesses its frame buffer only within bounds. The C ABI relies on
//! this, because it reads and writes the buffer through raw pointers. The buffers of these
//! tests panic at an index out of range.

#[path = "common/exchanges.rs"]
mod exchanges;
#[path = "common/frame.rs"]
mod frame;
#[path = "common/wire.rs"]
mod wire;

use exchanges::{Case, CASES};
use mbm::client::{Client, Serial};
use mbm::engine::{Frame, MicrosSetting, Storage as _};
use mbm::error::Status;
use mbm::frame::Framing;
use proptest::prelude::*;
use wire::{End, Lent, Task};

fn encoded(framing: Framing, unit: u8, pdu: &[u8]) -> Vec<u8> {
    frame::framed(framing, 0, unit, pdu)
}

/// Bytes to arrive: random ones, and parts that resemble the expected reply.
fn any_bytes(framing: Framing, case: Case) -> impl Strategy<Value = Vec<u8>> {
    let (_, _, request, response, _) = case;
    let reply = encoded(framing, 17, response);
    let echo = encoded(framing, 17, request);
    let whole = reply.clone();
    let part = prop_oneof![
        3 => prop::collection::vec(any::<u8>(), 0..20),
        1 => prop::collection::vec(any::<u8>(), 0..600),
        1 => prop::collection::vec(prop::sample::select(&b":\r\n01"[..]), 0..40),
        3 => Just(reply.clone()),
        1 => Just(echo),
        2 => any::<prop::sample::Index>().prop_map(move |end| {
            reply[..end.index(reply.len())].to_vec()
        }),
        2 => (0u8..130).prop_map(move |code| encoded(framing, 17, &[request[0] | 0x80, code])),
        1 => (1u8..255).prop_map(move |count| encoded(framing, 17, &[request[0], count, 0])),
        1 => Just(vec![17, request[0]]),
    ];
    prop_oneof![
        Just(whole),
        prop::collection::vec(part, 0..8).prop_map(|parts| parts.concat()),
    ]
}

fn any_lines() -> impl Strategy<Value = (Framing, Case, Vec<Vec<u8>>)> {
    let framing = prop::sample::select(&[Framing::Rtu, Framing::Ascii][..]);
    (framing, prop::sample::select(CASES)).prop_flat_map(|(framing, case)| {
        let lines = prop::collection::vec(any_bytes(framing, case), 1..6);
        (Just(framing), Just(case), lines)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_index_stays_within_the_frame_buffer(
        (framing, case, lines) in any_lines(),
        space in 8usize..600,
        piece in 1usize..300,
        pause in 1u32..20_000,
        echo: bool,
    ) {
        let (build, data, request, response, received) = case;
        // Two of the three sizes are exactly those that the request or the reply needs.
        let needs = [request, response].map(|pdu| encoded(framing, 17, pdu).len());
        for space in [space, needs[0], needs[0].max(needs[1])] {
            let end = End::default();
            let frame = Frame::new(vec![0; space.max(17)]);
            let lent = Lent { frame, ..Lent::default() };
            let mut line = match framing {
                Framing::Ascii => Serial::ascii(end.clone(), lent),
                _ => Serial::new(end.clone(), lent),
            };
            let settings = &mut line.settings;
            settings.echo_discard = echo;
            settings.response_timeout = MicrosSetting::new(200_000);
            let mut client: Client<_, _, 4> = Client::new(line);
            // The arrival time of the last byte of the previous round. It may end a reply too.
            let mut until = None;
            for bytes in &lines {
                let is_alone = until.is_none_or(|until| end.now() > until);
                prop_assert!(client.queue(Task::new(17, 1, data, build)).is_ok());
                let mut brought = false;
                let task = loop {
                    if let Some(task) = client.poll(end.now()) {
                        break task;
                    }
                    if !brought && !end.sent().is_empty() {
                        brought = true;
                        for (index, piece) in bytes.chunks(piece).enumerate() {
                            end.deliver(index as u32 * pause, piece);
                            let arrives = end.now() + index as u32 * pause;
                            until = until.max(Some(arrives));
                        }
                    }
                    end.pass(1_000);
                };
                prop_assert!(task.state.has_ended());
                let is_right = *bytes == encoded(framing, 17, response);
                if task.state.status == Status::OK && is_right && is_alone {
                    prop_assert_eq!(task.received(), received);
                }
                // No held reply takes space in the frame buffer any more.
                let whole = usize::from(client.line.storage.frame.capacity());
                prop_assert_eq!(whole, space.max(17));
            }
        }
    }
}

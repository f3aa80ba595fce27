//! Properties of a trace: nothing is lost, and frames are found however they are split.

use crate::bench::{frame, record, Bench, Kept, ALL, READ, REPLY};
use mbm::error::Status;
use mbm::frame::{ascii, Framing};
use mbm::packet::PduKind::{Request, Response};
use mbm::port::Port;
use mbm::trace::Direction::{Received, Sent};
use mbm::trace::MIN_BUFFER;
use proptest::prelude::*;

/// Responses of several functions.
const PDUS: [&[u8]; 3] = [REPLY, &[0x83, 2], &[6, 0, 1, 2, 3]];

/// Frames of both kinds for the properties, with noise between some of them.
fn pieces(framing: Framing) -> impl Strategy<Value = Vec<Vec<u8>>> {
    let piece = prop_oneof![
        Just(frame(framing, READ)),
        Just(frame(framing, REPLY)),
        Just(frame(framing, &[0x83, 2])),
        Just(frame(framing, &[16, 0, 1, 0, 2])),
        Just(frame(framing, REPLY)[..5].to_vec()),
        Just(frame(framing, &[0x64, 1, 2, 3])),
        prop::collection::vec(any::<u8>(), 1..40),
    ];
    prop::collection::vec(piece, 1..8)
}

fn framing() -> impl Strategy<Value = Framing> {
    prop::sample::select(&ALL[..])
}

proptest! {
    /// However bytes are split, nothing is lost or invented, and every record that is called a
    /// frame is one.
    #[test]
    fn every_byte_is_in_exactly_one_record(
        (framing, pieces) in framing().prop_flat_map(|framing| (Just(framing), pieces(framing))),
        steps in prop::collection::vec((1usize..30, 0u32..80_000, any::<bool>()), 1..30),
        size in prop::sample::select(&[MIN_BUFFER, 64, 101, 1026][..]),
        sends in prop::sample::select(&[Request, Response][..]),
    ) {
        let all = pieces.concat();
        let mut bench = Bench::with_buffer(framing, sends, size);
        let mut left = [&all[..], &all[..]];
        for (count, pause, is_sent) in steps.into_iter().cycle().take(400) {
            let [sent, received] = &mut left;
            if is_sent && !sent.is_empty() {
                let offered = &sent[..sent.len().min(60)];
                bench.wire.borrow_mut().accepts.push_back(count);
                let count = bench.trace.write(offered).unwrap();
                *sent = &sent[count..];
            } else {
                let count = count.min(received.len());
                bench.receive(&received[..count]);
                *received = &received[count..];
            }
            bench.pass(pause);
        }
        bench.trace.hand_out_rest();
        let records = bench.taken();
        for (direction, left) in [(Sent, left[0]), (Received, left[1])] {
            let of = records.iter().filter(|record| record.direction == direction);
            let handed_out: Vec<u8> = of.flat_map(|record| record.bytes.clone()).collect();
            prop_assert_eq!(&handed_out[..], &all[..all.len() - left.len()]);
        }
        for record in records.iter().filter(|record| record.status == Status::OK) {
            let mut bytes = record.bytes.clone();
            prop_assert!(framing.parse(&mut bytes, ascii::END).is_ok(), "{:?}", record);
        }
    }

    /// Frames without noise between them are found, however they are split.
    #[test]
    fn every_frame_of_a_stream_is_found(
        framing in framing(),
        pdus in prop::collection::vec(prop::sample::select(&PDUS[..]), 1..10),
        steps in prop::collection::vec(1usize..40, 1..10),
    ) {
        let frames: Vec<Vec<u8>> = pdus.iter().map(|pdu| frame(framing, pdu)).collect();
        let all = frames.concat();
        let mut bench = Bench::new(framing, Request);
        let mut left = &all[..];
        for step in steps.into_iter().cycle() {
            let (now, later) = left.split_at(step.min(left.len()));
            bench.receive(now);
            left = later;
            if left.is_empty() {
                break;
            }
        }
        let expected: Vec<Kept> = frames.iter().map(|frame| record(Received, Response, Status::OK, 0, frame)).collect();
        prop_assert_eq!(bench.taken(), expected);
    }
}

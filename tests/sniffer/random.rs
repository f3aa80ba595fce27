//! The sniffer with random exchanges, random noise and random bytes.

use crate::bench::{frame, rtu, Bench};
use crate::exchanges::EXCHANGES;
use mbm::frame::rtu::crc16;
use mbm::frame::Framing;
use mbm::sniffer::{BusDirection, EventKind};
use proptest::prelude::*;

/// For each exchange: noise before it, its index, and the silence after each frame.
type Traffic = Vec<(Vec<u8>, usize, u32)>;

fn traffic() -> impl Strategy<Value = Traffic> {
    let noise = prop::collection::vec(any::<u8>(), 0..12);
    let silence = prop_oneof![Just(0), Just(5_000)];
    prop::collection::vec((noise, 0..EXCHANGES.len(), silence), 1..8)
}

/// True if noise and the bytes after it form a frame by chance: their CRC is right, and the
/// first byte is in the noise.
fn is_accident(bytes: &[u8], noise: &[(usize, usize)]) -> bool {
    noise.iter().any(|(start, end)| {
        (*start..*end).any(|from| {
            (4..=256).any(|length| {
                bytes
                    .get(from..from + length)
                    .is_some_and(|frame| crc16(frame).is_residue())
            })
        })
    })
}

/// The frames of all events but noise and frames with a wrong CRC.
fn whole_frames(bench: &Bench) -> Vec<(EventKind, Vec<u8>)> {
    let mut frames = bench.frames();
    frames.retain(|(kind, _)| !matches!(kind, EventKind::Noise | EventKind::BadCrc));
    frames
}

proptest! {
    #[test]
    fn rtu_frames_between_noise_are_found_in_order_and_nothing_is_invented(
        traffic in traffic(),
        piece in 1usize..300,
    ) {
        let mut bytes = Vec::new();
        let mut noise = Vec::new();
        let mut wanted = Vec::new();
        for (before, which, _) in &traffic {
            // Only functions whose length is known. Other frames are found only between silences.
            let (request, reply, ..) = EXCHANGES[*which % 7];
            noise.push((bytes.len(), bytes.len() + before.len()));
            bytes.extend(before);
            bytes.extend(rtu(17, request));
            bytes.extend(rtu(17, reply));
            wanted.push((EventKind::Request, request.to_vec()));
            wanted.push((EventKind::Reply, reply.to_vec()));
        }
        prop_assume!(!is_accident(&bytes, &noise));
        let mut bench = Bench::new(Framing::Rtu);
        for some in bytes.chunks(piece) {
            bench.feed(some);
            bench.now += 1_000;
        }
        bench.wait(300_000);
        prop_assert_eq!(whole_frames(&bench), wanted);
        let reported: usize = bench.events.iter().map(|event| event.length).sum();
        prop_assert_eq!(reported, bytes.len());
    }

    #[test]
    fn every_function_is_found_between_silences_with_noise_in_the_gaps(
        traffic in traffic(),
    ) {
        let mut bench = Bench::new(Framing::Rtu);
        let (mut wanted, mut all, mut noise) = (Vec::new(), Vec::new(), Vec::new());
        for (before, which, silence) in &traffic {
            let (request, reply, ..) = EXCHANGES[*which];
            let (request_frame, reply_frame) = (rtu(17, request), rtu(17, reply));
            noise.push((all.len(), all.len() + before.len()));
            all.extend([&before[..], &request_frame, &reply_frame].concat());
            bench.feed(before);
            bench.wait(5_000 + silence);
            for (kind, frame, pdu) in [
                (EventKind::Request, request_frame, request),
                (EventKind::Reply, reply_frame, reply),
            ] {
                bench.feed(&frame);
                bench.wait(5_000 + silence);
                wanted.push((kind, pdu.to_vec()));
            }
        }
        bench.wait(300_000);
        prop_assume!(!is_accident(&all, &noise));
        prop_assert_eq!(whole_frames(&bench), wanted);
        let reported: usize = bench.events.iter().map(|event| event.length).sum();
        prop_assert_eq!(reported, all.len());
    }

    #[test]
    fn every_byte_belongs_to_one_event(
        pieces in prop::collection::vec(
            (prop::collection::vec(any::<u8>(), 0..100), any::<u32>(), 0u8..3), 0..20),
        framing in 0u8..4,
        size in 0usize..600,
        is_apart: bool,
        baud in prop_oneof![Just(0), Just(9_600), any::<u32>()],
    ) {
        let framing = Framing::from_code(framing).unwrap();
        let mut bench = Bench::with_buffer(framing, 64 + size);
        bench.sniffer.set_baud_rate(baud);
        let mut count = 0;
        for (bytes, time, direction) in pieces {
            let direction = match (is_apart, direction) {
                (false, _) => BusDirection::Both,
                (true, 0) => BusDirection::Client,
                _ => BusDirection::Server,
            };
            bench.feed_at(direction, &bytes);
            bench.wait(time % 3_000_000);
            count += bytes.len();
        }
        bench.wait(10_000_000);
        let reported: usize = bench.events.iter().map(|event| event.length).sum();
        if framing == Framing::Tcp {
            // The event of a frame that is too long counts all bytes that its header
            // announces, though they may never arrive.
            prop_assert!(reported >= count);
        } else {
            prop_assert_eq!(reported, count);
        }
    }

    #[test]
    fn a_sniffer_reports_the_same_events_whether_or_not_it_searches_after_each_byte(
        framing in 0u8..4,
        pieces in prop::collection::vec(
            (0..EXCHANGES.len(), any::<bool>(), prop::collection::vec(any::<u8>(), 0..4), 0u32..3),
            1..12,
        ),
        piece in 1usize..20,
        is_apart: bool,
    ) {
        let framing = Framing::from_code(framing).unwrap();
        let mut deferred = Bench::new(framing);
        let mut eager = Bench::new(framing);
        for (which, is_reply, noise, silence) in pieces {
            let (request, reply, ..) = EXCHANGES[which];
            let pdu = if is_reply { reply } else { request };
            let direction = match (is_apart, is_reply) {
                (false, _) => BusDirection::Both,
                (true, false) => BusDirection::Client,
                (true, true) => BusDirection::Server,
            };
            let bytes = [frame(framing, 1, 17, pdu), noise].concat();
            for some in bytes.chunks(piece) {
                for bench in [&mut deferred, &mut eager] {
                    bench.now += 200;
                    bench.feed_at(direction, some);
                }
                // Setting a timeout makes the sniffer search again, even after a single byte.
                eager.sniffer.set_timeout(1_000_000);
                eager.collect_events();
            }
            for bench in [&mut deferred, &mut eager] {
                bench.wait([0, 3_000, 60_000][silence as usize]);
            }
        }
        deferred.wait(10_000_000);
        eager.wait(10_000_000);
        prop_assert_eq!(deferred.events, eager.events);
    }

    #[test]
    fn ascii_and_tcp_frames_are_found_in_order_in_pieces_of_any_length(
        which in prop::collection::vec((0..EXCHANGES.len(), "[ -9;-~]{0,9}"), 1..8),
        piece in 1usize..300,
        is_tcp: bool,
    ) {
        let framing = if is_tcp { Framing::Tcp } else { Framing::Ascii };
        let (mut bytes, mut wanted) = (Vec::new(), Vec::new());
        for (index, (which, noise)) in which.iter().enumerate() {
            let (request, reply, ..) = EXCHANGES[*which];
            if !is_tcp {
                bytes.extend(noise.bytes());
            }
            for (kind, pdu) in [(EventKind::Request, request), (EventKind::Reply, reply)] {
                bytes.extend(frame(framing, index as u16, 17, pdu));
                wanted.push((kind, pdu.to_vec()));
            }
        }
        let mut bench = Bench::new(framing);
        for some in bytes.chunks(piece) {
            bench.feed(some);
            bench.now += 1_000;
        }
        let found: Vec<_> = bench
            .frames()
            .into_iter()
            .filter(|(kind, _)| *kind != EventKind::Noise)
            .collect();
        prop_assert_eq!(found, wanted);
        let reported: usize = bench.events.iter().map(|event| event.length).sum();
        prop_assert_eq!(reported, bytes.len());
    }
}

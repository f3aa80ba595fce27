//! The responder: every function at its limits, and the order of its checks.

mod common;

use common::device::{ask, Device};
use mbm::frame::Framing;
use mbm::server::respond;
use mbm::server::Service;

/// The response of a new device, which has ten registers and 20 bits of each kind from address
/// 100 on.
fn answer(request: &[u8]) -> Vec<u8> {
    ask(&mut Device::new(), request)
}

/// True for an exception response to `request` with this code.
fn refuses(request: &[u8], code: u8) -> bool {
    answer(request) == [request[0] | 0x80, code]
}

#[test]
fn registers_are_read_high_byte_first() {
    assert_eq!(answer(&[3, 0, 100, 0, 2]), [3, 4, 0x10, 0, 0x10, 1]);
    assert_eq!(answer(&[4, 0, 109, 0, 1]), [4, 2, 0x20, 9]);
}

#[test]
fn bits_are_read_lowest_first_and_padded_with_zeros() {
    assert_eq!(
        answer(&[1, 0, 100, 0, 10]),
        [1, 2, 0b0100_1001, 0b0000_0010]
    );
    assert_eq!(answer(&[1, 0, 101, 0, 3]), [1, 1, 0b100]);
    assert_eq!(answer(&[2, 0, 100, 0, 3]), [2, 1, 0b110]);
}

#[test]
fn an_unknown_function_is_refused_first() {
    for function in [
        0, 9, 0x0A, 0x0D, 0x12, 0x13, 0x19, 0x2A, 0x2C, 0x40, 0x41, 0x7F,
    ] {
        assert!(refuses(&[function], 1), "{function:02X}");
        assert!(refuses(&[function, 0xFF, 0xFF, 0, 0], 1), "{function:02X}");
    }
}

#[test]
fn the_quantity_is_checked_before_the_address() {
    for (function, most) in [(1, 2000u16), (2, 2000), (3, 125), (4, 125)] {
        for quantity in [0, most + 1, 0xFFFF] {
            let [high, low] = quantity.to_be_bytes();
            assert!(refuses(&[function, 0xFF, 0xFF, high, low], 3), "{quantity}");
        }
        let [high, low] = most.to_be_bytes();
        assert!(refuses(&[function, 0, 100, high, low], 2));
    }
}

#[test]
fn a_table_can_be_read_from_its_first_to_its_last_cell() {
    for function in [3, 4] {
        assert!(answer(&[function, 0, 100, 0, 10]).len() == 22);
        assert!(refuses(&[function, 0, 99, 0, 1], 2));
        assert!(refuses(&[function, 0, 100, 0, 11], 2));
        assert!(refuses(&[function, 0, 110, 0, 1], 2));
        assert!(refuses(&[function, 0xFF, 0xFF, 0, 1], 2));
    }
    for function in [1, 2] {
        assert!(answer(&[function, 0, 100, 0, 20]).len() == 5);
        assert!(refuses(&[function, 0, 99, 0, 1], 2));
        assert!(refuses(&[function, 0, 100, 0, 21], 2));
    }
}

#[test]
fn cells_that_the_mask_excludes_do_not_exist() {
    let mut device = Device::new();
    device.valid = Some([0b1111_1011, 0xFF]);
    assert_eq!(ask(&mut device, &[3, 0, 100, 0, 2]).len(), 6);
    assert_eq!(ask(&mut device, &[3, 0, 100, 0, 3]), [0x83, 2]);
    assert_eq!(ask(&mut device, &[6, 0, 102, 0, 3]), [0x86, 2]);
    assert_eq!(ask(&mut device, &[3, 0, 103, 0, 7]).len(), 16);
}

#[test]
fn single_writes_echo_the_request() {
    let mut device = Device::new();
    assert_eq!(
        ask(&mut device, &[6, 0, 100, 0xAB, 0xCD]),
        [6, 0, 100, 0xAB, 0xCD]
    );
    assert_eq!(device.holding[0], 0xABCD);
    assert_eq!(
        ask(&mut device, &[5, 0, 101, 0xFF, 0]),
        [5, 0, 101, 0xFF, 0]
    );
    assert_eq!(ask(&mut device, &[5, 0, 100, 0, 0]), [5, 0, 100, 0, 0]);
    assert_eq!(device.coils[0] & 0b11, 0b10);
}

#[test]
fn a_coil_is_on_with_ff00_and_off_with_0000_only() {
    for value in [[0, 1], [0xFF, 1], [1, 0], [0xFE, 0], [0xFF, 0xFF]] {
        // The address is wrong too, but the value is checked first.
        assert!(refuses(&[5, 0, 1, value[0], value[1]], 3), "{value:?}");
    }
    assert!(refuses(&[5, 0, 1, 0xFF, 0], 2));
}

#[test]
fn several_cells_are_written() {
    let mut device = Device::new();
    let request = [0x10, 0, 108, 0, 2, 4, 1, 2, 3, 4];
    assert_eq!(ask(&mut device, &request), request[..5]);
    assert_eq!(device.holding[8..], [0x0102, 0x0304]);
    let request = [0x0F, 0, 110, 0, 10, 2, 0b1010_1010, 0xFF];
    assert_eq!(ask(&mut device, &request), request[..5]);
    // Bits 0 to 9 have not changed, and the six unused bits of the data have no effect.
    assert_eq!(device.coils, [0b0100_1001, 0b1010_1010, 0b1110]);
}

#[test]
fn a_wrong_byte_count_is_refused_before_the_address() {
    for count in [0, 1, 2, 3, 5, 6, 255] {
        assert!(
            refuses(&[0x10, 0, 0, 0, 2, count, 1, 2, 3, 4], 3),
            "{count}"
        );
        assert!(refuses(&[0x0F, 0, 0, 0, 25, count, 1, 2, 3], 3) || count == 4);
    }
    assert!(refuses(&[0x10, 0, 100, 0, 2, 4, 1, 2, 3], 3));
    assert!(refuses(&[0x10, 0, 100, 0, 2, 4, 1, 2, 3, 4, 5], 3));
    assert!(refuses(&[0x10, 0, 0, 0, 2, 4, 1, 2, 3, 4], 2));
}

#[test]
fn a_write_of_zero_values_with_data_is_refused() {
    assert!(refuses(&[0x10, 0, 100, 0, 0, 0], 3));
    assert!(refuses(&[0x10, 0, 100, 0, 0, 0, 1, 2], 3));
    assert!(refuses(&[0x10, 0, 100, 0, 1, 0, 1, 2], 3));
    assert!(refuses(&[0x0F, 0, 100, 0, 0, 0, 1], 3));
}

#[test]
fn the_greatest_quantities_are_accepted() {
    let mut words = [0; 0x200];
    let mut table = mbm::server::storage::HoldingRegisters(
        mbm::server::storage::RegisterArray::new(0, &mut words),
    );
    let mut pdu = vec![0x10, 0, 0, 0, 123, 246];
    pdu.resize(252, 7);
    pdu.resize(253, 0);
    assert_eq!(table.serve(&mut pdu, 252).code(), 5);
    pdu[..6].copy_from_slice(&[0x10, 0, 0, 0, 124, 248]);
    assert_eq!(table.serve(&mut pdu, 254).exception_code(), 3);
    pdu[..5].copy_from_slice(&[3, 0, 0, 0, 125]);
    assert_eq!(table.serve(&mut pdu, 5).code(), 252);

    let mut bits = [0; 250];
    let mut coils = mbm::server::storage::Coils(mbm::server::storage::BitArray::new(0, &mut bits));
    let mut pdu = vec![0x0F, 0, 0, 0x07, 0xB0, 246];
    pdu.resize(252, 7);
    assert_eq!(coils.serve(&mut pdu, 252).code(), 5);
    pdu[..6].copy_from_slice(&[0x0F, 0, 0, 0x07, 0xB1, 247]);
    pdu.resize(253, 7);
    assert_eq!(coils.serve(&mut pdu, 253).exception_code(), 3);
}

#[test]
fn requests_of_a_wrong_length_are_refused() {
    for request in [
        &[3][..],
        &[3, 0, 100, 0],
        &[3, 0, 100, 0, 1, 0],
        &[6, 0, 100, 0],
        &[6, 0, 100, 0, 1, 1],
        &[5, 0, 100, 0xFF],
        &[0x0F, 0, 100, 0, 1],
        &[0x16, 0, 100, 0, 0, 0],
        &[0x16, 0, 100, 0, 0, 0, 0, 0],
        &[0x17, 0, 100, 0, 1, 0, 100, 0, 1],
        &[7, 0],
        &[8, 0],
        &[8, 0, 0],
        &[0x0B, 0],
        &[0x0C, 0],
        &[0x11, 0],
        &[0x14],
        &[0x15],
        &[0x18, 0],
        &[0x18, 0, 0, 0],
        &[0x2B, 0x0E, 1],
        &[0x2B, 0x0E, 1, 0, 0],
    ] {
        assert!(refuses(request, 3), "{request:02X?}");
    }
}

#[test]
fn a_mask_write_follows_the_formula_of_the_standard() {
    let mut device = Device::new();
    device.holding[0] = 0x0012;
    let request = [0x16, 0, 100, 0, 0xF2, 0, 0x25];
    assert_eq!(ask(&mut device, &request), request);
    assert_eq!(device.holding[0], 0x0017);
    assert!(refuses(&[0x16, 0, 99, 0, 0, 0, 0], 2));
}

#[test]
fn read_write_writes_first() {
    let mut device = Device::new();
    let request = [0x17, 0, 100, 0, 2, 0, 101, 0, 1, 2, 0xBE, 0xEF];
    assert_eq!(ask(&mut device, &request), [0x17, 4, 0x10, 0, 0xBE, 0xEF]);
}

#[test]
fn read_write_changes_nothing_if_it_cannot_read() {
    for (request, code) in [
        ([0x17, 0, 110, 0, 1, 0, 100, 0, 1, 2, 1, 1], 2),
        ([0x17, 0, 100, 0, 1, 0, 110, 0, 1, 2, 1, 1], 2),
        ([0x17, 0, 100, 0, 0, 0, 100, 0, 1, 2, 1, 1], 3),
        ([0x17, 0, 100, 0, 126, 0, 100, 0, 1, 2, 1, 1], 3),
        ([0x17, 0, 100, 0, 1, 0, 100, 0, 122, 244, 1, 1], 3),
        ([0x17, 0, 100, 0, 1, 0, 100, 0, 2, 2, 1, 1], 3),
    ] {
        let mut device = Device::new();
        assert_eq!(ask(&mut device, &request), [0x97, code]);
        assert_eq!(device.holding, Device::new().holding);
    }
}

#[test]
fn the_exception_of_a_hook_is_sent_and_nothing_is_written() {
    for request in [
        &[6, 0, 104, 0, 1][..],
        &[0x10, 0, 103, 0, 2, 4, 9, 9, 9, 9],
        &[0x16, 0, 104, 0, 0, 0xFF, 0xFF],
        &[0x17, 0, 100, 0, 1, 0, 103, 0, 2, 4, 9, 9, 9, 9],
    ] {
        let mut device = Device::new();
        device.refuse = Some((104, 6));
        assert_eq!(ask(&mut device, request), [request[0] | 0x80, 6]);
        assert_eq!(device.holding, Device::new().holding);
        assert!(device.written.is_empty());
    }
}

#[test]
fn hooks_get_the_written_range_and_the_new_values() {
    let mut device = Device::new();
    ask(&mut device, &[0x10, 0, 103, 0, 2, 4, 1, 2, 3, 4]);
    assert_eq!(device.asked, [(103, 2, vec![1, 2, 3, 4])]);
    assert_eq!(device.written, [(103, 2)]);
    ask(&mut device, &[0x16, 0, 103, 0xFF, 0, 0, 0xFF]);
    assert_eq!(device.asked[1], (103, 1, vec![1, 0xFF]));
    ask(&mut device, &[3, 0, 103, 0, 1]);
    assert_eq!(device.written.len(), 2);
}

#[test]
fn a_reply_that_does_not_fit_is_exception_04_and_nothing_is_written() {
    let mut device = Device::new();
    let mut buffer = [0; 16];
    let frame = common::frame::sealed(&[17, 0x17, 0, 100, 0, 10, 0, 100, 0, 1, 2, 1]);
    assert_eq!(frame.len(), 14);
    let request = common::frame::sealed(&[17, 3, 0, 100, 0, 10]);
    buffer[..8].copy_from_slice(&request);
    let length =
        device.with_unit(|unit| respond(Framing::Rtu, 10, &mut buffer, 8, &mut [unit][..]));
    assert_eq!(length, Ok(5));
    assert_eq!(buffer[..3], [17, 0x83, 4]);
}

#[test]
fn exception_status_and_server_id_are_read() {
    assert_eq!(answer(&[7]), [7, 0x6D]);
    assert_eq!(
        answer(&[0x11]),
        [0x11, 6, b'i', b'd', 0xFF, b'm', b'b', b'm']
    );
}

#[test]
fn the_run_indicator_is_ff_or_00() {
    for (running, indicator) in [(true, 0xFF), (false, 0)] {
        let mut pdu = [0x11, 0, 0, 0];
        let reply = mbm::server::identity::serve_server_id(b"a", running, b"", &mut pdu, 1);
        assert_eq!((reply.code(), pdu), (4, [0x11, 2, b'a', indicator]));
    }
}

#[test]
fn file_records_are_read_in_groups() {
    let request = [0x14, 0x0E, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1];
    let answered = [0x14, 10, 5, 6, 4, 1, 4, 2, 3, 6, 3, 9];
    assert_eq!(answer(&request), answered);
}

#[test]
fn a_response_with_long_records_does_not_overwrite_its_request_too_early() {
    let request = [
        0x14, 21, 6, 0, 4, 0, 0, 0, 8, 6, 0, 3, 0, 1, 0, 9, 6, 0, 4, 0, 9, 0, 1,
    ];
    let answered = answer(&request);
    assert_eq!(answered[1], 18 + 20 + 4);
    assert_eq!(answered[2..6], [17, 6, 4, 0]);
    assert_eq!(answered[20..24], [19, 6, 3, 1]);
    assert_eq!(answered[40..], [3, 6, 4, 9]);
}

#[test]
fn file_records_are_written_all_or_none() {
    let mut device = Device::new();
    let request = [
        0x15, 18, 6, 0, 4, 0, 7, 0, 1, 0xAA, 0xBB, 6, 0, 3, 0, 0, 0, 1, 0xCC, 0xDD,
    ];
    assert_eq!(ask(&mut device, &request), request);
    assert_eq!((device.files[1][7], device.files[0][0]), (0xAABB, 0xCCDD));
    let mut device = Device::new();
    let mut wrong = request;
    wrong[15] = 10;
    assert_eq!(ask(&mut device, &wrong), [0x95, 2]);
    assert_eq!(device.files, Device::new().files);
}

#[test]
fn malformed_file_requests_are_refused() {
    for (request, code) in [
        (&[0x14, 7, 5, 0, 4, 0, 0, 0, 1][..], 2),
        (&[0x14, 7, 6, 0, 5, 0, 0, 0, 1], 2),
        (&[0x14, 7, 6, 0, 4, 0, 10, 0, 1], 2),
        (&[0x14, 7, 6, 0, 4, 0, 9, 0, 2], 2),
        (&[0x14, 7, 6, 0, 4, 0, 0, 0, 0], 3),
        (&[0x14, 8, 6, 0, 4, 0, 0, 0, 1], 3),
        (&[0x14, 6, 6, 0, 4, 0, 0, 0], 3),
        (&[0x15, 9, 6, 0, 4, 0, 0, 0, 2, 1, 1], 3),
        (&[0x15, 9, 6, 0, 4, 0, 10, 0, 1, 1, 1], 2),
    ] {
        assert!(refuses(request, code), "{request:02X?}");
    }
}

#[test]
fn queues_are_read_and_not_emptied() {
    let mut device = Device::new();
    let request = [0x18, 0x04, 0xDE];
    let response = [0x18, 0, 6, 0, 2, 0x01, 0xB8, 0x12, 0x84];
    assert_eq!(ask(&mut device, &request), response);
    assert_eq!(ask(&mut device, &request), response);
    assert!(refuses(&[0x18, 0, 0], 2));
    // A response may hold 31 registers at most.
    assert!(refuses(&[0x18, 0, 32], 3));
    assert_eq!(answer(&[0x18, 0, 31]).len(), 5 + 62);
}

#[test]
fn identification_of_a_category_has_all_its_objects() {
    let mut device = Device::new();
    device.objects = vec![
        (0, b"Maker".to_vec()),
        (1, b"P".to_vec()),
        (2, b"V1".to_vec()),
    ];
    let basic = [
        &[0x2B, 0x0E, 1, 0x81, 0, 0, 3, 0, 5][..],
        b"Maker",
        &[1, 1],
        b"P",
        &[2, 2],
        b"V1",
    ]
    .concat();
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 1, 0]), basic);
    // The response for a category without objects has the objects of the lower categories.
    let extended = ask(&mut device, &[0x2B, 0x0E, 3, 0]);
    assert_eq!(extended[3..], basic[3..]);
    device.objects.push((0x80, b"x".to_vec()));
    let extended = ask(&mut device, &[0x2B, 0x0E, 3, 0]);
    assert_eq!((extended[3], extended[6]), (0x83, 4));
    let basic = ask(&mut device, &[0x2B, 0x0E, 1, 0]);
    assert_eq!((basic[3], basic[6]), (0x83, 3));
}

#[test]
fn identification_continues_at_the_next_object() {
    let mut device = Device::new();
    device.objects = (0..5).map(|id| (id, vec![b'a' + id; 100])).collect();
    let mut next = 0;
    let mut seen = Vec::new();
    loop {
        let part = ask(&mut device, &[0x2B, 0x0E, 2, next]);
        assert!(part.len() <= 253);
        let mut at = 7;
        for _ in 0..part[6] {
            seen.push((part[at], part[at + 2]));
            at += 2 + usize::from(part[at + 1]);
        }
        assert_eq!(at, part.len());
        if part[4] == 0 {
            assert_eq!(part[5], 0);
            break;
        }
        assert_eq!(part[4], 0xFF);
        next = part[5];
    }
    let all: Vec<_> = (0..5).map(|id| (id, b'a' + id)).collect();
    assert_eq!(seen, all);
}

#[test]
fn an_individual_object_is_read_and_an_unknown_one_refused() {
    let mut device = Device::new();
    device.objects = vec![(0, b"M".to_vec()), (0x90, vec![1; 245])];
    let one = ask(&mut device, &[0x2B, 0x0E, 4, 0]);
    assert_eq!(one, [0x2B, 0x0E, 4, 0x83, 0, 0, 1, 0, 1, b'M']);
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 4, 1]), [0xAB, 2]);
    // An object that is too long for a response.
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 4, 0x90]), [0xAB, 4]);
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 5, 0]), [0xAB, 3]);
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 0, 0]), [0xAB, 3]);
    // For a category, an unknown object id means the first object.
    assert_eq!(ask(&mut device, &[0x2B, 0x0E, 1, 2])[7], 0);
    assert_eq!(ask(&mut device, &[0x2B, 0x0D, 1, 2]), [0xAB, 1]);
}

#[test]
fn frames_of_other_units_damaged_frames_and_broadcasts_are_not_answered() {
    let mut device = Device::new();
    let mut buffer = [0; 256];
    for (frame, changed) in [
        (common::frame::sealed(&[18, 6, 0, 100, 1, 1]), false),
        (vec![17, 6, 0, 100, 1, 1, 0, 0], false),
        (vec![17, 6], false),
        (vec![], false),
        (common::frame::sealed(&[0, 3, 0, 100, 0, 1]), false),
        (common::frame::sealed(&[0, 6, 0, 100, 1, 1]), true),
    ] {
        let before = device.holding;
        buffer[..frame.len()].copy_from_slice(&frame);
        let length = frame.len();
        let sent = device
            .with_unit(|unit| respond(Framing::Rtu, 10, &mut buffer, length, &mut [unit][..]));
        assert_eq!(sent, Ok(0), "{frame:02X?}");
        assert_eq!(device.holding != before, changed, "{frame:02X?}");
    }
}

#[test]
fn the_response_is_the_same_in_every_framing() {
    let mut device = Device::new();
    let mut buffer = [0; 600];
    for framing in [
        Framing::Rtu,
        Framing::Ascii,
        Framing::Tcp,
        Framing::RtuOverTcp,
    ] {
        let length = framing
            .emit(&mut buffer, 0xABCD, 17, 10, |pdu| {
                pdu[..5].copy_from_slice(&[3, 0, 100, 0, 10]);
                Ok(5)
            })
            .unwrap();
        let sent = device
            .with_unit(|unit| respond(framing, 10, &mut buffer, length, &mut [unit][..]))
            .unwrap();
        let adu = framing.parse(&mut buffer[..sent], 10).unwrap();
        assert_eq!((adu.unit, adu.pdu.len()), (17, 22), "{framing:?}");
        assert_eq!(adu.pdu[..4], [3, 20, 0x10, 0]);
        if framing == Framing::Tcp {
            assert_eq!(adu.transaction, 0xABCD);
        }
    }
}

#[test]
fn over_tcp_a_request_to_unit_0_or_255_is_for_the_server_and_a_server_with_id_0_answers_for_every_unit(
) {
    let mut device = Device::new();
    for (id, to, answers) in [
        (17, 17, true),
        (17, 0, true),
        (17, 255, true),
        (17, 18, false),
        (0, 18, true),
    ] {
        device.id = id;
        let mut buffer = [0; 260];
        let frame = [0, 1, 0, 0, 0, 6, to, 3, 0, 100, 0, 1];
        buffer[..12].copy_from_slice(&frame);
        let sent =
            device.with_unit(|unit| respond(Framing::Tcp, 10, &mut buffer, 12, &mut [unit][..]));
        assert_eq!(sent != Ok(0), answers, "{id} {to}");
    }
}

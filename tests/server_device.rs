//! A server whose units are devices: structs that read and write their values.

use mbm::frame::{ascii::END, Framing};
use mbm::port::Port;
use mbm::server::diagnostics::Diagnostics;
use mbm::server::storage::{
    BitArray, Coils, DiscreteInputs, HoldingRegisters, InputRegisters, RegisterArray,
};
use mbm::server::{
    respond, Bits, BitsMut, Device, Server, ServiceUnit, Table, Tables, Unit, Units,
};
use mbm::{Error, Exception};
use proptest::prelude::*;

const UNIT: u8 = 17;

/// The response PDU of units to a request PDU; empty if there is none.
fn answer(units: &mut (impl Units + ?Sized), pdu: &[u8]) -> Vec<u8> {
    let mut frame = [0; 260];
    frame[5] = pdu.len() as u8 + 1;
    frame[6] = UNIT;
    frame[7..7 + pdu.len()].copy_from_slice(pdu);
    let length = respond(Framing::Tcp, END, &mut frame, 7 + pdu.len(), units).unwrap();
    frame.get(7..length).unwrap_or_default().to_vec()
}

/// As [`answer`], by one device.
fn answer_of(device: &mut impl Device, pdu: &[u8]) -> Vec<u8> {
    answer(&mut Unit::new(UNIT, device), pdu)
}

fn requests() -> impl Strategy<Value = Vec<u8>> {
    let small = prop_oneof![0u16..12, Just(0xFFFF), 95u16..130, 1960u16..2010];
    let head = (
        prop_oneof![1u8..=6, Just(15), Just(16), Just(22), Just(23)],
        small.clone(),
        small,
    );
    (head, any::<[u16; 4]>(), 0usize..14, any::<bool>()).prop_map(
        |((function, a, q), words, cut, is_right)| {
            let mut pdu = [&[function], &a.to_be_bytes()[..], &q.to_be_bytes()[..]].concat();
            let data: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
            match function {
                15 => pdu.extend([&[q.div_ceil(8) as u8][..], &data].concat()),
                16 => pdu.extend([&[q.wrapping_mul(2) as u8][..], &data].concat()),
                22 => pdu.extend(&data[..2]),
                23 => pdu.extend([&[0, 3, 0, 2, 4][..], &data[..4]].concat()),
                5 if is_right => pdu[3..].copy_from_slice(&[0xFF, 0]),
                _ => {}
            }
            let whole = match function {
                15 => 6 + usize::from(q).div_ceil(8),
                16 => 6 + 2 * usize::from(q),
                _ => pdu.len(),
            };
            let length = if is_right { whole } else { cut };
            pdu.truncate(length.min(pdu.len()).max(1));
            pdu
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn tables_answer_as_the_arrays_of_services_do(requests in prop::collection::vec(requests(), 1..6)) {
        let mut tables = Tables::NONE
            .with_coils(2, [true, false, true, true, false, false, true, false])
            .with_discrete_inputs(3, [true, false, true, true, false, false, true, true])
            .with_holding_registers(1, [1, 2, 3, 4, 5, 6, 7])
            .with_input_registers(0, [9, 8, 7]);
        let (mut coils, mut inputs) = ([0b0100_1101], [0b1100_1101]);
        let (mut holding, mut input) = ([1, 2, 3, 4, 5, 6, 7], [9, 8, 7]);
        for pdu in requests {
            let mut coils = Coils(BitArray::new(2, &mut coils));
            let mut inputs = DiscreteInputs(BitArray::new(3, &mut inputs));
            let mut holding = HoldingRegisters(RegisterArray::new(1, &mut holding));
            let mut input = InputRegisters(RegisterArray::new(0, &mut input));
            let mut units = [ServiceUnit {
                id: UNIT,
                services: &mut [&mut coils, &mut inputs, &mut holding, &mut input],
                diagnostics: None,
            }];
            let expected = answer(&mut units[..], &pdu);
            prop_assert_eq!(answer_of(&mut tables, &pdu), expected, "{:02X?}", pdu);
        }
        prop_assert_eq!(tables.holding_registers.cells, holding);
        let bits = tables.coils.cells.iter().rev().fold(0, |byte, on| byte << 1 | u8::from(*on));
        prop_assert_eq!(bits, coils[0]);
    }
}

/// A device that has everything.
#[derive(Default)]
struct Everything {
    calls: Vec<String>,
    refuses: Option<Exception>,
}

impl Everything {
    fn called(&mut self, call: String) -> Result<(), Exception> {
        self.calls.push(call);
        self.refuses.map_or(Ok(()), Err)
    }
}

impl Device for Everything {
    fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
        coils.set(0, true);
        coils.set(usize::MAX, true);
        self.called(format!("coils {address} {}", coils.len()))
    }

    fn read_discrete_inputs(
        &mut self,
        address: u16,
        inputs: &mut BitsMut,
    ) -> Result<(), Exception> {
        inputs.set_all([false, true, true].into_iter().cycle());
        self.called(format!("inputs {address} {}", inputs.len()))
    }

    fn read_holding_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        registers.fill(0x0102);
        self.called(format!("holding {address} {}", registers.len()))
    }

    fn read_input_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        registers.fill(0x0304);
        self.called(format!("input {address} {}", registers.len()))
    }

    fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
        assert_eq!(coils.get(coils.len()), None);
        let bits: Vec<_> = coils.iter().collect();
        self.called(format!("write {address} {bits:?}"))
    }

    fn write_holding_registers(
        &mut self,
        address: u16,
        registers: &[u16],
    ) -> Result<(), Exception> {
        self.called(format!("write {address} {registers:?}"))
    }

    fn read_exception_status(&mut self) -> Result<u8, Exception> {
        self.called("status".into()).map(|()| 0x6D)
    }

    fn report_server_id(&mut self, data: &mut [u8]) -> Result<usize, Exception> {
        data[..3].copy_from_slice(&[7, 8, 0xFF]);
        self.called("id".into()).map(|()| 3)
    }

    fn read_file_record(
        &mut self,
        file: u16,
        record: u16,
        records: &mut [u16],
    ) -> Result<(), Exception> {
        records.fill(file);
        self.called(format!("file {file} {record} {}", records.len()))
    }

    fn write_file_record(
        &mut self,
        file: u16,
        record: u16,
        records: &[u16],
    ) -> Result<(), Exception> {
        self.called(format!("write file {file} {record} {records:?}"))
    }

    fn read_fifo_queue(&mut self, address: u16, queue: &mut [u16; 31]) -> Result<usize, Exception> {
        queue[..2].copy_from_slice(&[0x01B8, 0x1284]);
        self.called(format!("queue {address}"))
            .map(|()| address.into())
    }

    fn identification(&self, object: u8) -> Option<&[u8]> {
        [&b"maker"[..], b"pump", b"1.0"]
            .get(usize::from(object))
            .copied()
    }

    fn custom(
        &mut self,
        function: u8,
        data: &[u8],
        response: &mut [u8],
    ) -> Result<usize, Exception> {
        for (place, byte) in response.iter_mut().zip(data.iter().rev()) {
            *place = *byte;
        }
        self.called(format!("custom {function} {data:?}"))
            .map(|()| data.len())
    }
}

/// Requests, what they call of a device, and its answers.
const CALLS: [(&[u8], &[&str], &[u8]); 16] = [
    (&[1, 0, 7, 0, 10], &["coils 7 10"], &[1, 2, 1, 0]),
    (&[2, 0, 7, 0, 5], &["inputs 7 5"], &[2, 1, 0b1_0110]),
    (&[3, 0, 7, 0, 2], &["holding 7 2"], &[3, 4, 1, 2, 1, 2]),
    (&[4, 0, 7, 0, 1], &["input 7 1"], &[4, 2, 3, 4]),
    (
        &[5, 0, 7, 0xFF, 0],
        &["write 7 [true]"],
        &[5, 0, 7, 0xFF, 0],
    ),
    (&[5, 0, 7, 0, 0], &["write 7 [false]"], &[5, 0, 7, 0, 0]),
    (&[6, 0, 7, 3, 0x78], &["write 7 [888]"], &[6, 0, 7, 3, 0x78]),
    (&[7], &["status"], &[7, 0x6D]),
    (
        &[15, 0, 7, 0, 3, 1, 5],
        &["write 7 [true, false, true]"],
        &[15, 0, 7, 0, 3],
    ),
    (
        &[16, 0, 7, 0, 2, 4, 0, 1, 0, 2],
        &["write 7 [1, 2]"],
        &[16, 0, 7, 0, 2],
    ),
    (&[17], &["id"], &[17, 3, 7, 8, 0xFF]),
    (
        &[20, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1],
        &["file 4 1 2", "file 3 9 1"],
        &[20, 10, 5, 6, 0, 4, 0, 4, 3, 6, 0, 3],
    ),
    (
        &[21, 9, 6, 0, 4, 0, 7, 0, 1, 1, 2],
        &["write file 4 7 [258]"],
        &[21, 9, 6, 0, 4, 0, 7, 0, 1, 1, 2],
    ),
    (
        &[22, 0, 7, 0xFF, 0, 0, 0x34],
        &["holding 7 1", "holding 7 1", "write 7 [308]"],
        &[22, 0, 7, 0xFF, 0, 0, 0x34],
    ),
    (
        &[24, 0, 2],
        &["queue 2"],
        &[24, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84],
    ),
    (&[0x41, 1, 2, 3], &["custom 65 [1, 2, 3]"], &[0x41, 3, 2, 1]),
];

#[test]
fn every_function_calls_the_device_and_returns_what_it_gives() {
    for (request, calls, expected) in CALLS {
        let mut device = Everything::default();
        assert_eq!(answer_of(&mut device, request), expected, "{request:?}");
        assert_eq!(device.calls, calls);
    }
    let mut device = Everything::default();
    let objects = b"\x2B\x0E\x01\x81\x00\x00\x03\x00\x05maker\x01\x04pump\x02\x031.0";
    assert_eq!(answer_of(&mut device, &[0x2B, 0x0E, 1, 0]), objects);
}

#[test]
fn an_exception_of_the_device_goes_to_the_client_as_it_is() {
    for exception in [
        Exception::IllegalDataAddress,
        Exception::ServerDeviceBusy,
        Exception::Other(0x40),
    ] {
        for (request, calls, _) in CALLS {
            let refuses = Some(exception);
            let mut device = Everything {
                calls: vec![],
                refuses,
            };
            let expected = [request[0] | 0x80, exception.code()];
            assert_eq!(answer_of(&mut device, request), expected, "{request:?}");
            assert_eq!(
                device.calls,
                calls[..1],
                "nothing is written after a refusal"
            );
        }
    }
}

#[test]
fn a_device_without_functions_answers_each_with_exception_01() {
    struct Nothing;
    impl Device for Nothing {}
    for (request, _, _) in CALLS {
        let expected = [request[0] | 0x80, 1];
        assert_eq!(answer_of(&mut Nothing, request), expected);
        assert_eq!(answer_of(&mut { Tables::NONE }, request), expected);
    }
    assert_eq!(answer_of(&mut Nothing, &[0x2B, 0x0E, 1, 0]), [0xAB, 1]);
}

#[test]
fn requests_that_the_standard_does_not_allow_never_reach_the_device() {
    let wrong: [&[u8]; 14] = [
        &[1, 0, 7, 0, 0],
        &[1, 0, 7, 7, 0xD1],
        &[3, 0, 7, 0, 126],
        &[3, 0, 7, 0],
        &[5, 0, 7, 1, 0],
        &[6, 0, 7, 1],
        &[15, 0, 7, 0, 3, 2, 5],
        &[16, 0, 7, 0, 2, 2, 0, 1],
        &[20, 7, 6, 0, 4, 0, 1, 0],
        &[21, 9, 6, 0, 4, 0, 7, 0, 2, 1, 2],
        &[22, 0, 7, 0xFF],
        &[23, 0, 7, 0, 1, 0, 7, 0, 2, 2, 0, 1],
        &[24, 0],
        &[17, 0],
    ];
    for request in wrong {
        let mut device = Everything::default();
        assert_eq!(
            answer_of(&mut device, request),
            [request[0] | 0x80, 3],
            "{request:?}"
        );
        assert!(device.calls.is_empty());
    }
    for request in [&[1, 0xFF, 0xFF, 0, 2], &[3, 0xFF, 0xFF, 0, 2]] {
        let mut device = Everything::default();
        assert_eq!(answer_of(&mut device, request), [request[0] | 0x80, 2]);
        assert!(device.calls.is_empty());
    }
}

#[test]
fn a_device_that_claims_more_than_there_is_fails_and_does_not_panic() {
    struct Liar;
    impl Device for Liar {
        fn report_server_id(&mut self, _: &mut [u8]) -> Result<usize, Exception> {
            Ok(usize::MAX)
        }
        fn custom(&mut self, _: u8, _: &[u8], _: &mut [u8]) -> Result<usize, Exception> {
            Ok(usize::MAX)
        }
        fn read_fifo_queue(&mut self, _: u16, _: &mut [u16; 31]) -> Result<usize, Exception> {
            Ok(32)
        }
    }
    assert_eq!(answer_of(&mut Liar, &[17]), [0x91, 4]);
    assert_eq!(answer_of(&mut Liar, &[0x41]), [0xC1, 4]);
    assert_eq!(answer_of(&mut Liar, &[24, 0, 2]), [0x98, 3]);
}

#[test]
fn a_write_before_a_read_that_is_refused_is_not_carried_out() {
    let mut tables = Tables::NONE.with_holding_registers(0, [1, 2, 3]);
    let request = [23, 0, 2, 0, 2, 0, 0, 0, 1, 2, 0, 9];
    assert_eq!(answer_of(&mut tables, &request), [0x97, 2]);
    assert_eq!(tables.holding_registers.cells, [1, 2, 3]);
    let request = [23, 0, 0, 0, 2, 0, 0, 0, 1, 2, 0, 9];
    assert_eq!(answer_of(&mut tables, &request), [23, 4, 0, 9, 0, 2]);
}

#[test]
fn a_broadcast_is_for_every_unit_and_other_requests_for_one() {
    let tables = Tables::NONE.with_holding_registers(0, [0; 2]);
    let mut units = [Unit::new(17, tables), Unit::new(18, tables)];
    units[1].diagnostics = Some(Diagnostics::NEW);
    let mut send = |unit, pdu: &[u8]| {
        let mut frame = [0; 256];
        let emitted = Framing::Rtu.emit(&mut frame, 0, unit, END, |place| {
            place[..pdu.len()].copy_from_slice(pdu);
            Ok(pdu.len())
        });
        let length = respond(Framing::Rtu, END, &mut frame, emitted.unwrap(), &mut units).unwrap();
        let registers = [0, 1].map(|at: usize| units[at].device.holding_registers.cells[0]);
        (frame[..length.saturating_sub(2)].to_vec(), registers)
    };
    assert_eq!(send(0, &[6, 0, 0, 0, 5]), (vec![], [5, 5]));
    assert_eq!(
        send(17, &[6, 0, 0, 0, 6]),
        (vec![17, 6, 0, 0, 0, 6], [6, 5])
    );
    assert_eq!(send(19, &[6, 0, 0, 0, 7]), (vec![], [6, 5]));
    // Unit 18 has counted these three, of which one was for it.
    assert_eq!(send(18, &[8, 0, 0x0B, 0, 0]).0, [18, 8, 0, 0x0B, 0, 4]);
    assert_eq!(send(18, &[8, 0, 0x0E, 0, 0]).0, [18, 8, 0, 0x0E, 0, 3]);
    assert_eq!(send(17, &[8, 0, 0x0B, 0, 0]).0, [17, 0x88, 1]);
    assert!(units.has(18) && units.has(0) && !units.has(19));
}

/// A port that says nothing.
#[derive(Clone, Debug)]
struct Silent;

impl Port for Silent {
    fn read(&mut self, _: &mut [u8]) -> Result<usize, Error> {
        Ok(0)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        0
    }
}

#[test]
fn a_constant_server_is_that_of_its_framing() {
    const RTU: Server<Silent, [u8; 256]> = Server::rtu(Silent);
    const OVER_TCP: Server<Silent, [u8; 256]> = Server::rtu_over_tcp(Silent);
    const ASCII: Server<Silent, [u8; 513]> = Server::ascii(Silent);
    const TCP: Server<Silent, [u8; 260]> = Server::tcp(Silent);
    // The addresses of functions are not compared.
    let text = |server: String| server.split("receive: ").next().unwrap().to_owned();
    let same = |constant: String, begun: String| assert_eq!(text(constant), text(begun));
    let with = |framing| Server::with_framing(framing, Silent, [0; 256]);
    same(format!("{RTU:?}"), format!("{:?}", with(Framing::Rtu)));
    same(
        format!("{OVER_TCP:?}"),
        format!("{:?}", with(Framing::RtuOverTcp)),
    );
    let ascii = Server::with_framing(Framing::Ascii, Silent, [0; 513]);
    same(format!("{ASCII:?}"), format!("{ascii:?}"));
    let tcp = Server::with_framing(Framing::Tcp, Silent, [0; 260]);
    same(format!("{TCP:?}"), format!("{tcp:?}"));
    assert!(RTU.is_rtu_line() && !OVER_TCP.is_rtu_line());
}

#[test]
fn a_server_and_its_units_can_be_sent_to_another_thread_and_be_a_static() {
    use std::sync::Mutex;
    type Four = Tables<[bool; 0], [bool; 0], [u16; 4], [u16; 0]>;
    const TABLES: Four = Tables {
        coils: Table::new(0, []),
        discrete_inputs: Table::new(0, []),
        holding_registers: Table::new(107, [555, 100, 0, 0]),
        input_registers: Table::new(0, []),
    };
    static SERVER: Mutex<Server<Silent, [u8; 260]>> = Mutex::new(Server::tcp(Silent));
    static UNIT_17: Mutex<Unit<Four>> = Mutex::new(Unit::new(17, TABLES));
    let serve = || {
        let served = SERVER
            .lock()
            .unwrap()
            .serve(0, &mut *UNIT_17.lock().unwrap());
        assert_eq!(served, Ok(()));
    };
    std::thread::scope(|scope| scope.spawn(serve).join().unwrap());
    fn is_send<T: Send>(_: &T) {}
    let mut pump = Everything::default();
    let borrowed: &mut (dyn Device + Send) = &mut pump;
    is_send(&Unit::new(17, borrowed));
}

//! The client whose calls wait: the bytes that each function sends, and what it takes from the
//! response. The requests of the same names send the same bytes.

use mbm::client::{
    BlockingClient, Client, CommEventCounter, Frame, ReadRecords, Request, Serial, Tcp, TcpBuffers,
    WriteRecords,
};
use mbm::pdu::custom::Rule;
use mbm::pdu::identification::DeviceIdCode;
use mbm::port::Port;
use mbm::Error;
use std::collections::VecDeque;

const UNIT: u8 = 17;

/// A TCP connection to a device that answers each request with the next of these PDUs.
#[derive(Default)]
struct Device {
    answers: VecDeque<Vec<u8>>,
    requests: Vec<Vec<u8>>,
    arriving: Vec<u8>,
    now: u32,
    idled: u32,
}

impl Device {
    fn answering(answers: impl IntoIterator<Item = Vec<u8>>) -> Device {
        Device {
            answers: answers.into_iter().collect(),
            ..Device::default()
        }
    }
}

impl Port for Device {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        let count = bytes.len().min(self.arriving.len());
        bytes[..count].copy_from_slice(&self.arriving[..count]);
        self.arriving.drain(..count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        assert_eq!(bytes[6], UNIT);
        self.requests.push(bytes[7..].to_vec());
        if let Some(pdu) = self.answers.pop_front() {
            let length = [0, pdu.len() as u8 + 1];
            self.arriving = [&bytes[..4], &length, &[UNIT], &pdu].concat();
        }
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now += 100;
        self.now
    }

    fn idle(&mut self, micros: u32) {
        self.idled += 1;
        self.now += micros;
    }
}

type TcpClient = BlockingClient<Tcp<Device, TcpBuffers<[u8; 260], [u8; 260]>>>;

/// Calls a function of a client whose device answers with these PDUs. Returns its result, and checks
/// that it has sent `requests`, and that a queued request of that name sends the first of them.
fn call<T>(
    requests: &[&[u8]],
    answers: &[&[u8]],
    request: Result<Request, Error>,
    function: impl FnOnce(&mut TcpClient) -> Result<T, Error>,
) -> T {
    let device = Device::answering(answers.iter().map(|answer| answer.to_vec()));
    let mut client = BlockingClient::tcp(device);
    let result = function(&mut client).expect("an answer");
    assert_eq!(client.port().requests, requests);
    let buffers = TcpBuffers::new([0; 260], [0; 260]);
    let mut queue: Client<_, _, 1> = Client::new(Tcp::new(Device::default(), buffers));
    queue.queue(request.expect("a request")).expect("space");
    assert!(queue.poll(0).is_none());
    assert_eq!(queue.port().requests, requests[..1]);
    result
}

/// The queued request of function 1 or 2.
fn request_of_bits(function: u8, bits: &mut [bool]) -> Result<Request<'_>, Error> {
    match function {
        1 => Request::read_coils(UNIT, 7, bits),
        _ => Request::read_discrete_inputs(UNIT, 7, bits),
    }
}

/// The queued request of function 3 or 4.
fn request_of_registers(function: u8, words: &mut [u16]) -> Result<Request<'_>, Error> {
    match function {
        3 => Request::read_holding_registers(UNIT, 107, words),
        _ => Request::read_input_registers(UNIT, 107, words),
    }
}

#[test]
fn reads_of_the_four_tables_fill_slices_and_arrays() {
    let (mut bits, mut words) = ([false; 10], [0; 2]);
    for function in [1, 2] {
        let (sent, answer): (&[u8], &[u8]) = (&[function, 0, 7, 0, 10], &[function, 2, 0x41, 2]);
        let request = request_of_bits(function, &mut bits);
        let mut read = [true; 10];
        call(&[sent], &[answer], request, |client| match function {
            1 => client.read_coils(UNIT, 7, &mut read),
            _ => client.read_discrete_inputs(UNIT, 7, &mut read),
        });
        let expected: [bool; 10] = std::array::from_fn(|at| [0, 6, 9].contains(&at));
        assert_eq!(read, expected);
        let request = request_of_bits(function, &mut bits);
        let array: [bool; 10] = call(&[sent], &[answer], request, |client| match function {
            1 => client.coils(UNIT, 7),
            _ => client.discrete_inputs(UNIT, 7),
        });
        assert_eq!(array, read);
    }
    for function in [3, 4] {
        let (sent, answer): (&[u8], &[u8]) =
            (&[function, 0, 107, 0, 2], &[function, 4, 2, 43, 0, 100]);
        let mut read = [0; 2];
        let request = request_of_registers(function, &mut words);
        call(&[sent], &[answer], request, |client| match function {
            3 => client.read_holding_registers(UNIT, 107, &mut read),
            _ => client.read_input_registers(UNIT, 107, &mut read),
        });
        assert_eq!(read, [555, 100]);
        let request = request_of_registers(function, &mut words);
        let [first, second] = call(&[sent], &[answer], request, |client| match function {
            3 => client.holding_registers(UNIT, 107),
            _ => client.input_registers(UNIT, 107),
        });
        assert_eq!([first, second], [555, 100]);
    }
}

#[test]
fn writes_send_what_the_caller_has() {
    let on = Request::write_single_coil(UNIT, 3, true);
    let echo: &[u8] = &[5, 0, 3, 0xFF, 0];
    call(&[echo], &[echo], on, |client| {
        client.write_single_coil(UNIT, 3, true)
    });
    let echo: &[u8] = &[6, 0, 3, 3, 0x78];
    let one = Request::write_single_register(UNIT, 3, 888);
    call(&[echo], &[echo], one, |client| {
        client.write_single_register(UNIT, 3, 888)
    });
    let coils = [true, false, true, false, false, false, false, false, true];
    let sent: &[u8] = &[15, 0, 3, 0, 9, 2, 5, 1];
    call(
        &[sent],
        &[&sent[..5]],
        Request::write_multiple_coils(UNIT, 3, &mut coils.clone()),
        |client| client.write_multiple_coils(UNIT, 3, &coils),
    );
    let sent: &[u8] = &[16, 0, 3, 0, 2, 4, 1, 2, 3, 4];
    let words = &mut [0x0102, 0x0304];
    call(
        &[sent],
        &[&sent[..5]],
        Request::write_multiple_registers(UNIT, 3, words),
        |client| client.write_multiple_registers(UNIT, 3, &[0x0102, 0x0304]),
    );
    let echo: &[u8] = &[0x16, 0, 4, 0, 0xF2, 0, 0x25];
    call(
        &[echo],
        &[echo],
        Request::mask_write_register(UNIT, 4, 0xF2, 0x25),
        |client| client.mask_write_register(UNIT, 4, 0xF2, 0x25),
    );
    let sent: &[u8] = &[0x17, 0, 3, 0, 2, 0, 14, 0, 1, 2, 0, 0xFF];
    let (mut read, mut queued, mut write) = ([0; 2], [0; 2], [0xFF]);
    let request = Request::read_write_multiple_registers(UNIT, (3, &mut queued), (14, &mut write));
    call(&[sent], &[&[0x17, 4, 0, 1, 0, 2]], request, |client| {
        client.read_write_multiple_registers(UNIT, (3, &mut read), (14, &[0xFF]))
    });
    assert_eq!(read, [1, 2]);
}

#[test]
fn the_functions_of_the_line_return_what_they_read() {
    let request_outputs = &mut [0];
    let outputs = call(
        &[&[7]],
        &[&[7, 0x6D]],
        Request::read_exception_status(UNIT, request_outputs),
        |client| client.read_exception_status(UNIT),
    );
    assert_eq!(outputs, 0x6D);
    let (mut data, mut queued, mut echo) = ([0xA537, 1], [0xA537, 1], [0; 2]);
    let sent: &[u8] = &[8, 0, 0, 0xA5, 0x37, 0, 1];
    call(
        &[sent],
        &[sent],
        Request::diagnostics(UNIT, 0, &mut queued, &mut echo),
        |client| client.diagnostics(UNIT, 0, &mut data),
    );
    assert_eq!(data, [0xA537, 1]);
    let (mut data, mut queued, mut count) = ([0], [0], [0]);
    let sent: &[u8] = &[8, 0, 0x0B, 0, 0];
    call(
        &[sent],
        &[&[8, 0, 0x0B, 1, 2]],
        Request::diagnostics(UNIT, 0x0B, &mut queued, &mut count),
        |client| client.diagnostics(UNIT, 0x0B, &mut data),
    );
    assert_eq!(data, [0x0102]);
    let counter = call(
        &[&[11]],
        &[&[11, 0xFF, 0xFF, 1, 8]],
        Request::get_comm_event_counter(UNIT, &mut [0; 2]),
        |client| client.get_comm_event_counter(UNIT),
    );
    assert_eq!(
        counter,
        CommEventCounter {
            status: 0xFFFF,
            events: 0x0108
        }
    );
    let (mut place, mut queued) = ([0; 70], [0; 70]);
    let log = call(
        &[&[12]],
        &[&[12, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0]],
        Request::get_comm_event_log(UNIT, &mut queued),
        |client| client.get_comm_event_log(UNIT, &mut place),
    );
    assert_eq!(
        (log.status, log.events, log.messages, log.log),
        (0, 0x0108, 0x0121, &[0x20, 0][..])
    );
    let (mut place, mut queued) = ([0; 20], [0; 20]);
    let id = call(
        &[&[17]],
        &[&[17, 3, 7, 8, 0xFF]],
        Request::report_server_id(UNIT, &mut queued),
        |client| client.report_server_id(UNIT, &mut place),
    );
    assert_eq!(id, [7, 8, 0xFF]);
}

#[test]
fn records_of_one_range_and_of_several_are_slices() {
    let (mut records, mut queued) = ([0; 2], [0; 2]);
    let sent: &[u8] = &[20, 7, 6, 0, 4, 0, 1, 0, 2];
    let answer: &[u8] = &[20, 6, 5, 6, 0x0D, 0xFE, 0, 0x20];
    call(
        &[sent],
        &[answer],
        Request::read_file_record(UNIT, 4, 1, &mut queued),
        |client| client.read_file_record(UNIT, 4, 1, &mut records),
    );
    assert_eq!(records, [0x0DFE, 0x20]);
    let echo: &[u8] = &[21, 11, 6, 0, 4, 0, 7, 0, 2, 6, 0xAF, 4, 0xBE];
    call(
        &[echo],
        &[echo],
        Request::write_file_record(UNIT, 4, 7, &mut [0x06AF, 0x04BE]),
        |client| client.write_file_record(UNIT, 4, 7, &[0x06AF, 0x04BE]),
    );
    let sent: &[u8] = &[20, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1];
    let answer: &[u8] = &[20, 10, 5, 6, 0x0D, 0xFE, 0, 0x20, 3, 6, 0x33, 0xCD];
    let (mut first, mut second) = ([0; 2], [0; 1]);
    let (mut groups, mut place) = (sent[2..].to_vec(), [0; 20]);
    call(
        &[sent],
        &[answer],
        Request::read_file_records(UNIT, &mut groups, &mut place),
        |client| {
            client.read_file_records(
                UNIT,
                &mut [
                    ReadRecords {
                        file: 4,
                        record: 1,
                        records: &mut first,
                    },
                    ReadRecords {
                        file: 3,
                        record: 9,
                        records: &mut second,
                    },
                ],
            )
        },
    );
    assert_eq!((first, second), ([0x0DFE, 0x20], [0x33CD]));
    let echo: &[u8] = &[21, 18, 6, 0, 4, 0, 7, 0, 1, 1, 2, 6, 0, 3, 0, 9, 0, 1, 3, 4];
    let mut groups = echo[2..].to_vec();
    call(
        &[echo],
        &[echo],
        Request::write_file_records(UNIT, &mut groups),
        |client| {
            client.write_file_records(
                UNIT,
                &[
                    WriteRecords {
                        file: 4,
                        record: 7,
                        records: &[0x0102],
                    },
                    WriteRecords {
                        file: 3,
                        record: 9,
                        records: &[0x0304],
                    },
                ],
            )
        },
    );
    let (mut place, mut queued) = ([0; 31], [0; 31]);
    let answer: &[u8] = &[24, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84];
    let queue = call(
        &[&[24, 4, 0xDE]],
        &[answer],
        Request::read_fifo_queue(UNIT, 0x04DE, &mut queued),
        |client| client.read_fifo_queue(UNIT, 0x04DE, &mut place),
    );
    assert_eq!(queue, [0x01B8, 0x1284]);
}

#[test]
fn objects_that_identify_a_device_are_read_by_one_request_and_by_many() {
    let first: &[u8] = &[43, 14, 1, 1, 0xFF, 2, 2, 0, 2, b'M', b'B', 1, 1, b'P'];
    let last: &[u8] = &[43, 14, 1, 1, 0, 0, 1, 2, 2, b'V', b'2'];
    let sent: &[u8] = &[43, 14, 1, 0];
    let (mut place, mut queued) = ([0; 250], [0; 250]);
    let basic = DeviceIdCode::Basic;
    let request = Request::read_device_identification(UNIT, basic, 0, &mut queued);
    let reply = call(&[sent], &[first], request, |client| {
        client.read_device_identification(UNIT, basic, 0, &mut place)
    });
    assert!(reply.more_follows);
    assert_eq!(reply.next_object, 2);
    let objects: Vec<_> = reply.objects.iter().collect();
    assert_eq!(objects, [(0, &b"MB"[..]), (1, &b"P"[..])]);
    let mut all = vec![];
    let request = Request::read_device_identification(UNIT, basic, 0, &mut queued);
    call(
        &[sent, &[43, 14, 1, 2]],
        &[first, last],
        request,
        |client| client.identify(UNIT, basic, |id, value| all.push((id, value.to_vec()))),
    );
    assert_eq!(
        all,
        [(0, b"MB".to_vec()), (1, b"P".to_vec()), (2, b"V2".to_vec())]
    );
    let device = Device::answering([first, first].map(<[u8]>::to_vec));
    let repeats = BlockingClient::tcp(device).identify(UNIT, basic, |_, _| {});
    assert_eq!(repeats, Err(Error::NoProgress));
}

#[test]
fn other_functions_take_bytes_and_return_those_of_the_response() {
    let (mut place, mut queued) = ([0; 20], [0; 20]);
    let request = Request::encapsulated_interface_transport(UNIT, 0x0D, &mut [], &mut place);
    let reply = call(&[&[43, 13]], &[&[43, 13, 9, 8]], request, |client| {
        client.encapsulated_interface_transport(UNIT, 0x0D, &[], &mut queued)
    });
    assert_eq!(reply, [9, 8]);
    let mut data = [3, 7, 8, 9];
    let (sent, answer): (&[u8], &[u8]) = (&[0x41, 3, 7, 8, 9], &[0x41, 3, 9, 8, 7]);
    let (mut place, mut queued) = ([0; 20], [0; 20]);
    let rule = Rule::Counted(1, 0);
    let request = Request::custom(UNIT, 0x41, &mut data, rule, &mut queued);
    let reply = call(&[sent], &[answer], request, |client| {
        client.custom(UNIT, 0x41, &[3, 7, 8, 9], rule, &mut place)
    });
    assert_eq!(reply, [3, 9, 8, 7]);
    let (mut body, mut place, mut queued) = ([0, 107, 0, 1, 2, 1, 2], [0; 20], [0; 20]);
    let sent: &[u8] = &[16, 0, 107, 0, 1, 2, 1, 2];
    let request = Request::forward(UNIT, 16, &mut body, &mut queued);
    let reply = call(&[sent], &[&sent[..5]], request, |client| {
        client.forward(UNIT, 16, &sent[1..], &mut place)
    });
    assert_eq!(reply, [0, 107, 0, 1]);
}

#[test]
fn what_no_device_could_answer_is_refused_before_it_is_sent() {
    let mut client = BlockingClient::tcp(Device::default());
    let (mut words, mut bytes) = ([0; 300], [0; 300]);
    let mut refused: Vec<(Result<(), Error>, Error)> = vec![
        (
            client.read_holding_registers(UNIT, 0, &mut []),
            Error::InvalidQuantity,
        ),
        (
            client.read_holding_registers(UNIT, 0, &mut words[..126]),
            Error::InvalidQuantity,
        ),
        (
            client.write_multiple_registers(UNIT, 0, &[0; 70_000]),
            Error::InvalidQuantity,
        ),
        (
            client.read_input_registers(UNIT, 0xFFFF, &mut words[..2]),
            Error::InvalidAddress,
        ),
        (
            client.read_coils(UNIT, 0, &mut [false; 2001]),
            Error::InvalidQuantity,
        ),
        (
            client.write_multiple_coils(UNIT, 0, &[]),
            Error::InvalidQuantity,
        ),
        (
            client.diagnostics(UNIT, 0, &mut words[..126]),
            Error::InvalidQuantity,
        ),
        (
            client.diagnostics(UNIT, 1, &mut words[..2]),
            Error::InvalidQuantity,
        ),
        (
            client.read_file_record(UNIT, 0, 1, &mut words[..1]),
            Error::InvalidAddress,
        ),
        (
            client.read_file_record(UNIT, 1, 9999, &mut words[..2]),
            Error::InvalidAddress,
        ),
        (
            client.read_file_record(UNIT, 1, 1, &mut words[..122]),
            Error::InvalidQuantity,
        ),
        (
            client.read_file_records(UNIT, &mut []),
            Error::InvalidQuantity,
        ),
        (client.write_file_records(UNIT, &[]), Error::InvalidQuantity),
        (
            client.forward(UNIT, 0x83, &[], &mut bytes).map(drop),
            Error::InvalidArgument,
        ),
        (
            client.forward(UNIT, 3, &[0; 260], &mut bytes).map(drop),
            Error::InvalidQuantity,
        ),
    ];
    let many = || WriteRecords {
        file: 1,
        record: 1,
        records: &[0; 100],
    };
    refused.push((
        client.write_file_records(UNIT, &[many(), many()]),
        Error::InvalidQuantity,
    ));
    let mut long = [[0; 61]; 2];
    let groups = long.iter_mut().map(|records| ReadRecords {
        file: 1,
        record: 1,
        records,
    });
    let mut groups: Vec<_> = groups.collect();
    refused.push((
        client.read_file_records(UNIT, &mut groups),
        Error::InvalidQuantity,
    ));
    for function in [0, 0x80, 0xFF] {
        let custom = client.custom(UNIT, function, &[], Rule::Silence, &mut bytes);
        refused.push((custom.map(drop), Error::InvalidArgument));
    }
    let long = client.custom(UNIT, 0x41, &[0; 253], Rule::Silence, &mut bytes);
    refused.push((long.map(drop), Error::InvalidQuantity));
    for (at, (result, expected)) in refused.into_iter().enumerate() {
        assert_eq!(result, Err(expected), "{at}");
    }
    assert!(client.port().requests.is_empty());
}

#[test]
fn an_exception_and_a_device_that_is_silent_are_errors() {
    let device = Device::answering([vec![0x83, 2], vec![0x83, 0x40]]);
    let mut client = BlockingClient::tcp(device);
    let read = client.holding_registers::<2>(UNIT, 107);
    assert_eq!(read, Err(Error::IllegalDataAddress));
    let read = client.holding_registers::<2>(UNIT, 107);
    assert_eq!(
        read.unwrap_err().exception(),
        Some(mbm::Exception::Other(0x40))
    );
    let read = client.holding_registers::<2>(UNIT, 107);
    assert_eq!(read, Err(Error::ResponseTimedOut));
    assert_eq!(client.unanswered(), 1);
    assert!(client.port().idled > 0);
    client.port().answers = [vec![3, 2, 0, 9]].into();
    assert_eq!(client.holding_registers(UNIT, 107), Ok([9]));
}

#[test]
fn a_place_that_is_too_small_is_an_error_and_the_next_call_is_answered() {
    let device = Device::answering([vec![17, 3, 7, 8, 0xFF], vec![17, 3, 7, 8, 0xFF]]);
    let mut client = BlockingClient::tcp(device);
    let mut place = [0; 3];
    let short = client.report_server_id(UNIT, &mut place[..2]);
    assert_eq!(short, Err(Error::BufferTooSmall));
    assert_eq!(
        client.report_server_id(UNIT, &mut place),
        Ok(&[7, 8, 0xFF][..])
    );
}

#[test]
fn a_client_with_a_small_place_refuses_what_it_does_not_hold() {
    let line = Tcp::new(Device::default(), TcpBuffers::new([0; 260], [0; 260]));
    let mut client: BlockingClient<_, 8> = BlockingClient::new(line);
    let read = client.holding_registers::<5>(UNIT, 107);
    assert_eq!(read, Err(Error::BufferTooSmall));
    let write = client.write_multiple_registers(UNIT, 107, &[0; 5]);
    assert_eq!(write, Err(Error::BufferTooSmall));
    assert!(client.port().requests.is_empty());
    client.port().answers = [vec![3, 8, 0, 1, 0, 2, 0, 3, 0, 4]].into();
    assert_eq!(client.holding_registers(UNIT, 107), Ok([1, 2, 3, 4]));
}

#[test]
fn a_client_of_every_framing_can_be_a_static_and_go_to_another_thread() {
    use std::sync::Mutex;
    struct Silent;
    impl Port for Silent {
        fn read(&mut self, _: &mut [u8]) -> Result<usize, Error> {
            Err(Error::LinkLost)
        }
        fn write(&mut self, _: &[u8]) -> Result<usize, Error> {
            Err(Error::LinkLost)
        }
        fn micros(&mut self) -> u32 {
            0
        }
    }
    type Line<const N: usize> = Serial<Silent, Frame<[u8; N]>, mbm::client::Call>;
    type OnTcp = Tcp<Silent, TcpBuffers<[u8; 260], [u8; 260]>>;
    static RTU: Mutex<BlockingClient<Line<256>>> = Mutex::new(BlockingClient::rtu(Silent));
    static ASCII: Mutex<BlockingClient<Line<513>>> = Mutex::new(BlockingClient::ascii(Silent));
    static TCP: Mutex<BlockingClient<OnTcp>> = Mutex::new(BlockingClient::tcp(Silent));
    static OVER_TCP: Mutex<BlockingClient<Line<256>>> =
        Mutex::new(BlockingClient::rtu_over_tcp(Silent));
    let lost = Err(Error::LinkLost);
    let read = || {
        assert_eq!(RTU.lock().unwrap().coils::<1>(1, 0), lost);
        assert_eq!(ASCII.lock().unwrap().coils::<1>(1, 0), lost);
        assert_eq!(TCP.lock().unwrap().coils::<1>(1, 0), lost);
        assert_eq!(OVER_TCP.lock().unwrap().coils::<1>(1, 0), lost);
    };
    std::thread::scope(|scope| scope.spawn(read).join().unwrap());
}

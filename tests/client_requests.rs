//! The client's ready-made requests, whose data are slices.

mod common;

use common::uart::{Bench, Wire};
use mbm::client::{Client, Frame, Request, Serial};
use mbm::error::Error;
use mbm::port::Port;
use std::cell::RefCell;
use std::rc::Rc;

struct Uart(Rc<RefCell<Wire>>);

impl Port for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        Ok(self.0.borrow_mut().receive(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        Ok(self.0.borrow_mut().send(bytes))
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }

    fn flush(&mut self) -> bool {
        self.0.borrow().is_flushed()
    }

    fn pre_transmission(&mut self) {
        self.0.borrow_mut().driver = true;
    }

    fn post_transmission(&mut self) {
        self.0.borrow_mut().driver = false;
    }
}

type Rtu<'a> = Client<Serial<Uart, Frame<[u8; 256]>, Request<'a>>, Request<'a>, 4>;

fn client<'a>(bench: &Bench) -> Rtu<'a> {
    let uart = Uart(bench.wire.clone());
    let mut client = Client::new(Serial::new(uart, Frame::new([0; 256])));
    client.settings().set_baud_rate(115_200);
    client
}

/// Queues a request and polls until the client returns it.
fn run<'a>(bench: &mut Bench, client: &mut Rtu<'a>, request: Request<'a>) -> Request<'a> {
    assert!(client.queue(request).is_ok());
    for _ in 0..100_000 {
        bench.pass();
        let now = bench.wire.borrow().now;
        if let Some(request) = client.poll(now) {
            return request;
        }
    }
    panic!("the request does not end");
}

/// Makes one request.
fn ask<'a>(bench: &mut Bench, request: Result<Request<'a>, Error>) -> Request<'a> {
    let mut client = client(bench);
    let ended = run(bench, &mut client, request.unwrap());
    assert_eq!(ended.result(), Ok(()));
    ended
}

#[test]
fn registers_and_bits_are_read_into_slices() {
    let mut bench = Bench::new();
    let mut words = [0; 3];
    let ended = ask(
        &mut bench,
        Request::read_holding_registers(17, 102, &mut words),
    );
    assert_eq!(ended.registers(), [0x1002, 0x1003, 0x1004]);
    assert!(ended.coils().is_empty() && ended.bytes().is_empty());
    let ended = ask(
        &mut bench,
        Request::read_input_registers(17, 102, &mut words),
    );
    assert_eq!(ended.registers(), [0x2002, 0x2003, 0x2004]);
    let mut coils = [false; 11];
    let ended = ask(&mut bench, Request::read_coils(17, 100, &mut coils));
    let expected: Vec<bool> = (0..11).map(|bit| 0b10_0100_1001 >> bit & 1 != 0).collect();
    assert_eq!(ended.coils(), expected);
    assert!(ended.registers().is_empty() && ended.bytes().is_empty());
    let mut inputs = [false; 4];
    let ended = ask(
        &mut bench,
        Request::read_discrete_inputs(17, 116, &mut inputs),
    );
    assert_eq!(ended.coils(), [true, true, false, true]);
}

#[test]
fn slices_are_written() {
    let mut bench = Bench::new();
    ask(&mut bench, Request::write_single_coil(17, 101, true));
    assert_eq!(bench.device.coils[0], 0b0100_1011);
    ask(&mut bench, Request::write_single_register(17, 100, 7));
    let mut coils = [false, true, true, false, true, true, true, true, true];
    ask(
        &mut bench,
        Request::write_multiple_coils(17, 100, &mut coils),
    );
    assert_eq!(bench.device.coils[..2], [0b1111_0110, 0b1001_0011]);
    ask(
        &mut bench,
        Request::write_multiple_registers(17, 101, &mut [8, 9]),
    );
    assert_eq!(bench.device.holding[..3], [7, 8, 9]);
    ask(
        &mut bench,
        Request::mask_write_register(17, 103, 0xFF00, 0x0055),
    );
    assert_eq!(bench.device.holding[3], 0x1055);
    let (mut read, mut write) = ([0; 2], [0xABCD]);
    let both = Request::read_write_multiple_registers(17, (103, &mut read), (104, &mut write));
    let ended = ask(&mut bench, both);
    assert_eq!(ended.registers(), [0x1055, 0xABCD]);
}

#[test]
fn a_request_that_was_returned_is_queued_again_with_other_values() {
    let mut bench = Bench::new();
    let mut words = [1, 2];
    let mut coils = [true];
    let mut client = client(&bench);
    let write = Request::write_multiple_registers(17, 100, &mut words).unwrap();
    let mut write = run(&mut bench, &mut client, write);
    write.registers_to_write().copy_from_slice(&[3, 4]);
    let write = run(&mut bench, &mut client, write);
    assert_eq!(write.result(), Ok(()));
    assert_eq!(bench.device.holding[..2], [3, 4]);
    let write = Request::write_multiple_coils(17, 100, &mut coils).unwrap();
    let mut write = run(&mut bench, &mut client, write);
    assert_eq!(bench.device.coils[0] & 1, 1);
    write.coils_to_write()[0] = false;
    run(&mut bench, &mut client, write);
    assert_eq!(bench.device.coils[0] & 1, 0);
}

#[test]
fn a_request_that_failed_has_read_nothing() {
    let mut bench = Bench::new();
    let (mut words, mut coils) = ([1; 2], [true; 2]);
    let mut client = client(&bench);
    let read = Request::read_holding_registers(17, 109, &mut words).unwrap();
    let read = run(&mut bench, &mut client, read);
    assert_eq!(read.result(), Err(Error::IllegalDataAddress));
    assert!(read.registers().is_empty());
    let read = Request::read_coils(17, 119, &mut coils).unwrap();
    let read = run(&mut bench, &mut client, read);
    assert_eq!(read.result(), Err(Error::IllegalDataAddress));
    assert!(read.coils().is_empty());
}

#[test]
fn a_queue_and_the_words_of_a_query_arrive_in_slices() {
    let mut bench = Bench::new();
    let mut queue = [0; 31];
    let ended = ask(&mut bench, Request::read_fifo_queue(17, 0x04DE, &mut queue));
    assert_eq!(ended.registers(), [0x01B8, 0x1284]);
    let (mut data, mut echo) = ([0xA537], [0]);
    let query = Request::diagnostics(17, 0, &mut data, &mut echo);
    assert_eq!(ask(&mut bench, query).registers(), [0xA537]);
    let refused = Request::diagnostics(17, 0, &mut [1, 2], &mut [0]).err();
    assert_eq!(refused, Some(Error::BufferTooSmall));
}

#[test]
fn quantities_and_addresses_outside_the_standard_are_refused() {
    let value = Some(Error::InvalidQuantity);
    let address = Some(Error::InvalidAddress);
    let (mut words, mut bits) = (vec![0; 70_000], vec![false; 70_000]);
    for length in [0, 126, 70_000] {
        let words = &mut words[..length];
        assert_eq!(Request::read_holding_registers(1, 0, words).err(), value);
        assert_eq!(Request::read_input_registers(1, 0, words).err(), value);
        assert_eq!(Request::write_multiple_registers(1, 0, words).err(), value);
        let mut one = [1];
        let both = Request::read_write_multiple_registers(1, (0, words), (0, &mut one));
        assert_eq!(both.err(), value);
        let both = Request::read_write_multiple_registers(1, (0, &mut one), (0, words));
        assert_eq!(both.err(), value);
    }
    for length in [0, 2001, 70_000] {
        let bits = &mut bits[..length];
        assert_eq!(Request::read_coils(1, 0, bits).err(), value);
        assert_eq!(Request::read_discrete_inputs(1, 0, bits).err(), value);
        assert_eq!(Request::write_multiple_coils(1, 0, bits).err(), value);
    }
    let words = &mut words[..2];
    let read = Request::read_holding_registers(1, 0xFFFF, words);
    assert_eq!(read.err(), address);
}

#[test]
fn a_request_that_does_not_fit_into_the_queue_comes_back() {
    let bench = Bench::new();
    let mut client = client(&bench);
    for address in 0..4 {
        let write = Request::write_single_register(17, address, 1).unwrap();
        assert!(client.queue(write).is_ok());
    }
    let write = Request::write_single_register(17, 4, 1).unwrap();
    let refused = client.queue(write).unwrap_err();
    assert_eq!(format!("{refused:?}"), "Refused(QueueFull)");
    assert_eq!(refused.to_string(), "the queue is full");
    assert_eq!(refused.error(), Error::QueueFull);
    assert_eq!(refused.0.result(), Err(Error::QueueFull));
}

#[test]
fn the_question_mark_passes_on_why_a_request_is_refused() {
    fn no_coils(client: &mut Rtu) -> Result<(), Error> {
        client.queue(Request::read_coils(17, 1, &mut [])?)?;
        Ok(())
    }
    fn long_timeout(client: &mut Rtu) -> Result<(), Error> {
        let mut request = Request::write_single_coil(17, 1, true)?;
        request.state.timeout_ms = 1_000_001;
        client.queue(request)?;
        Ok(())
    }
    let bench = Bench::new();
    let mut client = client(&bench);
    assert_eq!(no_coils(&mut client), Err(Error::InvalidQuantity));
    assert_eq!(long_timeout(&mut client), Err(Error::InvalidArgument));
    assert_eq!(client.pending(), 0);
}

#[test]
fn polls_without_a_flag_return_all_requests_that_have_ended() {
    let mut bench = Bench::new();
    let mut client = client(&bench);
    let mut ended = 0;
    for round in 1..=3 {
        for register in 100..104 {
            let write = Request::write_single_register(17, register, round).unwrap();
            assert!(client.queue(write).is_ok());
        }
        for _ in 0..2_000 {
            bench.pass();
            let now = bench.wire.borrow().now;
            while let Some(request) = client.poll(now) {
                assert_eq!(request.result(), Ok(()));
                ended += 1;
            }
        }
        assert_eq!(ended, 4 * usize::from(round));
        assert_eq!(bench.device.holding[..4], [round; 4]);
    }
}

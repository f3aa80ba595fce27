//! A call that no device can answer is refused before anything is sent, on every client and master
//! whose calls wait or are futures. A quantity that is a part of the type does not compile: see the
//! examples at `BlockingClient::coils` and the like.

use mbm::client::{BlockingClient, ReadRecords, WriteRecords};
use mbm::master::{Buffers, Master};
use mbm::pdu::custom::Rule;
use mbm::pdu::identification::DeviceIdCode;
use mbm::server::{SimulatedPort, Tables, Unit};
use mbm::Error;

fn rtu() -> SimulatedPort<Unit<Tables>> {
    SimulatedPort::rtu(Unit::new(17, Tables::NONE))
}

/// What a call returned, and what it must return.
type Outcome = (&'static str, Result<(), Error>, Error);

macro_rules! call {
    ($client:ident, [], $name:ident $arguments:tt) => {
        $client.$name $arguments
    };
    ($client:ident, [await], $name:ident $arguments:tt) => {
        $client.$name $arguments.await
    };
}

/// The outcome of each call. `wait` is `[]`, or `[await]` if the calls are futures.
macro_rules! outcomes {
    ($client:ident, $wait:tt: $($name:ident $arguments:tt => $error:ident;)*) => {
        vec![$((
            concat!(stringify!($name), stringify!($arguments)),
            call!($client, $wait, $name $arguments).map(|_| ()),
            Error::$error,
        ),)*] as Vec<Outcome>
    };
}

macro_rules! calls_of_a_client {
    ($client:ident, $wait:tt) => {{
        let groups = || [7, 9].map(|record| WriteRecords { file: 4, record, records: &[1, 2] });
        outcomes! { $client, $wait:
            read_coils(17, 0, &mut []) => InvalidQuantity;
            read_coils(17, 0, &mut [false; 2001]) => InvalidQuantity;
            read_coils(17, 65535, &mut [false; 2]) => InvalidAddress;
            read_coils(0, 0, &mut [false; 2]) => BroadcastNotAllowed;
            read_discrete_inputs(17, 0, &mut []) => InvalidQuantity;
            read_discrete_inputs(17, 0, &mut [false; 2001]) => InvalidQuantity;
            read_discrete_inputs(17, 65535, &mut [false; 2]) => InvalidAddress;
            read_discrete_inputs(0, 0, &mut [false; 2]) => BroadcastNotAllowed;
            read_holding_registers(17, 0, &mut []) => InvalidQuantity;
            read_holding_registers(17, 0, &mut [0; 126]) => InvalidQuantity;
            read_holding_registers(17, 0, &mut [0; 65538]) => InvalidQuantity;
            read_holding_registers(17, 65535, &mut [0; 2]) => InvalidAddress;
            read_holding_registers(0, 0, &mut [0; 2]) => BroadcastNotAllowed;
            read_input_registers(17, 0, &mut []) => InvalidQuantity;
            read_input_registers(17, 0, &mut [0; 126]) => InvalidQuantity;
            read_input_registers(17, 65535, &mut [0; 2]) => InvalidAddress;
            read_input_registers(0, 0, &mut [0; 2]) => BroadcastNotAllowed;
            write_multiple_coils(17, 0, &[]) => InvalidQuantity;
            write_multiple_coils(17, 0, &[true; 1969]) => InvalidQuantity;
            write_multiple_coils(17, 65535, &[true; 2]) => InvalidAddress;
            write_multiple_registers(17, 0, &[]) => InvalidQuantity;
            write_multiple_registers(17, 0, &[1; 124]) => InvalidQuantity;
            write_multiple_registers(17, 0, &[1; 65537]) => InvalidQuantity;
            write_multiple_registers(17, 65535, &[1; 2]) => InvalidAddress;
            read_write_multiple_registers(17, (0, &mut []), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0; 126]), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0]), (0, &[])) => InvalidQuantity;
            read_write_multiple_registers(17, (0, &mut [0]), (0, &[1; 122])) => InvalidQuantity;
            read_write_multiple_registers(17, (65535, &mut [0; 2]), (0, &[1])) => InvalidAddress;
            read_write_multiple_registers(17, (0, &mut [0]), (65535, &[1; 2])) => InvalidAddress;
            read_write_multiple_registers(0, (0, &mut [0]), (0, &[1])) => BroadcastNotAllowed;
            read_exception_status(0) => BroadcastNotAllowed;
            diagnostics(17, 0, &mut []) => InvalidQuantity;
            diagnostics(17, 0, &mut [0; 126]) => InvalidQuantity;
            diagnostics(17, 1, &mut [0; 2]) => InvalidQuantity;
            get_comm_event_counter(0) => BroadcastNotAllowed;
            get_comm_event_log(0, &mut [0; 70]) => BroadcastNotAllowed;
            report_server_id(0, &mut [0; 250]) => BroadcastNotAllowed;
            read_file_record(17, 4, 0, &mut []) => InvalidQuantity;
            read_file_record(17, 4, 0, &mut [0; 122]) => InvalidQuantity;
            read_file_record(17, 0, 0, &mut [0]) => InvalidAddress;
            read_file_record(17, 4, 9999, &mut [0; 2]) => InvalidAddress;
            read_file_record(0, 4, 0, &mut [0]) => BroadcastNotAllowed;
            write_file_record(17, 4, 0, &[]) => InvalidQuantity;
            write_file_record(17, 4, 0, &[1; 123]) => InvalidQuantity;
            write_file_record(17, 0, 0, &[1]) => InvalidAddress;
            write_file_record(17, 4, 9999, &[1; 2]) => InvalidAddress;
            read_file_records(17, &mut []) => InvalidQuantity;
            read_file_records(17, &mut [ReadRecords { file: 4, record: 0, records: &mut [] }])
                => InvalidQuantity;
            read_file_records(17, &mut [ReadRecords { file: 0, record: 0, records: &mut [0] }])
                => InvalidAddress;
            read_file_records(17, &mut [ReadRecords { file: 4, record: 0, records: &mut [0; 122] }])
                => InvalidQuantity;
            write_file_records(17, &[]) => InvalidQuantity;
            write_file_records(17, &[WriteRecords { file: 4, record: 9999, records: &[1, 2] }])
                => InvalidAddress;
            write_file_records(17, &[groups(); 20].concat()) => InvalidQuantity;
            read_fifo_queue(0, 0, &mut [0; 31]) => BroadcastNotAllowed;
            read_device_identification(0, DeviceIdCode::Basic, 0, &mut [0; 250]) => BroadcastNotAllowed;
            identify(0, DeviceIdCode::Basic, |_, _| {}) => BroadcastNotAllowed;
            encapsulated_interface_transport(17, 0x0D, &[0; 252], &mut [0; 250]) => InvalidQuantity;
            custom(17, 0, &[], Rule::Silence, &mut [0; 250]) => InvalidArgument;
            custom(17, 128, &[], Rule::Silence, &mut [0; 250]) => InvalidArgument;
            custom(17, 65, &[0; 253], Rule::Silence, &mut [0; 250]) => InvalidQuantity;
            forward(17, 0, &[], &mut [0; 250]) => InvalidArgument;
            forward(17, 128, &[], &mut [0; 250]) => InvalidArgument;
            forward(17, 3, &[0, 107], &mut [0; 250]) => InvalidQuantity;
            forward(17, 3, &[0, 107, 0, 126], &mut [0; 250]) => InvalidQuantity;
            forward(17, 3, &[0xFF, 0xFF, 0, 2], &mut [0; 250]) => InvalidAddress;
            forward(17, 65, &[0; 300], &mut [0; 250]) => InvalidQuantity;
        }
    }};
}

macro_rules! calls_of_a_master {
    ($master:ident, $wait:tt) => {
        outcomes! { $master, $wait:
            read_coils(0, &mut []) => InvalidQuantity;
            read_coils(0, &mut [false; 2001]) => InvalidQuantity;
            read_coils(65535, &mut [false; 2]) => InvalidAddress;
            read_discrete_inputs(0, &mut []) => InvalidQuantity;
            read_discrete_inputs(0, &mut [false; 2001]) => InvalidQuantity;
            read_discrete_inputs(65535, &mut [false; 2]) => InvalidAddress;
            read_holding_registers(0, &mut []) => InvalidQuantity;
            read_holding_registers(0, &mut [0; 126]) => InvalidQuantity;
            read_holding_registers(0, &mut [0; 65538]) => InvalidQuantity;
            read_holding_registers(65535, &mut [0; 2]) => InvalidAddress;
            read_input_registers(0, &mut []) => InvalidQuantity;
            read_input_registers(0, &mut [0; 126]) => InvalidQuantity;
            read_input_registers(65535, &mut [0; 2]) => InvalidAddress;
            write_multiple_coils(0, &[]) => InvalidQuantity;
            write_multiple_coils(0, &[true; 1969]) => InvalidQuantity;
            write_multiple_coils(65535, &[true; 2]) => InvalidAddress;
            write_multiple_registers(0, &[]) => InvalidQuantity;
            write_multiple_registers(0, &[1; 124]) => InvalidQuantity;
            write_multiple_registers(65535, &[1; 2]) => InvalidAddress;
            read_write_multiple_registers((0, &mut []), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0; 126]), (0, &[1])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0]), (0, &[])) => InvalidQuantity;
            read_write_multiple_registers((0, &mut [0]), (0, &[1; 122])) => InvalidQuantity;
            read_write_multiple_registers((65535, &mut [0; 2]), (0, &[1])) => InvalidAddress;
            read_write_multiple_registers((0, &mut [0]), (65535, &[1; 2])) => InvalidAddress;
        }
    };
}

macro_rules! broadcasts_of_a_master {
    ($master:ident, $wait:tt) => {
        outcomes! { $master, $wait:
            read_coils(0, &mut [false]) => BroadcastNotAllowed;
            read_discrete_inputs(0, &mut [false]) => BroadcastNotAllowed;
            read_holding_registers(0, &mut [0]) => BroadcastNotAllowed;
            read_input_registers(0, &mut [0]) => BroadcastNotAllowed;
            read_write_multiple_registers((0, &mut [0]), (0, &[1])) => BroadcastNotAllowed;
        }
    };
}

/// Fails unless each call has its error, and the device has got no frame.
#[track_caller]
fn assert_refused(outcomes: Vec<Outcome>, frames: u32) {
    let wrong = |outcome: &Outcome| outcome.1 != Err(outcome.2);
    let wrong: Vec<Outcome> = outcomes.into_iter().filter(wrong).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(frames, 0);
}

fn buffers() -> Buffers<[u8; 255], [u16; 125], [u16; 123]> {
    Buffers::new([0; 255], [0; 125], [0; 123])
}

#[test]
fn a_client_that_waits_refuses_what_no_device_can_answer() {
    let mut client = BlockingClient::rtu(rtu());
    assert_refused(calls_of_a_client!(client, []), client.port().frames);
}

#[test]
fn a_client_with_little_memory_refuses_data_that_it_cannot_hold() {
    use mbm::client::{Frame, Serial};
    let line = Serial::new(rtu(), Frame::new([0; 50]));
    let mut client: BlockingClient<_, 40> = BlockingClient::new(line);
    let outcomes = outcomes! { client, []:
        read_coils(17, 0, &mut [false; 321]) => BufferTooSmall;
        read_holding_registers(17, 0, &mut [0; 21]) => BufferTooSmall;
        write_multiple_registers(17, 0, &[1; 21]) => BufferTooSmall;
        read_write_multiple_registers(17, (0, &mut [0; 21]), (0, &[1])) => BufferTooSmall;
        custom(17, 65, &[0; 41], Rule::Silence, &mut [0; 10]) => BufferTooSmall;
    };
    assert_refused(outcomes, client.port().frames);
}

#[test]
fn a_master_that_waits_refuses_what_no_device_can_answer() {
    let mut master = Master::new(17, rtu(), buffers());
    assert_refused(calls_of_a_master!(master, []), master.port().frames);
    master.set_unit(0);
    assert_refused(broadcasts_of_a_master!(master, []), master.port().frames);
}

#[cfg(feature = "embedded-io-async")]
mod futures {
    use super::*;
    use mbm::client::AsyncClient;
    use mbm::master::AsyncMaster;
    use mbm::port::AsyncIo;
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    /// A timer that has always run out already.
    struct NoDelay;

    impl embedded_hal_async::delay::DelayNs for NoDelay {
        async fn delay_ns(&mut self, _: u32) {}
    }

    /// Each look at the clock takes a millisecond, so that a request that is sent ends.
    fn clock() -> impl FnMut() -> u32 {
        let mut now = 0u32;
        move || {
            now = now.wrapping_add(1000);
            now
        }
    }

    fn block_on<F: Future>(future: F) -> F::Output {
        let mut future = pin!(future);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                return output;
            }
        }
    }

    #[test]
    fn a_client_of_futures_refuses_what_no_device_can_answer() {
        let mut client = AsyncClient::rtu(AsyncIo::serial(rtu(), clock(), NoDelay));
        let outcomes = block_on(async { calls_of_a_client!(client, [await]) });
        assert_refused(outcomes, client.port().device.frames);
    }

    #[test]
    fn a_master_of_futures_refuses_what_no_device_can_answer() {
        let mut master = AsyncMaster::new(17, rtu(), clock(), NoDelay, buffers());
        let outcomes = block_on(async { calls_of_a_master!(master, [await]) });
        assert_refused(outcomes, master.device().frames);
        master.set_unit(0);
        let outcomes = block_on(async { broadcasts_of_a_master!(master, [await]) });
        assert_refused(outcomes, master.device().frames);
    }
}

//! The port over usbd-serial, on a simulated bus with a host.
#![cfg(feature = "usbd-serial")]

use mbm::error::Error;
use mbm::frame::rtu;
use mbm::port::{Port, UsbSerial};
use mbm::server::{Server, Tables, Unit};
use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use usb_device::bus::{PollResult, UsbBus, UsbBusAllocator};
use usb_device::class_prelude::{EndpointAddress, EndpointType};
use usb_device::device::{UsbDeviceBuilder, UsbVidPid};
use usb_device::{Result, UsbDirection, UsbError};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

const PACKET: usize = 64;
/// Reads registers 0 and 1 of unit 1, and the response.
const REQUEST: [u8; 8] = [1, 3, 0, 0, 0, 2, 0xC4, 0x0B];
const RESPONSE: [u8; 9] = [1, 3, 4, 2, 0x2B, 0, 100, 0x8A, 0x68];

/// What is on the bus.
#[derive(Default)]
struct Wire {
    endpoints: usize,
    bulk_in: usize,
    is_reset: bool,
    setup: Option<[u8; 8]>,
    to_device: VecDeque<Vec<u8>>,
    to_host: Option<Vec<u8>>,
    /// A bit for each endpoint whose packet the host has taken.
    taken: u16,
}

#[derive(Clone, Default)]
struct Bus(Arc<Mutex<Wire>>);

impl UsbBus for Bus {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        _: u16,
        _: u8,
    ) -> Result<EndpointAddress> {
        let wire = &mut *self.0.lock().unwrap();
        let number = match address {
            Some(address) => address.index(),
            None => {
                wire.endpoints += 1;
                wire.endpoints
            }
        };
        if kind == EndpointType::Bulk && direction == UsbDirection::In {
            wire.bulk_in = number;
        }
        Ok(EndpointAddress::from_parts(number, direction))
    }

    fn enable(&mut self) {}
    fn reset(&self) {}
    fn set_device_address(&self, _: u8) {}
    fn set_stalled(&self, _: EndpointAddress, _: bool) {}
    fn suspend(&self) {}
    fn resume(&self) {}

    fn is_stalled(&self, _: EndpointAddress) -> bool {
        false
    }

    fn write(&self, endpoint: EndpointAddress, bytes: &[u8]) -> Result<usize> {
        let wire = &mut *self.0.lock().unwrap();
        if endpoint.index() == wire.bulk_in {
            if wire.to_host.is_some() {
                return Err(UsbError::WouldBlock);
            }
            wire.to_host = Some(bytes.to_vec());
        }
        Ok(bytes.len())
    }

    fn read(&self, endpoint: EndpointAddress, place: &mut [u8]) -> Result<usize> {
        let wire = &mut *self.0.lock().unwrap();
        let packet = match endpoint.index() {
            0 => wire.setup.take().map(Vec::from),
            _ => wire.to_device.pop_front(),
        };
        let packet = packet.ok_or(UsbError::WouldBlock)?;
        place[..packet.len()].copy_from_slice(&packet);
        Ok(packet.len())
    }

    fn poll(&self) -> PollResult {
        let wire = &mut *self.0.lock().unwrap();
        if std::mem::take(&mut wire.is_reset) {
            return PollResult::Reset;
        }
        PollResult::Data {
            ep_out: 0,
            ep_in_complete: std::mem::take(&mut wire.taken),
            ep_setup: wire.setup.is_some().into(),
        }
    }
}

type Shared = Arc<Mutex<Wire>>;
type Usb = UsbSerial<'static, Bus, fn() -> u32>;

thread_local! {
    static NOW: Cell<u32> = const { Cell::new(0) };
}

fn micros() -> u32 {
    NOW.get()
}

fn wait(millis: u32) {
    NOW.set(NOW.get().wrapping_add(millis * 1000));
}

/// The port, and the bus that it is on.
fn open() -> (Shared, Usb) {
    let bus = Bus::default();
    let wire = bus.0.clone();
    let bus = Box::leak(Box::new(UsbBusAllocator::new(bus)));
    let serial = SerialPort::new(bus);
    let device = UsbDeviceBuilder::new(bus, UsbVidPid(0x1209, 1))
        .device_class(USB_CLASS_CDC)
        .build();
    (wire, UsbSerial::new(device, serial, micros))
}

/// A request of the host to the device's control endpoint.
fn control(wire: &Shared, kind: u8, request: u8, value: u8) {
    wire.lock().unwrap().setup = Some([kind, request, value, 0, 0, 0, 0, 0]);
}

fn configure(wire: &Shared, port: &mut impl Port) {
    control(wire, 0x00, 9, 1);
    assert_eq!(port.read(&mut []), Ok(0));
}

/// A program on the host opens the serial port, or closes it: it switches DTR.
fn set_dtr(wire: &Shared, is_open: bool) {
    control(wire, 0x21, 0x22, is_open.into());
}

fn send(wire: &Shared, bytes: &[u8]) {
    let packets = bytes.chunks(PACKET).map(<[u8]>::to_vec);
    wire.lock().unwrap().to_device.extend(packets);
}

/// The packet that the host takes; `None` if there is none.
fn take(wire: &Shared) -> Option<Vec<u8>> {
    let wire = &mut *wire.lock().unwrap();
    let packet = wire.to_host.take();
    if packet.is_some() {
        wire.taken |= 1 << wire.bulk_in;
    }
    packet
}

#[test]
fn a_server_answers_each_request_over_usb() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    let mut server = Server::rtu_over_tcp(port);
    let tables = Tables::NONE.with_holding_registers(0, [555, 100]);
    let mut unit = Unit::new(1, tables);
    for _ in 0..3 {
        send(&wire, &REQUEST);
        for _ in 0..10 {
            assert_eq!(server.serve(micros(), &mut unit), Ok(()));
        }
        assert_eq!(take(&wire), Some(RESPONSE.to_vec()));
    }
}

#[test]
fn after_a_pulled_cable_the_link_is_lost_once_and_the_next_request_is_answered() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    let mut server = Server::rtu_over_tcp(port);
    let tables = Tables::NONE.with_holding_registers(0, [555, 100]);
    let mut unit = Unit::new(1, tables);
    send(&wire, &REQUEST[..5]);
    assert_eq!(server.serve(micros(), &mut unit), Ok(()));
    wire.lock().unwrap().is_reset = true;
    assert_eq!(server.run(&mut unit), Error::LinkLost);
    server.begin_rtu_over_tcp();
    assert_eq!(server.serve(micros(), &mut unit), Ok(()));
    control(&wire, 0x00, 9, 1);
    send(&wire, &REQUEST);
    for _ in 0..10 {
        assert_eq!(server.serve(micros(), &mut unit), Ok(()));
    }
    assert_eq!(take(&wire), Some(RESPONSE.to_vec()));
}

#[test]
fn a_program_that_closes_the_port_loses_the_link_once_and_what_it_did_not_read() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    set_dtr(&wire, true);
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    // The first packet waits for the host, the second one in the device.
    assert_eq!(port.write(&[1; PACKET + 4]), Ok(PACKET + 4));
    send(&wire, &[9; 3]);
    set_dtr(&wire, false);
    assert_eq!(port.read(&mut [0; 8]), Err(Error::LinkLost));
    assert_eq!(take(&wire), Some(vec![1; PACKET]));
    set_dtr(&wire, true);
    let mut place = [0; 8];
    // What the host sends after that is the next program's.
    assert_eq!(port.read(&mut place), Ok(3));
    assert_eq!(port.write(&[2; 4]), Ok(4));
    assert_eq!(take(&wire), Some(vec![2; 4]));
}

#[test]
fn a_flush_has_a_full_packet_followed_by_an_empty_one() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    assert_eq!(port.write(&[7; PACKET]), Ok(PACKET));
    assert!(!port.flush());
    assert_eq!(take(&wire), Some(vec![7; PACKET]));
    port.flush();
    assert_eq!(take(&wire), Some(vec![]));
    assert!(port.flush());
}

#[test]
fn a_host_that_does_not_read_holds_the_port_back() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    let mut written = 0;
    for _ in 0..10 {
        written += port.write(&[3; 100]).unwrap();
    }
    assert!(written < 300, "{written}");
    let mut read = 0;
    while let Some(packet) = take(&wire) {
        read += packet.len();
        port.flush();
    }
    assert_eq!(read, written);
}

#[test]
fn a_response_that_the_host_does_not_read_is_given_up_and_the_next_one_is_whole() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    set_dtr(&wire, true);
    let mut server = Server::rtu_over_tcp(port);
    let mut unit = Unit::new(1, Tables::NONE.with_holding_registers(0, [7; 40]));
    let mut request = [0; 8];
    let read_forty = [3, 0, 0, 0, 40];
    rtu::emit(&mut request, 1, |pdu| {
        pdu[..5].copy_from_slice(&read_forty);
        Ok(5)
    })
    .unwrap();
    for _ in 0..3 {
        send(&wire, &request);
        for _ in 0..9 {
            assert_eq!(server.serve(micros(), &mut unit), Ok(()));
            wait(100);
        }
        wait(1000);
        let results: Vec<_> = (0..5).map(|_| server.serve(micros(), &mut unit)).collect();
        assert_eq!(
            results.iter().filter(|result| result.is_err()).count(),
            1,
            "{results:?}"
        );
        // This packet was in the endpoint already.
        assert_eq!(take(&wire).map(|packet| packet.len()), Some(PACKET));
        server.begin_rtu_over_tcp();
        send(&wire, &request);
        let mut response = vec![];
        for _ in 0..10 {
            assert_eq!(server.serve(micros(), &mut unit), Ok(()));
            response.extend(take(&wire).unwrap_or_default());
        }
        assert_eq!(response.len(), 3 + 80 + 2);
        assert!(rtu::parse(&response).is_ok());
    }
}

#[test]
fn a_host_that_takes_nothing_for_a_second_loses_the_link_once_and_what_it_did_not_read() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    while port.write(&[3; 100]) != Ok(0) {}
    wait(999);
    assert_eq!(port.write(&[3; 100]), Ok(0));
    // The second begins again with each packet that the host takes.
    assert_eq!(take(&wire), Some(vec![3; PACKET]));
    assert_ne!(port.write(&[3; 100]), Ok(0));
    while port.write(&[3; 100]) != Ok(0) {}
    wait(999);
    assert_eq!(port.write(&[3; 100]), Ok(0));
    wait(1);
    assert_eq!(port.write(&[3; 100]), Err(Error::LinkLost));
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert_eq!(take(&wire), Some(vec![3; PACKET]));
    assert_eq!(port.write(&[4; 5]), Ok(5));
    assert_eq!(take(&wire), Some(vec![4; 5]));
}

#[test]
fn a_link_that_is_lost_in_a_flush_is_reported_by_the_next_function() {
    let (wire, mut port) = open();
    configure(&wire, &mut port);
    set_dtr(&wire, true);
    assert_eq!(port.write(&[1; PACKET + 4]), Ok(PACKET + 4));
    assert!(!port.flush());
    set_dtr(&wire, false);
    assert!(port.flush());
    assert!(port.flush());
    assert_eq!(port.read(&mut [0; 8]), Err(Error::LinkLost));
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
}

#[test]
fn a_device_without_a_host_receives_nothing() {
    let (_, mut port) = open();
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert!(format!("{port:?}").contains("is_up: false"));
}

//! A port over the serial port (CDC) of the crates usb-device and usbd-serial.

use super::Port;
use crate::error::Error;
use crate::time::{has_elapsed, Micros};
use usb_device::bus::UsbBus;
use usb_device::class_prelude::UsbClass;
use usb_device::device::{UsbDevice, UsbDeviceState};
use usb_device::UsbError;
use usbd_serial::SerialPort;

/// A [`Port`] over a serial port of a chip's USB. Begin with RTU over TCP on it: silence separates no
/// frames there.
///
/// ```
/// use mbm::port::UsbSerial;
/// use mbm::server::{Server, Tables, Unit};
/// # use usb_device::bus::{UsbBus, UsbBusAllocator};
/// # use usb_device::device::{UsbDeviceBuilder, UsbVidPid};
/// use usbd_serial::{SerialPort, USB_CLASS_CDC};
///
/// fn serve<B: UsbBus>(bus: &UsbBusAllocator<B>, micros: fn() -> u32) -> ! {
///     let serial = SerialPort::new(bus);
///     let device = UsbDeviceBuilder::new(bus, UsbVidPid(0x1209, 1))
///         .device_class(USB_CLASS_CDC)
///         .build();
///     let mut server = Server::rtu_over_tcp(UsbSerial::new(device, serial, micros));
///     let tables = Tables::NONE.with_holding_registers(0, [555, 100]);
///     let mut unit = Unit::new(1, tables);
///     loop {
///         server.run(&mut unit);
///         // The cable was pulled, or the program on the host has ended.
///         server.begin_rtu_over_tcp();
///     }
/// }
/// ```
///
/// Each function lets the USB stack work, so the host is answered while a server or a client waits.
/// The link is lost once when the host leaves, when a program on the host closes the port, and when
/// the host takes no byte for a second although some wait for it: what was not read is dropped. A
/// host that does not set DTR is served too. `clock` returns the time in microseconds, which wraps
/// at 2^32.
pub struct UsbSerial<'a, B: UsbBus, C> {
    /// The device on the bus.
    pub device: UsbDevice<'a, B>,
    /// Its serial port.
    pub serial: SerialPort<'a, B>,
    clock: C,
    is_up: bool,
    is_open: bool,
    /// The next `read` or `write` reports that the link was lost.
    is_lost: bool,
    /// Since when bytes have waited for the host; `None` if none do.
    waiting_since: Option<Micros>,
}

/// How long bytes wait for the host, in microseconds.
const PATIENCE: u32 = 1_000_000;

impl<'a, B: UsbBus, C> UsbSerial<'a, B, C> {
    /// A port of this serial port, which was made before its device.
    pub const fn new(device: UsbDevice<'a, B>, serial: SerialPort<'a, B>, clock: C) -> Self {
        UsbSerial {
            device,
            serial,
            clock,
            is_up: false,
            is_open: false,
            is_lost: false,
            waiting_since: None,
        }
    }

    /// Lets the USB stack work, and notices whether the link is lost.
    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.serial]);
        let (was_up, was_open) = (self.is_up, self.is_open);
        self.is_up = self.device.state() == UsbDeviceState::Configured;
        self.is_open = self.is_up && self.serial.dtr();
        if was_open && !self.is_open {
            // The next program must not get what this one did not read.
            self.drop_unread();
        }
        self.is_lost |= was_up && !self.is_up;
    }

    /// Drops what the host did not read, with which the link is lost. The packet in the endpoint
    /// stays.
    fn drop_unread(&mut self) {
        UsbClass::<B>::reset(&mut self.serial);
        self.is_open = false;
        self.is_lost = true;
        self.waiting_since = None;
    }

    /// Reports that the link was lost, once.
    fn check_link(&mut self) -> Result<(), Error> {
        match core::mem::take(&mut self.is_lost) {
            true => Err(Error::LinkLost),
            false => Ok(()),
        }
    }
}

impl<B: UsbBus, C: FnMut() -> u32> UsbSerial<'_, B, C> {
    /// Drops what the host did not read once it has taken no byte for a second.
    fn wait_for_host(&mut self) {
        let now = (self.clock)();
        let since = *self.waiting_since.get_or_insert(now);
        if has_elapsed(PATIENCE, now, since) {
            self.drop_unread();
        }
    }
}

impl<B: UsbBus, C> core::fmt::Debug for UsbSerial<'_, B, C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("UsbSerial")
            .field("is_up", &self.is_up)
            .field("is_open", &self.is_open)
            .finish_non_exhaustive()
    }
}

/// No byte is no error.
fn moved(result: Result<usize, UsbError>) -> Result<usize, Error> {
    match result {
        Err(UsbError::WouldBlock) => Ok(0),
        result => result.map_err(|_| Error::LinkLost),
    }
}

impl<B: UsbBus, C: FnMut() -> u32> Port for UsbSerial<'_, B, C> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        self.poll();
        self.check_link()?;
        moved(self.serial.read(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.poll();
        self.check_link()?;
        let written = moved(self.serial.write(bytes))?;
        match written {
            0 => self.wait_for_host(),
            _ => self.waiting_since = None,
        }
        self.check_link()?;
        Ok(written)
    }

    fn micros(&mut self) -> u32 {
        (self.clock)()
    }

    /// A packet that is full is followed by an empty one, or the host waits for more.
    fn flush(&mut self) -> bool {
        self.poll();
        if !self.is_lost {
            match self.serial.flush() {
                Ok(()) => self.waiting_since = None,
                Err(_) => self.wait_for_host(),
            }
        }
        self.is_lost || self.waiting_since.is_none()
    }
}

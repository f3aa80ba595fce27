//! A port over the serial port (CDC) of the crates usb-device and usbd-serial.

use super::Port;
use crate::error::Error;
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
/// The link is lost once when the host leaves, and once when a program on the host closes the port:
/// what that program did not read is dropped. A host that does not set DTR is served too. `clock`
/// returns the time in microseconds, which wraps at 2^32.
pub struct UsbSerial<'a, B: UsbBus, C> {
    /// The device on the bus.
    pub device: UsbDevice<'a, B>,
    /// Its serial port.
    pub serial: SerialPort<'a, B>,
    clock: C,
    is_up: bool,
    is_open: bool,
}

impl<'a, B: UsbBus, C> UsbSerial<'a, B, C> {
    /// A port of this serial port, which was made before its device.
    pub const fn new(device: UsbDevice<'a, B>, serial: SerialPort<'a, B>, clock: C) -> Self {
        UsbSerial {
            device,
            serial,
            clock,
            is_up: false,
            is_open: false,
        }
    }

    /// Lets the USB stack work.
    fn poll(&mut self) -> Result<(), Error> {
        self.device.poll(&mut [&mut self.serial]);
        let (was_up, was_open) = (self.is_up, self.is_open);
        self.is_up = self.device.state() == UsbDeviceState::Configured;
        self.is_open = self.is_up && self.serial.dtr();
        if was_open && !self.is_open {
            // The next program must not get what this one did not read.
            UsbClass::<B>::reset(&mut self.serial);
        }
        if was_up && !self.is_up || was_open && !self.is_open {
            return Err(Error::LinkLost);
        }
        Ok(())
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
        self.poll()?;
        moved(self.serial.read(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.poll()?;
        moved(self.serial.write(bytes))
    }

    fn micros(&mut self) -> u32 {
        (self.clock)()
    }

    /// A packet that is full is followed by an empty one, or the host waits for more.
    fn flush(&mut self) -> bool {
        self.poll().is_err() || self.serial.flush().is_ok()
    }
}

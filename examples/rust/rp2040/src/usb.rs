//! The port over the serial port of the crate usbd-serial.

use mbm::port::Port;
use mbm::Error;
use rp2040_hal::{usb::UsbBus, Timer};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usb_device::UsbError;
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// pid.codes' numbers for tests. A product has its own.
const FOR_TESTS: UsbVidPid = UsbVidPid(0x1209, 0x0001);

pub struct Usb<'a> {
    device: UsbDevice<'a, UsbBus>,
    serial: SerialPort<'a, UsbBus>,
    timer: Timer,
    is_up: bool,
}

impl<'a> Usb<'a> {
    pub fn new(bus: &'a UsbBusAllocator<UsbBus>, timer: Timer) -> Self {
        let serial = SerialPort::new(bus);
        let texts = [StringDescriptors::default().product("Modbus server")];
        let device = UsbDeviceBuilder::new(bus, FOR_TESTS)
            .strings(&texts)
            .unwrap()
            .device_class(USB_CLASS_CDC)
            // With the 8 of the default, Windows may not get to know the device.
            .max_packet_size_0(64)
            .unwrap()
            .build();
        Usb {
            device,
            serial,
            timer,
            is_up: false,
        }
    }

    /// Lets the USB stack work. The link is lost once, when the host leaves.
    fn poll(&mut self) -> Result<(), Error> {
        self.device.poll(&mut [&mut self.serial]);
        let was_up = self.is_up;
        self.is_up = self.device.state() == UsbDeviceState::Configured;
        if was_up && !self.is_up {
            return Err(Error::LinkLost);
        }
        Ok(())
    }
}

/// No byte is no error.
fn moved(result: Result<usize, UsbError>) -> Result<usize, Error> {
    match result {
        Err(UsbError::WouldBlock) => Ok(0),
        result => result.map_err(|_| Error::LinkLost),
    }
}

impl Port for Usb<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        self.poll()?;
        moved(self.serial.read(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.poll()?;
        moved(self.serial.write(bytes))
    }

    fn micros(&mut self) -> u32 {
        self.timer.get_counter_low()
    }

    /// Has the packets sent that `write` has filled.
    fn flush(&mut self) -> bool {
        self.poll().is_err() || self.serial.flush().is_ok()
    }
}

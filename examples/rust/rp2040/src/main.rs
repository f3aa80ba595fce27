//! A Modbus server on a Raspberry Pi Pico, over its USB: 512 coils, four discrete inputs, four holding
//! registers and four input registers of unit 1. The host sees a serial port, for example /dev/ttyACM0.
#![no_std]
#![no_main]

use mbm::port::UsbSerial;
use mbm::server::{Server, Tables, Unit};
use rp2040_hal::{clocks, pac, usb::UsbBus, Timer, Watchdog};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{StringDescriptors, UsbDeviceBuilder, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// Loads the program from the flash of a Pico.
#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

/// The crystal of a Pico, in Hz.
const CRYSTAL: u32 = 12_000_000;

/// pid.codes' numbers for tests. A product has its own.
const FOR_TESTS: UsbVidPid = UsbVidPid(0x1209, 0x0001);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

#[rp2040_hal::entry]
fn main() -> ! {
    let mut chip = pac::Peripherals::take().unwrap();
    let mut watchdog = Watchdog::new(chip.WATCHDOG);
    let clocks = clocks::init_clocks_and_plls(
        CRYSTAL,
        chip.XOSC,
        chip.CLOCKS,
        chip.PLL_SYS,
        chip.PLL_USB,
        &mut chip.RESETS,
        &mut watchdog,
    );
    let Ok(clocks) = clocks else { loop {} };
    let timer = Timer::new(chip.TIMER, &mut chip.RESETS, &clocks);
    let bus = UsbBusAllocator::new(UsbBus::new(
        chip.USBCTRL_REGS,
        chip.USBCTRL_DPRAM,
        clocks.usb_clock,
        true,
        &mut chip.RESETS,
    ));
    let serial = SerialPort::new(&bus);
    let texts = [StringDescriptors::default().product("Modbus server")];
    let device = UsbDeviceBuilder::new(&bus, FOR_TESTS)
        .strings(&texts)
        .unwrap()
        .device_class(USB_CLASS_CDC)
        // With the 8 of the default, Windows may not get to know the device.
        .max_packet_size_0(64)
        .unwrap()
        .build();
    let port = UsbSerial::new(device, serial, || timer.get_counter_low());

    let tables = Tables::NONE
        .with_coils(0, [false; 512])
        .with_discrete_inputs(0, [true, false, true, true])
        .with_holding_registers(0, [555, 100, 0, 0])
        .with_input_registers(0, [2301, 50, 0, 0]);
    let mut unit = Unit::new(1, tables);
    // On USB silence separates no frames.
    let mut server = Server::rtu_over_tcp(port);
    loop {
        server.run(&mut unit);
        // The cable was pulled, or the host closed the port: part of a request may be left.
        server.begin_rtu_over_tcp();
    }
}

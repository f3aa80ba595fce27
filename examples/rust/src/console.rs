//! The debugger's console of a Cortex-M, which an emulator has too.

use core::arch::asm;
use core::fmt;
use core::panic::PanicInfo;

/// Makes a semihosting call.
fn call(number: u32, parameter: *const u32) {
    // SAFETY: the debugger reads the parameter, and changes no memory.
    unsafe {
        asm!("bkpt 0xAB", in("r0") number, lateout("r0") _, in("r1") parameter, options(nostack));
    }
}

/// The debugger's console.
pub struct Console;

impl fmt::Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        const WRITE_CHARACTER: u32 = 3;
        for byte in text.bytes() {
            call(WRITE_CHARACTER, [u32::from(byte)].as_ptr());
        }
        Ok(())
    }
}

/// Ends the emulator with an exit code.
pub fn exit(code: u32) -> ! {
    const EXIT_EXTENDED: u32 = 0x20;
    const APPLICATION_EXIT: u32 = 0x2_0026;
    loop {
        call(EXIT_EXTENDED, [APPLICATION_EXIT, code].as_ptr());
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    exit(254)
}

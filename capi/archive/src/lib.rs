//! The functions of `mbm-c` as a static archive, for the linker of a C program.

#![no_std]

extern crate mbm_c;

/// A program on a microcontroller cannot continue after a panic. The check of the linked
/// image proves that no code calls this function.
#[cfg(not(test))] // Tests use the panic handler of std.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

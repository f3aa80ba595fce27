//! The functions of `mbm-c` for a linker that knows no Rust.

#![no_std]

extern crate mbm_c;

/// There is no way back from a panic on a microcontroller. The check of the
/// linked image proves that nothing comes here.
#[cfg(not(test))] // tests have that of std
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

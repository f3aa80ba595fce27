//! The functions of `mbm-c` as a static archive, for the linker of a C program.

#![no_std]

extern crate mbm_c;

/// A program on a microcontroller cannot continue after a panic. The check of the linked
/// image proves that no code calls this function.
#[cfg(not(any(test, all(unix, debug_assertions))))] // Tests use the panic handler of std.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// The panic handler of an archive with debug assertions, which only tests link.
#[cfg(all(unix, debug_assertions, not(test)))]
mod report {
    use core::ffi::{c_int, c_void};
    use core::fmt::{self, Write};
    use core::panic::PanicInfo;

    extern "C" {
        fn write(file: c_int, bytes: *const c_void, count: usize) -> isize;
        fn abort() -> !;
    }

    struct StandardError;

    impl Write for StandardError {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            // SAFETY: the bytes are those of a text.
            match unsafe { write(2, text.as_ptr().cast(), text.len()) } {
                written if usize::try_from(written) == Ok(text.len()) => Ok(()),
                _ => Err(fmt::Error),
            }
        }
    }

    /// Prints the message and ends the program with a signal, so that its test fails.
    #[panic_handler]
    fn panic(info: &PanicInfo) -> ! {
        let _ = writeln!(StandardError, "{info}");
        // SAFETY: abort has no condition.
        unsafe { abort() }
    }
}

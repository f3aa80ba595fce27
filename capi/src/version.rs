//! The version of the library, which Cargo.toml defines.

use core::ffi::c_char;

/// Version of this header: a new major version may break programs.
pub const MBM_VERSION_MAJOR: u8 = number(env!("CARGO_PKG_VERSION_MAJOR"));
/// Version of this header: before 1.0 a new minor version may break programs.
pub const MBM_VERSION_MINOR: u8 = number(env!("CARGO_PKG_VERSION_MINOR"));
/// Version of this header: a new patch version breaks nothing.
pub const MBM_VERSION_PATCH: u8 = number(env!("CARGO_PKG_VERSION_PATCH"));

/// Converts decimal digits to a number. A number above 255 does not compile.
const fn number(digits: &str) -> u8 {
    let mut rest = digits.as_bytes();
    let mut number = 0;
    while let [digit, others @ ..] = rest {
        number = 10 * number + (*digit - b'0');
        rest = others;
    }
    number
}

/// Returns the version of the archive. The text equals MBM_VERSION, the version of the
/// header, if header and archive belong together.
///
/// Any thread or interrupt may call it.
///
/// @return a constant string, the three numbers with dots between them, never NULL
#[no_mangle]
pub extern "C" fn mbm_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

//! Gets and sets texts in other forms than two characters a register and a NUL.

use super::set::with;
use super::{code, mbm_registers, view};
use crate::pointers::{In, Out};
use core::ffi::c_char;
use mbm::data::text::{Characters, TextForm};
use mbm::error::{Error, Status};

/// A form of text: each register has one character, in its low byte.
pub const MBM_TEXT_LOW_BYTES: u8 = 1;
/// A form of text: each register has one character, in its high byte.
pub const MBM_TEXT_HIGH_BYTES: u8 = 2;
/// A form of text, alone or added to one of the others: the rest of the field has spaces.
pub const MBM_TEXT_SPACES: u8 = 4;

fn form_of(form: u8) -> Result<TextForm, Error> {
    let characters = match form & !MBM_TEXT_SPACES {
        0 => Characters::Both,
        MBM_TEXT_LOW_BYTES => Characters::Low,
        MBM_TEXT_HIGH_BYTES => Characters::High,
        _ => return Err(Error::InvalidArgument),
    };
    Ok(TextForm {
        characters,
        has_spaces: form & MBM_TEXT_SPACES != 0,
    })
}

/// Reads a text in another form than mbm_registers_getString. It ends at its first NUL or at the
/// end of its field; with MBM_TEXT_SPACES the spaces at its end are left out.
///
/// @param address   the device's address of the first register of the field
/// @param length    length of the field in characters
/// @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`. With
///                  MBM_TEXT_LOW_BYTES and MBM_TEXT_HIGH_BYTES it has no effect
/// @param form      0 for two characters a register, or MBM_TEXT_..., added up
/// @param text      receives the text and a NUL
/// @param capacity  size of `text` in bytes; `length + 1` are always enough
/// @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if `text` is
#[no_mangle]
pub extern "C" fn mbm_registers_getText(
    registers: In<mbm_registers>,
    address: u16,
    length: u16,
    order: u8,
    form: u8,
    text: Out<c_char>,
    capacity: u16,
) -> u8 {
    if text.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    code(view(registers, order, false).and_then(|registers| {
        let form = form_of(form)?;
        let text = text.cast::<u8>().slice(capacity.into())?;
        let (end, place) = text.split_last_mut().ok_or(Error::BufferTooSmall)?;
        let order = registers.order;
        let found = registers.text_of(form, order, address, length.into(), place)?;
        let count = found.len();
        *place.get_mut(count).unwrap_or(end) = 0;
        Ok(())
    }))
}

/// Writes a text into a field, as mbm_registers_getText reads it. Every byte of the field's
/// registers is set.
///
/// @param text      the text; ends with a NUL, which need not fit into the field
/// @return as mbm_registers_getText; MBM_BUFFER_TOO_SMALL if the text is longer than the field;
///         MBM_INVALID_ARGUMENT if it ends with a space, which MBM_TEXT_SPACES would lose
#[no_mangle]
pub extern "C" fn mbm_registers_setText(
    registers: In<mbm_registers>,
    address: u16,
    length: u16,
    order: u8,
    form: u8,
    text: In<c_char>,
) -> u8 {
    let length = usize::from(length);
    with(registers, order, |registers| {
        let form = form_of(form)?;
        let text = text.cast().text(length)?;
        registers.set_text_of(form, registers.order, address, length, text)
    })
}

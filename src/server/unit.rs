//! A unit of a device.

use super::device::Device;
use super::diagnostics::Diagnostics;
use super::serve_device::serve;
use super::units::{has_in_slice, offer_counted, serve_slice, AnyUnit, Units};
use super::{Addressing, Indication, Reply};

/// A device with its unit id. [`Server::serve`](super::Server::serve) takes one unit, or a slice or
/// array of them.
///
/// ```
/// use mbm::server::{Tables, Unit};
///
/// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
/// unit.device.holding_registers.cells[2] = 888;
/// ```
#[derive(Clone, Debug)]
pub struct Unit<D> {
    /// The unit id, 1 to 247; 0 in a stream responds to every id.
    pub id: u8,
    /// The device.
    pub device: D,
    /// The counters of the line, if any: serve functions 08, 0B and 0C.
    pub diagnostics: Option<Diagnostics>,
}

impl<D: Device> Unit<D> {
    /// A device at this unit id, without counters.
    pub const fn new(id: u8, device: D) -> Self {
        Unit {
            id,
            device,
            diagnostics: None,
        }
    }
}

impl<D: Device> AnyUnit for Unit<D> {
    fn id(&self) -> u8 {
        self.id
    }

    fn offer(&mut self, info: &Indication, addressing: Addressing, pdu: &mut [u8]) -> Reply {
        let device = &mut self.device;
        offer_counted(
            self.diagnostics.as_mut(),
            info,
            addressing,
            pdu,
            |line, pdu, length| {
                let counted = line.map_or(Reply::NOT_HANDLED, |line| line.serve(pdu, length).0);
                match counted {
                    Reply::NOT_HANDLED => serve(device, pdu, length),
                    reply => reply,
                }
            },
        )
    }
}

impl<D: Device> Units for [Unit<D>] {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        serve_slice(self, info, pdu)
    }

    fn has(&self, unit: u8) -> bool {
        has_in_slice(self, unit)
    }
}

impl<D: Device, const N: usize> Units for [Unit<D>; N] {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        self.as_mut_slice().serve(info, pdu)
    }

    fn has(&self, unit: u8) -> bool {
        self.as_slice().has(unit)
    }
}

impl<D: Device> Units for Unit<D> {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        core::slice::from_mut(self).serve(info, pdu)
    }

    fn has(&self, unit: u8) -> bool {
        core::slice::from_ref(self).has(unit)
    }
}

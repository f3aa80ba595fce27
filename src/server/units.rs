//! Units: find the unit that a request is addressed to, and let its services serve it.

use super::diagnostics::Diagnostics;
use super::indication::ANY;
use super::{Addressing, Indication, Refusal, Reply};
use core::fmt;

/// A service: one family of functions.
///
/// ```
/// use mbm::server::{Reply, Service};
///
/// /// Function 65 returns the temperature.
/// struct Temperature(u8);
///
/// impl Service for Temperature {
///     fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
///         match (pdu, length) {
///             ([65, place, ..], 1) => {
///                 *place = self.0;
///                 Reply::length(2)
///             }
///             _ => Reply::NOT_HANDLED,
///         }
///     }
///
///     fn is_custom(&self) -> bool {
///         true
///     }
/// }
/// ```
pub trait Service {
    /// Serves a request whose function belongs to this family. The PDU of the request is the
    /// first `length` bytes of `pdu`; the PDU of the response overwrites it. Returns
    /// [`Reply::NOT_HANDLED`] for any other function.
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply;

    /// True for a function of the user. It serves no request for cells that an earlier service
    /// lacks: it is for functions that no earlier service serves.
    fn is_custom(&self) -> bool {
        false
    }
}

/// The units that serve the frames of a line.
///
/// ```
/// use mbm::server::{Indication, Reply, Tables, Unit, Units};
///
/// /// Two units with different devices.
/// struct Both<A, B>(A, B);
///
/// impl<A: Units, B: Units> Units for Both<A, B> {
///     fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
///         match self.0.has(info.to) {
///             true => self.0.serve(info, pdu),
///             false => self.1.serve(info, pdu),
///         }
///     }
///
///     fn has(&self, unit: u8) -> bool {
///         self.0.has(unit) || self.1.has(unit)
///     }
/// }
/// ```
pub trait Units {
    /// Serves a frame, whichever unit it is addressed to. Its PDU is at the front of `pdu`.
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply;

    /// True if one of them has this id, and for 0, the address of a broadcast. A server on an RTU
    /// line waits for the rest of a request to such a unit, but not for that of another frame.
    fn has(&self, unit: u8) -> bool {
        let _ = unit;
        true
    }
}

/// One unit of a list of services. [`Unit`](super::Unit) is one of a
/// [`Device`](super::Device), which most programs have.
///
/// ```
/// use mbm::server::storage::{HoldingRegisters, RegisterArray};
/// use mbm::server::{Server, ServiceUnit};
/// # fn serve(mut server: Server<impl mbm::port::Port, [u8; 256]>, now: u32) -> Result<(), mbm::Error> {
///
/// let mut words = [555, 100, 0, 0];
/// // Functions 03, 06, 10, 16 and 17 of registers 107 to 110, and no other.
/// let mut registers = HoldingRegisters(RegisterArray::new(107, &mut words));
/// let mut units = [ServiceUnit { id: 17, services: &mut [&mut registers], diagnostics: None }];
/// server.serve(now, &mut units[..])?;
/// # Ok(())
/// # }
/// # Ok::<(), mbm::Error>(())
/// ```
pub struct ServiceUnit<'a> {
    /// The unit id, 1 to 247; 0 in a stream responds to every id.
    pub id: u8,
    /// The services, in this order: the first one that handles a function serves it. If it lacks
    /// the cells of the request, the services after it are asked for them.
    pub services: &'a mut [&'a mut dyn Service],
    /// The counters of the line, if any: serve functions 08, 0B and 0C.
    pub diagnostics: Option<&'a mut Diagnostics>,
}

impl fmt::Debug for ServiceUnit<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter
            .debug_struct("ServiceUnit")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}

/// The units of a server, as [`dispatch`] offers them one frame, one unit after the other.
pub trait Dispatch {
    /// A unit.
    type Unit;

    /// The next unit.
    fn next(&mut self) -> Option<Self::Unit>;

    /// True if a frame that is no broadcast is addressed to this unit.
    fn is_for(&self, unit: &Self::Unit) -> bool;

    /// Lets a unit serve the frame, or only count it, as `addressing` demands. `None` if the frame
    /// is addressed to another unit, and this unit does not count such frames.
    fn offer(&mut self, unit: Self::Unit, addressing: Addressing) -> Option<Reply>;
}

/// Offers a frame to all units; `all` is how it addresses the units that its id names. Returns
/// the reply of the first such unit; the other units only count the frame. Returns
/// [`Reply::NO_RESPONSE`] if there is no such unit, and for a broadcast, which every unit serves.
#[inline(always)]
pub fn dispatch(units: &mut impl Dispatch, mut all: Addressing) -> Reply {
    let mut answer = Reply::NO_RESPONSE;
    while let Some(unit) = units.next() {
        // In this order, a server of four tables takes 12 bytes less on an AVR.
        let is_for = units.is_for(&unit);
        let mut addressing = all.to_others();
        if is_for {
            addressing = all;
        }
        let Some(reply) = units.offer(unit, addressing) else {
            continue;
        };
        if addressing == Addressing::OWN {
            answer = reply;
            all = Addressing::FOREIGN;
        }
    }
    answer
}

impl Service for Diagnostics {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        self.serve(pdu, length).0
    }
}

/// Lets the services serve a request one after the other, until one of them answers it.
fn serve_pdu(
    services: &mut [&mut dyn Service],
    line: Option<&mut Diagnostics>,
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    let services = services.iter_mut().map(|service| &mut **service);
    let mut refusal = Refusal::NONE;
    for service in services.chain(line.map(|line| line as &mut dyn Service)) {
        if refusal.is_of_cells() && service.is_custom() {
            continue;
        }
        let reply = service.serve(pdu, length);
        if !refusal.note(reply) {
            return reply;
        }
    }
    refusal.reply()
}

impl AnyUnit for ServiceUnit<'_> {
    fn id(&self) -> u8 {
        self.id
    }

    fn offer(&mut self, info: &Indication, addressing: Addressing, pdu: &mut [u8]) -> Reply {
        let services = &mut *self.services;
        let line = self.diagnostics.as_deref_mut();
        offer_counted(line, info, addressing, pdu, |line, pdu, length| {
            serve_pdu(services, line, pdu, length)
        })
    }
}

/// Lets `serve` serve a frame that is addressed to a unit. Counts any frame in the diagnostics of
/// `line`.
pub(super) fn offer_counted(
    mut line: Option<&mut Diagnostics>,
    info: &Indication,
    addressing: Addressing,
    pdu: &mut [u8],
    serve: impl FnOnce(Option<&mut Diagnostics>, &mut [u8], usize) -> Reply,
) -> Reply {
    let length = usize::from(info.length);
    let function = pdu.first().copied().unwrap_or(0);
    let mut served = addressing != Addressing::FOREIGN;
    if let Some(line) = &mut line {
        served = line.count_frame(info, addressing, pdu.get(..length).unwrap_or_default());
    }
    if !served {
        return Reply::NO_RESPONSE;
    }
    let reply = serve(line.as_deref_mut(), pdu, length);
    if let (Some(line), true) = (&mut line, reply != Reply::PENDING) {
        line.count_outcome(addressing, function, reply);
    }
    reply
}

/// A unit in a slice.
pub(super) trait AnyUnit {
    /// Its unit id.
    fn id(&self) -> u8;

    /// Serves a frame that is addressed to this unit. Counts any frame in the diagnostics.
    fn offer(&mut self, info: &Indication, addressing: Addressing, pdu: &mut [u8]) -> Reply;
}

/// Units in a slice, and the frame that they are offered.
struct Slice<'a, U> {
    units: U,
    info: &'a Indication,
    pdu: &'a mut [u8],
}

impl<'u, A: AnyUnit + 'u, U: Iterator<Item = &'u mut A>> Dispatch for Slice<'_, U> {
    type Unit = &'u mut A;

    fn next(&mut self) -> Option<Self::Unit> {
        self.units.next()
    }

    fn is_for(&self, unit: &Self::Unit) -> bool {
        self.info.is_for(unit.id().into())
    }

    fn offer(&mut self, unit: Self::Unit, addressing: Addressing) -> Option<Reply> {
        Some(unit.offer(self.info, addressing, self.pdu))
    }
}

/// As [`Units::serve`], for units in a slice.
pub(super) fn serve_slice(units: &mut [impl AnyUnit], info: &Indication, pdu: &mut [u8]) -> Reply {
    let all = info.addressing(pdu.first().copied().unwrap_or(0));
    let units = units.iter_mut();
    dispatch(&mut Slice { units, info, pdu }, all)
}

/// As [`Units::has`], for units in a slice.
pub(super) fn has_in_slice(units: &[impl AnyUnit], unit: u8) -> bool {
    unit == 0
        || units
            .iter()
            .any(|known| known.id() == unit || known.id() == ANY)
}

impl Units for [ServiceUnit<'_>] {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        serve_slice(self, info, pdu)
    }

    fn has(&self, unit: u8) -> bool {
        has_in_slice(self, unit)
    }
}

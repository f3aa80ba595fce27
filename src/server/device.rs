//! A device that a server serves: a struct of the program that reads and writes its values.

use crate::data::bits;
use crate::error::Exception;

/// A device. Implement the functions that it has; each other one is answered with exception 01.
///
/// A function gets the values that it reads or writes as slices. An exception refuses the request, and
/// goes to the client as it is. Quantities are checked before: no slice is empty, and no range passes
/// address 65535.
///
/// ```
/// use mbm::server::Device;
/// use mbm::Exception;
///
/// struct Pump {
///     speed: u16,
///     hours: u16,
/// }
///
/// impl Device for Pump {
///     fn read_holding_registers(
///         &mut self,
///         address: u16,
///         registers: &mut [u16],
///     ) -> Result<(), Exception> {
///         match (address, registers) {
///             (0, [speed]) => *speed = self.speed,
///             (0, [speed, hours]) => (*speed, *hours) = (self.speed, self.hours),
///             (1, [hours]) => *hours = self.hours,
///             _ => return Err(Exception::IllegalDataAddress),
///         }
///         Ok(())
///     }
///
///     fn write_holding_registers(
///         &mut self,
///         address: u16,
///         registers: &[u16],
///     ) -> Result<(), Exception> {
///         match (address, registers) {
///             (0, [speed @ 0..=3000]) => self.speed = *speed,
///             (0, [_]) => return Err(Exception::IllegalDataValue),
///             _ => return Err(Exception::IllegalDataAddress),
///         }
///         Ok(())
///     }
/// }
/// # let mut pump = Pump { speed: 0, hours: 7 };
/// # assert_eq!(pump.write_holding_registers(0, &[3001]), Err(Exception::IllegalDataValue));
/// # assert_eq!(pump.write_holding_registers(0, &[1500]), Ok(()));
/// # let mut words = [0; 2];
/// # assert_eq!(pump.read_holding_registers(0, &mut words), Ok(()));
/// # assert_eq!(words, [1500, 7]);
/// ```
///
/// [`Unit`](super::Unit) gives it an id. [`Tables`](super::Tables) is a device of plain arrays.
#[allow(unused_variables)]
pub trait Device {
    /// 01: reads coils.
    ///
    /// # Errors
    /// This and the other functions return the exception with which the request is refused.
    ///
    /// ```
    /// use mbm::server::{BitsMut, Device};
    /// use mbm::Exception;
    ///
    /// struct Relay(bool);
    ///
    /// impl Device for Relay {
    ///     fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
    ///         match (address, coils.len()) {
    ///             (0, 1) => coils.set(0, self.0),
    ///             _ => return Err(Exception::IllegalDataAddress),
    ///         }
    ///         Ok(())
    ///     }
    /// }
    /// ```
    fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 02: reads discrete inputs.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// use mbm::server::{BitsMut, Device};
    /// use mbm::Exception;
    ///
    /// struct Doors([bool; 4]);
    ///
    /// impl Device for Doors {
    ///     fn read_discrete_inputs(&mut self, address: u16, inputs: &mut BitsMut) -> Result<(), Exception> {
    ///         let doors = self.0.get(usize::from(address)..).unwrap_or_default();
    ///         let doors = doors.get(..inputs.len()).ok_or(Exception::IllegalDataAddress)?;
    ///         inputs.set_all(doors.iter().copied());
    ///         Ok(())
    ///     }
    /// }
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn read_discrete_inputs(
        &mut self,
        address: u16,
        inputs: &mut BitsMut,
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 03, and the reading part of 16 and 17: reads holding registers.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    fn read_holding_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 04: reads input registers.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// use mbm::server::Device;
    /// use mbm::Exception;
    ///
    /// struct Thermometer(u16);
    ///
    /// impl Device for Thermometer {
    ///     fn read_input_registers(&mut self, address: u16, registers: &mut [u16]) -> Result<(), Exception> {
    ///         match (address, registers) {
    ///             (0, [temperature]) => *temperature = self.0,
    ///             _ => return Err(Exception::IllegalDataAddress),
    ///         }
    ///         Ok(())
    ///     }
    /// }
    /// ```
    fn read_input_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 05 and 0F: writes coils, all or none.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// use mbm::server::{Bits, Device};
    /// use mbm::Exception;
    ///
    /// struct Relay(bool);
    ///
    /// impl Device for Relay {
    ///     fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
    ///         match (address, coils.len(), coils.get(0)) {
    ///             (0, 1, Some(on)) => self.0 = on,
    ///             _ => return Err(Exception::IllegalDataAddress),
    ///         }
    ///         Ok(())
    ///     }
    /// }
    /// ```
    fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 06, 10, and the writing part of 16 and 17: writes holding registers, all or none.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    fn write_holding_registers(
        &mut self,
        address: u16,
        registers: &[u16],
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Before 17 writes: refuses the request if it may not read these holding registers afterwards.
    /// By default they are read, and what was read is dropped.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// use mbm::server::Device;
    /// use mbm::Exception;
    ///
    /// struct Meter;
    ///
    /// impl Device for Meter {
    ///     // A read of this device takes long, so it is not made to see whether it is possible.
    ///     fn check_holding_registers(&mut self, address: u16, quantity: u16) -> Result<(), Exception> {
    ///         match u32::from(address) + u32::from(quantity) {
    ///             0..=200 => Ok(()),
    ///             _ => Err(Exception::IllegalDataAddress),
    ///         }
    ///     }
    /// }
    /// ```
    fn check_holding_registers(&mut self, address: u16, quantity: u16) -> Result<(), Exception> {
        let mut words = [0; crate::pdu::MAX_READ_REGISTERS as usize];
        match words.get_mut(..quantity.into()) {
            Some(words) => self.read_holding_registers(address, words),
            None => Err(Exception::IllegalDataValue),
        }
    }

    /// 07: returns the eight exception status outputs, the first in the lowest bit.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump { is_hot: bool }
    /// # impl Device for Pump {
    /// fn read_exception_status(&mut self) -> Result<u8, Exception> {
    ///     Ok(u8::from(self.is_hot))
    /// }
    /// # }
    /// ```
    fn read_exception_status(&mut self) -> Result<u8, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 11: writes what the device says about itself into `data`: its id, FF (hex) if it runs or else
    /// 0, and more if it likes. Returns how many bytes that are.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump;
    /// # impl Device for Pump {
    /// fn report_server_id(&mut self, data: &mut [u8]) -> Result<usize, Exception> {
    ///     let id = b"pump\xFF"; // FF: it runs.
    ///     let place = data.get_mut(..id.len()).ok_or(Exception::ServerDeviceFailure)?;
    ///     place.copy_from_slice(id);
    ///     Ok(id.len())
    /// }
    /// # }
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn report_server_id(&mut self, data: &mut [u8]) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 14: reads consecutive records of a file. A request may read several ranges: one call for each.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump { log: [u16; 100] }
    /// # impl Device for Pump {
    /// fn read_file_record(
    ///     &mut self,
    ///     file: u16,
    ///     record: u16,
    ///     records: &mut [u16],
    /// ) -> Result<(), Exception> {
    ///     let log = self.log.get(usize::from(record)..).filter(|_| file == 1);
    ///     let wanted = log.and_then(|log| log.get(..records.len()));
    ///     records.copy_from_slice(wanted.ok_or(Exception::IllegalDataAddress)?);
    ///     Ok(())
    /// }
    /// # }
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn read_file_record(
        &mut self,
        file: u16,
        record: u16,
        records: &mut [u16],
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 15: writes consecutive records of a file. A request may write several ranges: one call for
    /// each, up to the first that is refused.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump { log: [u16; 100] }
    /// # impl Device for Pump {
    /// fn write_file_record(&mut self, file: u16, record: u16, records: &[u16]) -> Result<(), Exception> {
    ///     let log = self.log.get_mut(usize::from(record)..).filter(|_| file == 1);
    ///     let place = log.and_then(|log| log.get_mut(..records.len()));
    ///     place.ok_or(Exception::IllegalDataAddress)?.copy_from_slice(records);
    ///     Ok(())
    /// }
    /// # }
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn write_file_record(
        &mut self,
        file: u16,
        record: u16,
        records: &[u16],
    ) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 18: reads the queue at an address, without removing anything, and returns how many registers
    /// it has. A queue of more than 31 is exception 03.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump { alarms: Vec<u16> }
    /// # impl Device for Pump {
    /// fn read_fifo_queue(&mut self, address: u16, queue: &mut [u16; 31]) -> Result<usize, Exception> {
    ///     if address != 1000 {
    ///         return Err(Exception::IllegalDataAddress);
    ///     }
    ///     for (place, alarm) in queue.iter_mut().zip(&self.alarms) {
    ///         *place = *alarm;
    ///     }
    ///     Ok(self.alarms.len())
    /// }
    /// # }
    /// ```
    fn read_fifo_queue(&mut self, address: u16, queue: &mut [u16; 31]) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// 2B/0E: returns the object of a device identification with this id; `None` if there is no such
    /// one. Objects 0 to 2 are vendor, product and revision. A device without object 0 does not serve
    /// the function.
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # struct Pump;
    /// # impl Device for Pump {
    /// fn identification(&self, object: u8) -> Option<&[u8]> {
    ///     [&b"vendor"[..], b"pump", b"1.0"].get(usize::from(object)).copied()
    /// }
    /// # }
    /// ```
    fn identification(&self, object: u8) -> Option<&[u8]> {
        None
    }

    /// Any other function code: gets the bytes after it, and writes those of the response. Returns how
    /// many bytes the response has.
    ///
    /// # Errors
    /// As [`Device::read_coils`].
    ///
    /// ```
    /// # use mbm::server::Device;
    /// # use mbm::Exception;
    /// # struct Pump;
    /// # impl Device for Pump {
    /// fn custom(
    ///     &mut self,
    ///     function: u8,
    ///     data: &[u8],
    ///     response: &mut [u8],
    /// ) -> Result<usize, Exception> {
    ///     match (function, data, response) {
    ///         (65, [speed @ 0..=100], [place, ..]) => *place = *speed,
    ///         (65, ..) => return Err(Exception::IllegalDataValue),
    ///         _ => return Err(Exception::IllegalFunction),
    ///     }
    ///     Ok(1)
    /// }
    /// # }
    /// ```
    fn custom(
        &mut self,
        function: u8,
        data: &[u8],
        response: &mut [u8],
    ) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }
}

/// The coils or discrete inputs that a request reads. All are off at first.
///
/// ```
/// # use mbm::server::{BitsMut, Device};
/// # use mbm::Exception;
/// # struct Doors { open: [bool; 20] }
/// # impl Device for Doors {
/// fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
///     let open = self.open.get(usize::from(address)..).unwrap_or_default();
///     let open = open.get(..coils.len()).ok_or(Exception::IllegalDataAddress)?;
///     coils.set_all(open.iter().copied());
///     Ok(())
/// }
/// # }
/// ```
///
/// ```
/// use mbm::server::{BitsMut, Device};
/// use mbm::Exception;
///
/// struct Door {
///     is_open: bool,
/// }
///
/// impl Device for Door {
///     fn read_discrete_inputs(&mut self, address: u16, inputs: &mut BitsMut) -> Result<(), Exception> {
///         if address != 0 || inputs.is_empty() || inputs.len() > 1 {
///             return Err(Exception::IllegalDataAddress);
///         }
///         inputs.set(0, self.is_open);
///         Ok(())
///     }
/// }
/// ```
#[derive(Debug)]
pub struct BitsMut<'a> {
    bytes: &'a mut [u8],
    count: u16,
}

impl<'a> BitsMut<'a> {
    pub(super) fn new(bytes: &'a mut [u8], count: u16) -> Self {
        bytes.fill(0);
        BitsMut { bytes, count }
    }

    /// How many the request reads, 1 to 2000.
    pub fn len(&self) -> usize {
        self.count.into()
    }

    /// False: every request reads at least one.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Sets the one at `index`, 0 for the first; nothing if there is none.
    pub fn set(&mut self, index: usize, on: bool) {
        if index < self.len() {
            if let Some(byte) = self.bytes.get_mut(index / 8) {
                *byte = bits::Packed::with_bit(*byte, index % 8, on);
            }
        }
    }

    /// Sets them one after the other.
    pub fn set_all(&mut self, bits: impl IntoIterator<Item = bool>) {
        for (index, on) in (0..self.len()).zip(bits) {
            self.set(index, on);
        }
    }
}

/// The coils that a request writes.
///
/// ```
/// use mbm::server::{Bits, Device};
/// use mbm::Exception;
///
/// struct Relays {
///     on: [bool; 8],
/// }
///
/// impl Device for Relays {
///     fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
///         let first = usize::from(address);
///         let places = self.on.get_mut(first..first + coils.len());
///         for (place, on) in places.ok_or(Exception::IllegalDataAddress)?.iter_mut().zip(coils.iter()) {
///             *place = on;
///         }
///         // The first one, which every request has.
///         assert!(!coils.is_empty() && coils.get(0).is_some());
///         Ok(())
///     }
/// }
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bits<'a> {
    bytes: &'a [u8],
    count: u16,
}

impl<'a> Bits<'a> {
    pub(super) const fn new(bytes: &'a [u8], count: u16) -> Self {
        Bits { bytes, count }
    }

    /// How many the request writes, 1 to 1968.
    pub fn len(&self) -> usize {
        self.count.into()
    }

    /// False: every request writes at least one.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The one at `index`, 0 for the first; `None` if there is none.
    pub fn get(&self, index: usize) -> Option<bool> {
        let byte = self.bytes.get(index / 8).filter(|_| index < self.len())?;
        Some(bits::Packed::bit(*byte, index % 8))
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = bool> + 'a {
        let bits = *self;
        (0..self.len()).map_while(move |index| bits.get(index))
    }
}

/// A device that is borrowed is one too.
macro_rules! forwarded {
    ($($(#[$attribute:meta])* fn $name:ident(&mut self $(, $argument:ident: $type:ty)*) -> $result:ty;)*) => {
        impl<D: Device + ?Sized> Device for &mut D {
            $($(#[$attribute])* fn $name(&mut self $(, $argument: $type)*) -> $result {
                (**self).$name($($argument),*)
            })*

            fn identification(&self, object: u8) -> Option<&[u8]> {
                (**self).identification(object)
            }
        }
    };
}

forwarded! {
    fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception>;
    fn read_discrete_inputs(&mut self, address: u16, inputs: &mut BitsMut) -> Result<(), Exception>;
    fn read_holding_registers(&mut self, address: u16, registers: &mut [u16]) -> Result<(), Exception>;
    fn read_input_registers(&mut self, address: u16, registers: &mut [u16]) -> Result<(), Exception>;
    fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception>;
    fn write_holding_registers(&mut self, address: u16, registers: &[u16]) -> Result<(), Exception>;
    fn check_holding_registers(&mut self, address: u16, quantity: u16) -> Result<(), Exception>;
    fn read_exception_status(&mut self) -> Result<u8, Exception>;
    fn report_server_id(&mut self, data: &mut [u8]) -> Result<usize, Exception>;
    fn read_file_record(&mut self, file: u16, record: u16, records: &mut [u16]) -> Result<(), Exception>;
    fn write_file_record(&mut self, file: u16, record: u16, records: &[u16]) -> Result<(), Exception>;
    fn read_fifo_queue(&mut self, address: u16, queue: &mut [u16; 31]) -> Result<usize, Exception>;
    fn custom(&mut self, function: u8, data: &[u8], response: &mut [u8]) -> Result<usize, Exception>;
}

//! A device of arrays or slices.

use super::device::{Bits, BitsMut, Device};
use crate::bytes::copy;
use crate::error::Exception;

/// Values at consecutive addresses: an array, a slice or another container of them.
///
/// ```
/// use mbm::server::Table;
///
/// let registers = Table::new(107, [555, 100, 0, 0]);
/// assert_eq!((registers.base, registers.cells[0]), (107, 555));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Table<C> {
    /// Address of the first value.
    pub base: u16,
    /// The values.
    pub cells: C,
}

impl<C> Table<C> {
    /// Values from address `base` on.
    pub const fn new(base: u16, cells: C) -> Self {
        Table { base, cells }
    }
}

/// A device whose values are in arrays or slices: four tables, each of which may lack. A table without
/// a value is answered with exception 01.
///
/// ```
/// use mbm::server::{Table, Tables};
///
/// let mut tables = Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]);
/// tables.holding_registers.cells[2] = 888;
///
/// // The arrays may be slices of the program, and a `const` has all fields.
/// let mut coils = [false; 20];
/// let tables = Tables {
///     coils: Table::new(0, &mut coils[..]),
///     discrete_inputs: Tables::NONE.discrete_inputs,
///     holding_registers: Table::new(107, [555, 100, 0, 0]),
///     input_registers: Tables::NONE.input_registers,
/// };
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tables<C = [bool; 0], D = [bool; 0], H = [u16; 0], I = [u16; 0]> {
    /// Read by 01, written by 05 and 0F.
    pub coils: Table<C>,
    /// Read by 02.
    pub discrete_inputs: Table<D>,
    /// Read by 03, written by 06, 10, 16 and 17.
    pub holding_registers: Table<H>,
    /// Read by 04.
    pub input_registers: Table<I>,
}

impl Tables {
    /// No table: add those that the device has.
    pub const NONE: Tables = Tables {
        coils: Table::new(0, []),
        discrete_inputs: Table::new(0, []),
        holding_registers: Table::new(0, []),
        input_registers: Table::new(0, []),
    };
}

impl<C, D, H, I> Tables<C, D, H, I> {
    /// Has these coils, from address `base` on.
    ///
    /// ```
    /// use mbm::server::Tables;
    ///
    /// let pump = Tables::NONE.with_coils(0, [true, false]);
    /// assert_eq!(pump.coils.cells, [true, false]);
    /// ```
    pub fn with_coils<T: AsMut<[bool]>>(self, base: u16, coils: T) -> Tables<T, D, H, I> {
        Tables {
            coils: Table::new(base, coils),
            discrete_inputs: self.discrete_inputs,
            holding_registers: self.holding_registers,
            input_registers: self.input_registers,
        }
    }

    /// Has these discrete inputs, from address `base` on.
    ///
    /// ```
    /// use mbm::server::Tables;
    ///
    /// let pump = Tables::NONE.with_discrete_inputs(0, [true, false]);
    /// assert_eq!(pump.discrete_inputs.cells, [true, false]);
    /// ```
    pub fn with_discrete_inputs<T: AsMut<[bool]>>(
        self,
        base: u16,
        inputs: T,
    ) -> Tables<C, T, H, I> {
        Tables {
            coils: self.coils,
            discrete_inputs: Table::new(base, inputs),
            holding_registers: self.holding_registers,
            input_registers: self.input_registers,
        }
    }

    /// Has these holding registers, from address `base` on.
    pub fn with_holding_registers<T: AsMut<[u16]>>(
        self,
        base: u16,
        registers: T,
    ) -> Tables<C, D, T, I> {
        Tables {
            coils: self.coils,
            discrete_inputs: self.discrete_inputs,
            holding_registers: Table::new(base, registers),
            input_registers: self.input_registers,
        }
    }

    /// Has these input registers, from address `base` on.
    ///
    /// ```
    /// use mbm::server::Tables;
    ///
    /// let meter = Tables::NONE.with_input_registers(0, [21, 22]);
    /// assert_eq!(meter.input_registers.cells, [21, 22]);
    /// ```
    pub fn with_input_registers<T: AsMut<[u16]>>(
        self,
        base: u16,
        registers: T,
    ) -> Tables<C, D, H, T> {
        Tables {
            coils: self.coils,
            discrete_inputs: self.discrete_inputs,
            holding_registers: self.holding_registers,
            input_registers: Table::new(base, registers),
        }
    }
}

/// `count` values of a table from `address` on. A table without values does not serve its functions.
fn cells<T>(
    table: &mut Table<impl AsMut<[T]>>,
    address: u16,
    count: usize,
) -> Result<&mut [T], Exception> {
    let first = address.checked_sub(table.base).map(usize::from);
    match table.cells.as_mut() {
        [] => Err(Exception::IllegalFunction),
        cells => first
            .and_then(|first| cells.get_mut(first..)?.get_mut(..count))
            .ok_or(Exception::IllegalDataAddress),
    }
}

impl<C, D, H, I> Device for Tables<C, D, H, I>
where
    C: AsMut<[bool]>,
    D: AsMut<[bool]>,
    H: AsMut<[u16]>,
    I: AsMut<[u16]>,
{
    fn read_coils(&mut self, address: u16, coils: &mut BitsMut) -> Result<(), Exception> {
        let cells = cells(&mut self.coils, address, coils.len())?;
        coils.set_all(cells.iter().copied());
        Ok(())
    }

    fn read_discrete_inputs(
        &mut self,
        address: u16,
        inputs: &mut BitsMut,
    ) -> Result<(), Exception> {
        let cells = cells(&mut self.discrete_inputs, address, inputs.len())?;
        inputs.set_all(cells.iter().copied());
        Ok(())
    }

    fn read_holding_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        let cells = cells(&mut self.holding_registers, address, registers.len())?;
        copy(registers, cells);
        Ok(())
    }

    fn read_input_registers(
        &mut self,
        address: u16,
        registers: &mut [u16],
    ) -> Result<(), Exception> {
        let cells = cells(&mut self.input_registers, address, registers.len())?;
        copy(registers, cells);
        Ok(())
    }

    fn write_coils(&mut self, address: u16, coils: &Bits) -> Result<(), Exception> {
        let cells = cells(&mut self.coils, address, coils.len())?;
        for (cell, on) in cells.iter_mut().zip(coils.iter()) {
            *cell = on;
        }
        Ok(())
    }

    fn write_holding_registers(
        &mut self,
        address: u16,
        registers: &[u16],
    ) -> Result<(), Exception> {
        let cells = cells(&mut self.holding_registers, address, registers.len())?;
        copy(cells, registers);
        Ok(())
    }
}

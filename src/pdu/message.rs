//! The content of request and response PDUs. [`super::request`] and [`super::response`] parse
//! and write them, with one file for each family of functions.

use super::objects::ObjectList;
use super::records::{Reads, Records, Writes};

/// A request PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Request<'a> {
    /// 01 or 02.
    ReadBits {
        function: u8,
        address: u16,
        quantity: u16,
    },
    /// 03 or 04.
    ReadRegisters {
        function: u8,
        address: u16,
        quantity: u16,
    },
    WriteSingleCoil {
        address: u16,
        on: bool,
    },
    WriteSingleRegister {
        address: u16,
        value: u16,
    },
    ReadExceptionStatus,
    Diagnostics {
        sub_function: u16,
        data: &'a [u8],
    },
    GetCommEventCounter,
    GetCommEventLog,
    WriteMultipleCoils {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    WriteMultipleRegisters {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    ReportServerId,
    ReadFileRecord(Reads<'a>),
    WriteFileRecord(Writes<'a>),
    MaskWriteRegister {
        address: u16,
        and_mask: u16,
        or_mask: u16,
    },
    ReadWriteMultipleRegisters {
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
        data: &'a [u8],
    },
    ReadFifoQueue {
        address: u16,
    },
    ReadDeviceIdentification {
        code: u8,
        object: u8,
    },
    /// 2B with any other MEI type.
    EncapsulatedInterface {
        mei_type: u8,
        data: &'a [u8],
    },
    /// A user-defined function.
    Custom {
        function: u8,
        data: &'a [u8],
    },
}

/// A response PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Response<'a> {
    /// 01 or 02.
    ReadBits {
        function: u8,
        data: &'a [u8],
    },
    /// 03, 04 or 17.
    ReadRegisters {
        function: u8,
        data: &'a [u8],
    },
    WriteSingleCoil {
        address: u16,
        on: bool,
    },
    WriteSingleRegister {
        address: u16,
        value: u16,
    },
    /// 07.
    ExceptionStatus {
        outputs: u8,
    },
    Diagnostics {
        sub_function: u16,
        data: &'a [u8],
    },
    /// 0B. The status word is FFFF while the device executes a program command.
    CommEventCounter {
        status: u16,
        events: u16,
    },
    /// 0C. The latest event is the first in `log`.
    CommEventLog {
        status: u16,
        events: u16,
        messages: u16,
        log: &'a [u8],
    },
    /// 0F or 10.
    WriteMultiple {
        function: u8,
        address: u16,
        quantity: u16,
    },
    /// 11. In some devices, the byte count `count` covers only the front of `data`.
    ServerId {
        count: u8,
        data: &'a [u8],
    },
    ReadFileRecord(Records<'a>),
    WriteFileRecord(Writes<'a>),
    MaskWriteRegister {
        address: u16,
        and_mask: u16,
        or_mask: u16,
    },
    /// 18.
    FifoQueue {
        data: &'a [u8],
    },
    /// 2B/0E.
    DeviceIdentification {
        code: u8,
        conformity: u8,
        more_follows: bool,
        next_object: u8,
        objects: ObjectList<'a>,
    },
    /// 2B with any other MEI type.
    EncapsulatedInterface {
        mei_type: u8,
        data: &'a [u8],
    },
    /// The function code of the request, without the highest bit, and the exception code.
    Exception {
        function: u8,
        code: u8,
    },
    /// A user-defined function.
    Custom {
        function: u8,
        data: &'a [u8],
    },
}

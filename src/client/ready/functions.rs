//! The requests of the functions beside the ten that read and write the four tables.

use super::{Request, Slice};
use crate::error::{Error, Status};
use crate::pdu::custom::Rule;
use crate::pdu::functions::FunctionSpec;
use crate::pdu::identification::DeviceIdCode;
use crate::pdu::quantity;

impl<'a> Request<'a> {
    /// 07: reads the eight exception status outputs, the first in the lowest bit. See
    /// [`Request::bytes`].
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut outputs = [0];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_exception_status(17, &mut outputs)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_exception_status(unit: u8, outputs: &'a mut [u8; 1]) -> Result<Self, Error> {
        let spec = FunctionSpec::READ_EXCEPTION_STATUS;
        Request::short(unit, spec, (0, 0), Slice::None, Slice::Bytes(outputs))
    }

    /// 08: sends words with a sub-function, and takes as many: one, for sub-function 0 (Return Query
    /// Data) 1 to 125. No device answers sub-function 4, Force Listen Only Mode.
    ///
    /// ```
    /// use mbm::client::Request;
    ///
    /// // Sub-function 0: the device returns the words.
    /// let (mut data, mut echo) = ([0xA537], [0]);
    /// let request = Request::diagnostics(17, 0, &mut data, &mut echo)?;
    /// # Ok::<(), mbm::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Request::read_coils`]; [`Error::BufferTooSmall`] if `takes` has fewer words than `data`.
    pub fn diagnostics(
        unit: u8,
        sub_function: u16,
        data: &'a mut [u16],
        takes: &'a mut [u16],
    ) -> Result<Self, Error> {
        let words = quantity(data.len());
        let (data, takes) = (Slice::Registers(data), Slice::Registers(takes));
        Request::build(unit, data, takes, |state| {
            state.diagnostics(sub_function, words)
        })
    }

    /// 0B: reads the status word and the event counter, two words.
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut words = [0; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::get_comm_event_counter(17, &mut words)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn get_comm_event_counter(unit: u8, words: &'a mut [u16; 2]) -> Result<Self, Error> {
        let spec = FunctionSpec::GET_COMM_EVENT_COUNTER;
        Request::short(unit, spec, (0, 0), Slice::None, Slice::Registers(words))
    }

    /// 0C: reads status, event counter and message counter, two bytes each, and up to 64 events. See
    /// [`Request::bytes`].
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut log = [0; mbm::client::CommEventLog::BYTES];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::get_comm_event_log(17, &mut log)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn get_comm_event_log(unit: u8, log: &'a mut [u8]) -> Result<Self, Error> {
        let spec = FunctionSpec::GET_COMM_EVENT_LOG;
        Request::short(unit, spec, (0, 0), Slice::None, Slice::Bytes(log))
    }

    /// 11: reads what the device says about itself, in a form that its manual explains. See
    /// [`Request::bytes`].
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut id = [0; 250];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::report_server_id(17, &mut id)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn report_server_id(unit: u8, id: &'a mut [u8]) -> Result<Self, Error> {
        let spec = FunctionSpec::REPORT_SERVER_ID;
        Request::short(unit, spec, (0, 0), Slice::None, Slice::Bytes(id))
    }

    /// 14: reads 1 to 121 consecutive records of a file, as many as `records` has. See
    /// [`Request::registers`].
    ///
    /// # Errors
    /// As [`Request::read_coils`]. The file numbers begin with 1, and the last record is 9999.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut records = [0; 3];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_file_record(17, 4, 7, &mut records)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_file_record(
        unit: u8,
        file: u16,
        record: u16,
        records: &'a mut [u16],
    ) -> Result<Self, Error> {
        let count = quantity(records.len());
        Request::build(unit, Slice::None, Slice::Registers(records), |state| {
            state.read_file_record(file, record, count)
        })
    }

    /// 15: writes 1 to 122 consecutive records of a file.
    ///
    /// # Errors
    /// As [`Request::read_file_record`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut records = [555, 100];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_file_record(17, 4, 7, &mut records)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_file_record(
        unit: u8,
        file: u16,
        record: u16,
        records: &'a mut [u16],
    ) -> Result<Self, Error> {
        let count = quantity(records.len());
        Request::build(unit, Slice::Registers(records), Slice::None, |state| {
            state.write_file_record(file, record, count)
        })
    }

    /// 14 with several groups, as bytes on the wire, as [`crate::packet::groups`] builds them. The
    /// response has of each group its length, the reference type 6, and the records. See
    /// [`Request::bytes`]. [`BlockingClient`](crate::client::BlockingClient) has the groups as slices.
    ///
    /// # Errors
    /// [`Error::InvalidQuantity`] for a number of bytes that the standard does not allow.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// // Two records of file 4 from 7 on, and one of file 3.
    /// let mut groups = [6, 0, 4, 0, 7, 0, 2, 6, 0, 3, 0, 9, 0, 1];
    /// let mut records = [0; 250];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_file_records(17, &mut groups, &mut records)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_file_records(
        unit: u8,
        groups: &'a mut [u8],
        records: &'a mut [u8],
    ) -> Result<Self, Error> {
        let bytes = quantity(groups.len());
        let (groups, records) = (Slice::Bytes(groups), Slice::Bytes(records));
        Request::build(unit, groups, records, |state| {
            state.read_file_records(bytes)
        })
    }

    /// 15 with several groups, as bytes on the wire.
    ///
    /// # Errors
    /// As [`Request::read_file_records`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// // Writes 555 into record 7 of file 4.
    /// let mut groups = [6, 0, 4, 0, 7, 0, 1, 0x02, 0x2B];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_file_records(17, &mut groups)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_file_records(unit: u8, groups: &'a mut [u8]) -> Result<Self, Error> {
        let bytes = quantity(groups.len());
        Request::build(unit, Slice::Bytes(groups), Slice::None, |state| {
            state.write_file_records(bytes)
        })
    }

    /// 18: reads a queue of up to 31 registers. See [`Request::registers`].
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut queue = [0; 31];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_fifo_queue(17, 1000, &mut queue)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_fifo_queue(unit: u8, address: u16, queue: &'a mut [u16]) -> Result<Self, Error> {
        let spec = FunctionSpec::READ_FIFO_QUEUE;
        Request::short(
            unit,
            spec,
            (address, 0),
            Slice::None,
            Slice::Registers(queue),
        )
    }

    /// 2B/0E: reads objects that identify the device, from `object` on. 250 bytes hold any response.
    /// [`IdentificationReply::parse`](crate::pdu::identification::IdentificationReply::parse) takes
    /// [`Request::bytes`] apart.
    ///
    /// # Errors
    /// None.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// use mbm::pdu::identification::DeviceIdCode;
    ///
    /// let mut objects = [0; 250];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_device_identification(17, DeviceIdCode::Basic, 0, &mut objects)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_device_identification(
        unit: u8,
        code: DeviceIdCode,
        object: u8,
        objects: &'a mut [u8],
    ) -> Result<Self, Error> {
        Request::build(unit, Slice::None, Slice::Bytes(objects), |state| {
            state.read_device_identification(code as u8, object)
        })
    }

    /// 2B with any MEI type, for example 0D (hex), CANopen: sends `data` after it, and takes the bytes
    /// after the MEI type of the response. See [`Request::bytes`]. On an RTU line, silence ends the
    /// response.
    ///
    /// # Errors
    /// [`Error::InvalidQuantity`] for more than 251 bytes.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let (mut data, mut takes) = ([1, 2], [0; 250]);
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::encapsulated_interface_transport(17, 0x0D, &mut data, &mut takes)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn encapsulated_interface_transport(
        unit: u8,
        mei_type: u8,
        data: &'a mut [u8],
        takes: &'a mut [u8],
    ) -> Result<Self, Error> {
        let bytes = quantity(data.len());
        let (data, takes) = (Slice::Bytes(data), Slice::Bytes(takes));
        Request::build(unit, data, takes, |state| {
            state.encapsulated(mei_type, bytes)
        })
    }

    /// Any function code, 1 to 127: sends `data` after it, and takes the bytes after the function code
    /// of the response. `response` says how long that is. See [`Request::bytes`].
    ///
    /// ```
    /// use mbm::client::Request;
    /// use mbm::pdu::custom::Rule;
    ///
    /// // The byte after the function code of the response counts those that follow.
    /// let (mut data, mut takes) = ([3, 7, 8, 9], [0; 16]);
    /// let request = Request::custom(17, 0x41, &mut data, Rule::Counted(1, 0), &mut takes)?;
    /// # Ok::<(), mbm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for another function code, and for a rule that no response meets;
    /// [`Error::InvalidQuantity`] for more than 252 bytes.
    pub fn custom(
        unit: u8,
        function: u8,
        data: &'a mut [u8],
        response: Rule,
        takes: &'a mut [u8],
    ) -> Result<Self, Error> {
        let bytes = quantity(data.len());
        let (data, takes) = (Slice::Bytes(data), Slice::Bytes(takes));
        Request::build(unit, data, takes, |state| {
            state.custom(function, bytes, response)
        })
    }

    /// A request that has arrived from elsewhere: a function code, and the bytes after it. It takes
    /// the bytes after the function code of the response, which must match the request, as for the
    /// other functions. See [`Request::bytes`].
    ///
    /// # Errors
    /// [`Error::InvalidArgument`], [`Error::InvalidQuantity`] or [`Error::InvalidAddress`] for a
    /// request that no device could accept.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// // Reads two registers from 107 on.
    /// let (mut body, mut takes) = ([0, 107, 0, 2], [0; 250]);
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::forward(17, 3, &mut body, &mut takes)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn forward(
        unit: u8,
        function: u8,
        body: &'a mut [u8],
        takes: &'a mut [u8],
    ) -> Result<Self, Error> {
        let mut request = Request::build(unit, Slice::None, Slice::Bytes(takes), |state| {
            match u8::try_from(body.len()) {
                Ok(_) => state.forward(function, body),
                // A longer body is refused by its length, which must not wrap.
                Err(_) => Status::ILLEGAL_DATA_VALUE,
            }
        })?;
        let head = body
            .len()
            .saturating_sub(request.state.data_length().into());
        request.sends = Slice::Bytes(body.get_mut(head..).unwrap_or_default());
        Ok(request)
    }
}

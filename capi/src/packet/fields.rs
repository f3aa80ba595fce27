//! The fields of the flat packet that each request or response uses.

use super::{mbm_packet, MBM_PACKET_EXCEPTION, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use crate::functions::*;
use mbm::error::Error;
use mbm::packet::refusal::Head;
use mbm::pdu::files::{Reads, Records, Writes};
use mbm::pdu::functions;
use mbm::pdu::identification::ObjectList;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use mbm::pdu::EXCEPTION;

impl mbm_packet {
    /// A packet with all fields zero.
    pub(crate) const NONE: mbm_packet = mbm_packet {
        data: core::ptr::null(),
        dataLength: 0,
        transaction: 0,
        address: 0,
        quantity: 0,
        writeAddress: 0,
        writeQuantity: 0,
        value: 0,
        andMask: 0,
        orMask: 0,
        subFunction: 0,
        commStatus: 0,
        eventCount: 0,
        messageCount: 0,
        kind: 0,
        unit: 0,
        function: 0,
        exceptionCode: 0,
        exceptionStatus: 0,
        byteCount: 0,
        meiType: 0,
        readDeviceIdCode: 0,
        objectId: 0,
        conformity: 0,
        moreFollows: 0,
        nextObjectId: 0,
        objectCount: 0,
    };

    /// A packet with the kind and the function code of a PDU; all other fields are zero.
    pub(crate) fn of(kind: u8, pdu: &[u8]) -> mbm_packet {
        let function = pdu.first().copied().unwrap_or_default();
        mbm_packet {
            kind,
            function,
            ..mbm_packet::NONE
        }
    }

    /// The transaction, the unit and the function code, if the unit is one.
    pub(crate) fn head(&self) -> Result<Head, Error> {
        Ok(Head {
            transaction: self.transaction,
            unit: self.unit.try_into().or(Err(Error::INVALID_ARGUMENT))?,
            function: self.function,
        })
    }

    fn set_data(&mut self, data: &[u8]) {
        self.data = data.as_ptr();
        self.dataLength = data.len() as u16;
    }

    /// Sets the fields that a request has.
    pub(crate) fn take_request(&mut self, request: &Request) {
        self.kind = MBM_PACKET_REQUEST;
        self.function = request.function();
        match *request {
            Request::ReadBits {
                address, quantity, ..
            }
            | Request::ReadRegisters {
                address, quantity, ..
            } => {
                self.address = address;
                self.quantity = quantity;
            }
            Request::WriteSingleCoil { address, on } => {
                self.address = address;
                self.value = on.into();
            }
            Request::WriteSingleRegister { address, value } => {
                self.address = address;
                self.value = value;
            }
            Request::ReadExceptionStatus
            | Request::GetCommEventCounter
            | Request::GetCommEventLog
            | Request::ReportServerId => {}
            Request::Diagnostics { sub_function, data } => {
                self.subFunction = sub_function;
                self.set_data(data);
            }
            Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            }
            | Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            } => {
                self.address = address;
                self.quantity = quantity;
                self.set_data(data);
            }
            Request::ReadFileRecord(reads) => self.set_data(reads.bytes()),
            Request::WriteFileRecord(writes) => self.set_data(writes.bytes()),
            Request::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => {
                self.address = address;
                self.andMask = and_mask;
                self.orMask = or_mask;
            }
            Request::ReadWriteMultipleRegisters {
                read_address,
                read_quantity,
                write_address,
                write_quantity,
                data,
            } => {
                self.address = read_address;
                self.quantity = read_quantity;
                self.writeAddress = write_address;
                self.writeQuantity = write_quantity;
                self.set_data(data);
            }
            Request::ReadFifoQueue { address } => self.address = address,
            Request::ReadDeviceIdentification { code, object } => {
                self.meiType = MBM_MEI_READ_DEVICE_IDENTIFICATION;
                self.readDeviceIdCode = code;
                self.objectId = object;
            }
            Request::EncapsulatedInterface { mei_type, data } => {
                self.meiType = mei_type;
                self.set_data(data);
            }
            Request::Custom { data, .. } => self.set_data(data),
        }
    }

    /// Sets the fields that a response has.
    pub(crate) fn take_response(&mut self, response: &Response) {
        self.kind = MBM_PACKET_RESPONSE;
        self.function = response.function();
        match *response {
            Response::ReadBits { data, .. }
            | Response::ReadRegisters { data, .. }
            | Response::FifoQueue { data }
            | Response::Custom { data, .. } => self.set_data(data),
            Response::WriteSingleCoil { address, on } => {
                self.address = address;
                self.value = on.into();
            }
            Response::WriteSingleRegister { address, value } => {
                self.address = address;
                self.value = value;
            }
            Response::ExceptionStatus { outputs } => self.exceptionStatus = outputs,
            Response::Diagnostics { sub_function, data } => {
                self.subFunction = sub_function;
                self.set_data(data);
            }
            Response::CommEventCounter { status, events } => {
                self.commStatus = status;
                self.eventCount = events;
            }
            Response::CommEventLog {
                status,
                events,
                messages,
                log,
            } => {
                self.commStatus = status;
                self.eventCount = events;
                self.messageCount = messages;
                self.set_data(log);
            }
            Response::WriteMultiple {
                address, quantity, ..
            } => {
                self.address = address;
                self.quantity = quantity;
            }
            Response::ServerId { count, data } => {
                self.byteCount = count;
                self.set_data(data);
            }
            Response::ReadFileRecord(records) => self.set_data(records.bytes()),
            Response::WriteFileRecord(writes) => self.set_data(writes.bytes()),
            Response::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => {
                self.address = address;
                self.andMask = and_mask;
                self.orMask = or_mask;
            }
            Response::DeviceIdentification {
                code,
                conformity,
                more_follows,
                next_object,
                objects,
            } => {
                self.meiType = MBM_MEI_READ_DEVICE_IDENTIFICATION;
                self.readDeviceIdCode = code;
                self.conformity = conformity;
                self.moreFollows = more_follows.into();
                self.nextObjectId = next_object;
                self.objectCount = objects.count();
                self.set_data(objects.bytes());
            }
            Response::EncapsulatedInterface { mei_type, data } => {
                self.meiType = mei_type;
                self.set_data(data);
            }
            Response::Exception { code, .. } => {
                self.kind = MBM_PACKET_EXCEPTION;
                self.exceptionCode = code;
            }
        }
    }

    /// The request that the fields describe, with `data` as its data.
    pub(crate) fn request<'a>(&self, data: &'a [u8]) -> Result<Request<'a>, Error> {
        let (function, address, quantity) = (self.function, self.address, self.quantity);
        Ok(match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => Request::ReadBits {
                function,
                address,
                quantity,
            },
            functions::READ_HOLDING_REGISTERS | functions::READ_INPUT_REGISTERS => {
                Request::ReadRegisters {
                    function,
                    address,
                    quantity,
                }
            }
            functions::WRITE_SINGLE_COIL => Request::WriteSingleCoil {
                address,
                on: self.value != 0,
            },
            functions::WRITE_SINGLE_REGISTER => Request::WriteSingleRegister {
                address,
                value: self.value,
            },
            functions::READ_EXCEPTION_STATUS => Request::ReadExceptionStatus,
            functions::DIAGNOSTICS => Request::Diagnostics {
                sub_function: self.subFunction,
                data,
            },
            functions::GET_COMM_EVENT_COUNTER => Request::GetCommEventCounter,
            functions::GET_COMM_EVENT_LOG => Request::GetCommEventLog,
            functions::WRITE_MULTIPLE_COILS => Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            },
            functions::WRITE_MULTIPLE_REGISTERS => Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            },
            functions::REPORT_SERVER_ID => Request::ReportServerId,
            functions::READ_FILE_RECORD => Request::ReadFileRecord(Reads::new(data)?),
            functions::WRITE_FILE_RECORD => Request::WriteFileRecord(Writes::new(data)?),
            functions::MASK_WRITE_REGISTER => Request::MaskWriteRegister {
                address,
                and_mask: self.andMask,
                or_mask: self.orMask,
            },
            functions::READ_WRITE_MULTIPLE_REGISTERS => Request::ReadWriteMultipleRegisters {
                read_address: address,
                read_quantity: quantity,
                write_address: self.writeAddress,
                write_quantity: self.writeQuantity,
                data,
            },
            functions::READ_FIFO_QUEUE => Request::ReadFifoQueue { address },
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => match self.meiType {
                MBM_MEI_READ_DEVICE_IDENTIFICATION => Request::ReadDeviceIdentification {
                    code: self.readDeviceIdCode,
                    object: self.objectId,
                },
                mei_type => Request::EncapsulatedInterface { mei_type, data },
            },
            _ => Request::Custom { function, data },
        })
    }

    /// The response or exception that the fields describe, with `data` as its data.
    pub(crate) fn response<'a>(&self, data: &'a [u8]) -> Result<Response<'a>, Error> {
        let (function, address, quantity) = (self.function, self.address, self.quantity);
        match self.kind {
            MBM_PACKET_EXCEPTION if function & EXCEPTION != 0 => {
                return Err(Error::INVALID_FUNCTION)
            }
            MBM_PACKET_EXCEPTION => {
                return Ok(Response::Exception {
                    function,
                    code: self.exceptionCode,
                })
            }
            MBM_PACKET_RESPONSE => {}
            _ => return Err(Error::INVALID_ARGUMENT),
        }
        let malformed = |_| Error::MALFORMED_REPLY;
        Ok(match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => {
                Response::ReadBits { function, data }
            }
            functions::READ_HOLDING_REGISTERS
            | functions::READ_INPUT_REGISTERS
            | functions::READ_WRITE_MULTIPLE_REGISTERS => {
                Response::ReadRegisters { function, data }
            }
            functions::WRITE_SINGLE_COIL => Response::WriteSingleCoil {
                address,
                on: self.value != 0,
            },
            functions::WRITE_SINGLE_REGISTER => Response::WriteSingleRegister {
                address,
                value: self.value,
            },
            functions::READ_EXCEPTION_STATUS => Response::ExceptionStatus {
                outputs: self.exceptionStatus,
            },
            functions::DIAGNOSTICS => Response::Diagnostics {
                sub_function: self.subFunction,
                data,
            },
            functions::GET_COMM_EVENT_COUNTER => Response::CommEventCounter {
                status: self.commStatus,
                events: self.eventCount,
            },
            functions::GET_COMM_EVENT_LOG => Response::CommEventLog {
                status: self.commStatus,
                events: self.eventCount,
                messages: self.messageCount,
                log: data,
            },
            functions::WRITE_MULTIPLE_COILS | functions::WRITE_MULTIPLE_REGISTERS => {
                Response::WriteMultiple {
                    function,
                    address,
                    quantity,
                }
            }
            functions::REPORT_SERVER_ID => Response::ServerId {
                count: self.byteCount,
                data,
            },
            functions::READ_FILE_RECORD => {
                Response::ReadFileRecord(Records::new(data).map_err(malformed)?)
            }
            functions::WRITE_FILE_RECORD => {
                Response::WriteFileRecord(Writes::new(data).map_err(malformed)?)
            }
            functions::MASK_WRITE_REGISTER => Response::MaskWriteRegister {
                address,
                and_mask: self.andMask,
                or_mask: self.orMask,
            },
            functions::READ_FIFO_QUEUE => Response::FifoQueue { data },
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => match self.meiType {
                MBM_MEI_READ_DEVICE_IDENTIFICATION => Response::DeviceIdentification {
                    code: self.readDeviceIdCode,
                    conformity: self.conformity,
                    more_follows: self.moreFollows != 0,
                    next_object: self.nextObjectId,
                    objects: ObjectList::new(self.objectCount, data).map_err(malformed)?,
                },
                mei_type => Response::EncapsulatedInterface { mei_type, data },
            },
            _ => Response::Custom { function, data },
        })
    }
}

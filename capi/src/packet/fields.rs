//! The fields of the flat packet, taken from a request or response, or given to one.

use super::{mbm_packet, MBM_PACKET_EXCEPTION, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use mbm::error::Error;
use mbm::packet::refusal::Head;
use mbm::pdu::fields::{Byte, Data, Fields, Flag, Word};
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
            unit: self.unit.try_into().or(Err(Error::InvalidArgument))?,
            function: self.function,
        })
    }

    /// Sets the fields that a request has.
    pub(crate) fn take_request(&mut self, request: &Request) {
        self.kind = MBM_PACKET_REQUEST;
        self.function = request.function();
        request.give(self);
    }

    /// Sets the fields that a response has.
    pub(crate) fn take_response(&mut self, response: &Response) {
        self.kind = match response {
            Response::Exception { .. } => MBM_PACKET_EXCEPTION,
            _ => MBM_PACKET_RESPONSE,
        };
        self.function = response.function();
        response.give(self);
    }

    /// The request that the fields describe, with `data` as its data.
    pub(crate) fn request<'a>(&mut self, data: &'a [u8]) -> Result<Request<'a>, Error> {
        let function = self.function;
        Request::take(function, &mut PacketWithData { packet: self, data })
    }

    /// The response or exception that the fields describe, with `data` as its data.
    pub(crate) fn response<'a>(&mut self, data: &'a [u8]) -> Result<Response<'a>, Error> {
        let function = self.function;
        match self.kind {
            MBM_PACKET_RESPONSE => {
                Response::take(function, &mut PacketWithData { packet: self, data })
            }
            MBM_PACKET_EXCEPTION if function & EXCEPTION != 0 => Err(Error::InvalidFunction),
            MBM_PACKET_EXCEPTION => Ok(Response::Exception {
                function,
                code: self.exceptionCode,
            }),
            _ => Err(Error::InvalidArgument),
        }
    }

    fn byte_at(&mut self, field: Byte) -> &mut u8 {
        match field {
            Byte::ExceptionCode => &mut self.exceptionCode,
            Byte::ExceptionStatus => &mut self.exceptionStatus,
            Byte::ByteCount => &mut self.byteCount,
            Byte::MeiType => &mut self.meiType,
            Byte::ReadDeviceIdCode => &mut self.readDeviceIdCode,
            Byte::ObjectId => &mut self.objectId,
            Byte::Conformity => &mut self.conformity,
            Byte::NextObjectId => &mut self.nextObjectId,
            Byte::ObjectCount => &mut self.objectCount,
        }
    }

    fn word_at(&mut self, field: Word) -> &mut u16 {
        match field {
            Word::Address | Word::ReadAddress => &mut self.address,
            Word::Quantity => &mut self.quantity,
            Word::WriteAddress => &mut self.writeAddress,
            Word::WriteQuantity => &mut self.writeQuantity,
            Word::Value => &mut self.value,
            Word::AndMask => &mut self.andMask,
            Word::OrMask => &mut self.orMask,
            Word::SubFunction => &mut self.subFunction,
            Word::CommStatus => &mut self.commStatus,
            Word::EventCount => &mut self.eventCount,
            Word::MessageCount => &mut self.messageCount,
        }
    }
}

/// Takes the fields of a request or response.
impl<'a> Fields<'a> for mbm_packet {
    const IS_SOURCE: bool = false;

    fn byte(&mut self, field: Byte, value: &mut u8) {
        *self.byte_at(field) = *value;
    }

    fn word(&mut self, field: Word, value: &mut u16) {
        *self.word_at(field) = *value;
    }

    fn flag(&mut self, field: Flag, value: &mut bool) {
        match field {
            Flag::Coil => self.value = (*value).into(),
            Flag::MoreFollows => self.moreFollows = (*value).into(),
        }
    }

    fn counted(&mut self, kind: Data, data: &mut &'a [u8]) {
        self.rest(kind, data);
    }

    fn rest(&mut self, _: Data, data: &mut &'a [u8]) {
        self.data = data.as_ptr();
        self.dataLength = data.len() as u16;
    }
}

/// A packet, and the data to which it points.
struct PacketWithData<'p, 'a> {
    packet: &'p mut mbm_packet,
    data: &'a [u8],
}

/// Gives the fields of a request or response.
impl<'a> Fields<'a> for PacketWithData<'_, 'a> {
    const IS_SOURCE: bool = true;

    fn byte(&mut self, field: Byte, value: &mut u8) {
        *value = *self.packet.byte_at(field);
    }

    fn word(&mut self, field: Word, value: &mut u16) {
        *value = *self.packet.word_at(field);
    }

    fn flag(&mut self, field: Flag, value: &mut bool) {
        *value = match field {
            Flag::Coil => self.packet.value != 0,
            Flag::MoreFollows => self.packet.moreFollows != 0,
        };
    }

    fn counted(&mut self, kind: Data, data: &mut &'a [u8]) {
        self.rest(kind, data);
    }

    fn rest(&mut self, _: Data, data: &mut &'a [u8]) {
        *data = self.data;
    }
}

//! Reads a device identification to its end (clause 6.21): each reply that does not have all
//! objects names the object to request next.

use super::identification::{IdentificationReply, INDIVIDUAL};
use crate::error::Error;

/// The request that follows a reply.
///
/// ```
/// use mbm::pdu::identification::{IdentificationReply, BASIC};
/// use mbm::pdu::identification_stream::{Next, ObjectStream};
///
/// // More follows, but the device names the object again that it has sent.
/// let reply = IdentificationReply::parse(BASIC, b"\x01\xFF\0\x01\0\x03mbm")?;
/// assert_eq!(ObjectStream::new(BASIC, 0).take(&reply), Ok(Next::Stuck));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// Nothing: all objects were read.
    End,
    /// A request for the objects from this one on.
    Request(u8),
    /// More objects follow, but the device names one that cannot follow those that it has sent:
    /// reading on would never end.
    Stuck,
}

/// The state of reading the objects of one device.
///
/// ```
/// use mbm::pdu::identification::{IdentificationReply, BASIC};
/// use mbm::pdu::identification_stream::{Next, ObjectStream};
///
/// let mut stream = ObjectStream::new(BASIC, 0);
/// let first = IdentificationReply::parse(stream.code(), b"\x01\xFF\x01\x01\0\x03mbm")?;
/// assert_eq!(stream.take(&first), Ok(Next::Request(1)));
/// let last = IdentificationReply::parse(stream.code(), b"\x01\0\0\x01\x01\x011")?;
/// assert_eq!(stream.take(&last), Ok(Next::End));
/// # Ok::<(), mbm::Error>(())
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ObjectStream {
    code: u8,
    /// The object that the last request named.
    requested: u8,
    /// The least id that the next reply may have: that of the requested object, except in the
    /// first request.
    least: u16,
}

impl ObjectStream {
    /// Begins with the request of `code`, one of BASIC to INDIVIDUAL, for `object`.
    pub const fn new(code: u8, object: u8) -> Self {
        ObjectStream {
            code,
            requested: object,
            least: 0,
        }
    }

    /// The read device id code of every request.
    pub const fn code(&self) -> u8 {
        self.code
    }

    /// Takes the reply to the last request. Its objects may be used only if the result is no
    /// error.
    ///
    /// The ids of one reply may be in any order. The first reply may begin before the
    /// requested object: a device that does not have that object begins with the first one.
    ///
    /// # Errors
    /// [`Error::MalformedReply`] if a request for one object was answered with another.
    /// [`Error::NoProgress`] if a later reply has an object before the one that the device
    /// itself named. On an error nothing changes.
    pub fn take(&mut self, reply: &IdentificationReply) -> Result<Next, Error> {
        let mut least = self.least;
        for (id, _) in reply.objects.iter() {
            if self.code == INDIVIDUAL && id != self.requested {
                return Err(Error::MalformedReply);
            }
            let id = u16::from(id);
            if id < self.least {
                return Err(Error::NoProgress);
            }
            least = least.max(id + 1);
        }
        self.least = least;
        let next = reply.next_object;
        if !reply.more_follows {
            return Ok(Next::End);
        }
        // Without an object, the next one would be the same again.
        if reply.objects.count() == 0 || u16::from(next) < least {
            return Ok(Next::Stuck);
        }
        self.requested = next;
        self.least = next.into();
        Ok(Next::Request(next))
    }
}

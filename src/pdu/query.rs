//! A request as the facade keeps it: built head first, sent with the caller's
//! words behind it.

use crate::data::{Send, Take};
use crate::error::Status;

/// Function code, and at most four words of address and quantity.
const HEAD: usize = 9;

/// A request as its sender keeps it until the response is there: the fixed head,
/// and how much of the caller's words to send behind it.
///
/// How words travel is known by pointers to the family's functions, so that
/// firmware carries those of the functions it calls.
#[derive(Clone, Copy, Hash, Debug)]
pub struct Query {
    pub(super) head: [u8; HEAD],
    pub(super) head_length: u8,
    /// Length of the PDU: of head, byte count and data.
    pub(super) length: u8,
    /// Length of the response PDU if the request succeeds.
    pub(super) response_length: u8,
    /// `None`: neither byte count nor data follow the head.
    pub(super) send: Option<Send>,
    /// `None`: the response repeats the head.
    pub(super) take: Option<Take>,
}

impl Query {
    /// No request.
    pub const NONE: Query = Query {
        head: [0; HEAD],
        head_length: 0,
        length: 0,
        response_length: 0,
        send: None,
        take: None,
    };

    /// The request that `build` writes.
    ///
    /// # Errors
    /// The status with which `build` refuses.
    pub fn build(build: impl FnOnce(&mut Query) -> Status) -> Result<Query, Status> {
        let mut request = Query::NONE;
        match build(&mut request) {
            Status::OK => Ok(request),
            refused => Err(refused),
        }
    }

    /// Becomes `function` and two words, which the response repeats.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn set(&mut self, function: u8, first: u16, second: u16) {
        let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
        self.head = [function, a, b, c, d, 0, 0, 0, 0];
        self.head_length = 5;
        self.length = 5;
        self.response_length = 5;
        self.send = None;
        self.take = None;
    }

    /// As [`Query::set`], for a range of addresses; says whether every device
    /// would accept that.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn set_range(
        &mut self,
        function: u8,
        address: u16,
        quantity: u16,
        most: u16,
    ) -> Status {
        self.set(function, address, quantity);
        check_range(address, quantity, most)
    }

    /// Has `bytes` of the caller's words follow the head.
    pub(super) fn append(&mut self, bytes: u8, send: Send) {
        self.length = bytes.wrapping_add(self.head_length + 1);
        self.send = Some(send);
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// The head as sent.
    fn head(&self) -> impl Iterator<Item = &u8> {
        self.head.iter().take(usize::from(self.head_length))
    }

    /// Length of the response PDU if the request succeeds.
    pub const fn response_length(&self) -> u8 {
        self.response_length
    }

    /// True if the response carries data behind a byte count, false if it
    /// repeats the request's head.
    pub const fn is_read(&self) -> bool {
        self.take.is_some()
    }

    /// How many of the caller's words are sent.
    pub const fn words(&self) -> u8 {
        (self.length - self.head_length) >> 1
    }

    /// Length of the PDU.
    pub const fn length(&self) -> u8 {
        self.length
    }

    /// Writes the PDU into `pdu`, which has [`Query::length`] bytes. Words
    /// that `source` lacks are zero; the sender checks [`Query::words`].
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn emit(&self, pdu: &mut [u8], source: &[u16]) {
        let mut bytes = pdu.iter_mut();
        for (byte, place) in self.head().zip(bytes.by_ref()) {
            *place = *byte;
        }
        if let (Some(send), Some(count)) = (self.send, bytes.next()) {
            *count = self.length - self.head_length - 1;
            send(bytes.into_slice(), source, self.head[4]);
        }
    }

    /// Fills words from the data of a successful response, which start `data`;
    /// returns false, with nothing filled, if they are too few.
    pub fn take(&self, words: &mut [u16], data: &[u8]) -> bool {
        let Some(take) = self.take else {
            return true;
        };
        let Some(words) = words.get_mut(..usize::from(self.response_words())) else {
            return false;
        };
        take(words, data, self.head[4]);
        true
    }

    /// How many words the data of a successful response fill.
    pub const fn response_words(&self) -> u8 {
        (self.response_length - 1) >> 1
    }

    /// True if `pdu`, complete or not, agrees with the head of this request.
    pub fn agrees(&self, pdu: &[u8]) -> bool {
        self.head().zip(pdu).all(|(ours, theirs)| ours == theirs)
    }
}

/// Checks a range of addresses as every device would (application protocol,
/// figures 11 and following: quantity first, then addresses).
pub(super) fn check_range(address: u16, quantity: u16, most: u16) -> Status {
    if quantity == 0 || quantity > most {
        Status::ILLEGAL_DATA_VALUE
    } else if address.checked_add(quantity - 1).is_none() {
        Status::ILLEGAL_DATA_ADDRESS
    } else {
        Status::OK
    }
}

//! A request of every function, and its response.

use mbm::client::RequestState;
use mbm::error::Status;
use mbm::pdu::custom::Rule;
use mbm::pdu::functions::FunctionSpec;

/// The builder of a request, the data to send, the PDU of the request, the PDU of the
/// response, and the data that the client receives.
pub type Case = (
    fn(&mut RequestState) -> Status,
    &'static [u8],
    &'static [u8],
    &'static [u8],
    &'static [u8],
);

macro_rules! cases {
    ($($build:ident($($argument:expr),*), $data:expr, $request:expr, $response:expr, $received:expr;)*) => {
        /// The examples of the application protocol, clause 6, and some others.
        pub const CASES: &[Case] = &[$((
            |o| o.$build($($argument),*), &$data, &$request, &$response, &$received,
        )),*];
    };
}

cases! {
    set(FunctionSpec::READ_COILS, 0x13, 0x13), [], [1, 0, 0x13, 0, 0x13],
        [1, 3, 0xCD, 0x6B, 0xFD], [0xCD, 0x6B, 0x05];
    set(FunctionSpec::READ_DISCRETE_INPUTS, 0xC4, 0x16), [], [2, 0, 0xC4, 0, 0x16],
        [2, 3, 0xAC, 0xDB, 0x35], [0xAC, 0xDB, 0x35];
    set(FunctionSpec::READ_HOLDING_REGISTERS, 0x6B, 3), [], [3, 0, 0x6B, 0, 3],
        [3, 6, 2, 0x2B, 0, 0, 0, 0x64], [2, 0x2B, 0, 0, 0, 0x64];
    set(FunctionSpec::READ_INPUT_REGISTERS, 8, 1), [], [4, 0, 8, 0, 1], [4, 2, 0, 0x0A], [0, 0x0A];
    set(FunctionSpec::WRITE_SINGLE_COIL, 0xAC, 0xFF00), [], [5, 0, 0xAC, 0xFF, 0],
        [5, 0, 0xAC, 0xFF, 0], [];
    set(FunctionSpec::WRITE_SINGLE_REGISTER, 1, 3), [], [6, 0, 1, 0, 3], [6, 0, 1, 0, 3], [];
    set(FunctionSpec::READ_EXCEPTION_STATUS, 0, 0), [], [7], [7, 0x6D], [0x6D];
    diagnostics(0, 2), [0xA5, 0x37, 1, 2], [8, 0, 0, 0xA5, 0x37, 1, 2],
        [8, 0, 0, 0xA5, 0x37, 1, 2], [0xA5, 0x37, 1, 2];
    diagnostics(0x0B, 1), [0, 0], [8, 0, 0x0B, 0, 0], [8, 0, 0x0B, 0, 9], [0, 9];
    set(FunctionSpec::GET_COMM_EVENT_COUNTER, 0, 0), [], [0x0B],
        [0x0B, 0xFF, 0xFF, 1, 8], [0xFF, 0xFF, 1, 8];
    set(FunctionSpec::GET_COMM_EVENT_LOG, 0, 0), [], [0x0C],
        [0x0C, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0], [0, 0, 1, 8, 1, 0x21, 0x20, 0];
    set(FunctionSpec::WRITE_MULTIPLE_COILS, 0x13, 10), [0xCD, 0xFD], [0x0F, 0, 0x13, 0, 10, 2, 0xCD, 1],
        [0x0F, 0, 0x13, 0, 10], [];
    set(FunctionSpec::WRITE_MULTIPLE_REGISTERS, 1, 2), [0, 0x0A, 1, 2], [0x10, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2],
        [0x10, 0, 1, 0, 2], [];
    set(FunctionSpec::REPORT_SERVER_ID, 0, 0), [], [0x11],
        [0x11, 3, 0x42, 0xFF, 7], [0x42, 0xFF, 7];
    read_file_record(4, 1, 2), [], [0x14, 7, 6, 0, 4, 0, 1, 0, 2],
        [0x14, 6, 5, 6, 0x0D, 0xFE, 0, 0x20], [0x0D, 0xFE, 0, 0x20];
    read_file_records(14), [6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2], [0x14, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2],
        [0x14, 12, 5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40], [5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40];
    write_file_record(4, 7, 3), [6, 0xAF, 4, 0xBE, 0x10, 0x0D], [0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D],
        [0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D], [];
    write_file_records(9), [6, 0, 4, 0, 7, 0, 1, 6, 0xAF], [0x15, 9, 6, 0, 4, 0, 7, 0, 1, 6, 0xAF],
        [0x15, 9, 6, 0, 4, 0, 7, 0, 1, 6, 0xAF], [];
    mask_write_register(4, 0xF2, 0x25), [], [0x16, 0, 4, 0, 0xF2, 0, 0x25],
        [0x16, 0, 4, 0, 0xF2, 0, 0x25], [];
    read_write_registers(3, 2, 0x0E, 1), [0, 0xFF], [0x17, 0, 3, 0, 2, 0, 0x0E, 0, 1, 2, 0, 0xFF],
        [0x17, 4, 0, 0xFE, 0x0A, 0xCD], [0, 0xFE, 0x0A, 0xCD];
    set(FunctionSpec::READ_FIFO_QUEUE, 0x4DE, 0), [], [0x18, 4, 0xDE],
        [0x18, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84], [1, 0xB8, 0x12, 0x84];
    read_device_identification(1, 0), [], [0x2B, 0x0E, 1, 0],
        [0x2B, 0x0E, 1, 1, 0, 0, 2, 0, 2, 0x41, 0x42, 1, 1, 0x43], [1, 0, 0, 2, 0, 2, 0x41, 0x42, 1, 1, 0x43];
    encapsulated(0x0D, 2), [1, 2], [0x2B, 0x0D, 1, 2], [0x2B, 0x0D, 9, 8, 7], [9, 8, 7];
    custom(0x41, 2, Rule::Fixed(3)), [1, 2], [0x41, 1, 2], [0x41, 3, 4], [3, 4];
    custom(0x42, 1, Rule::Counted(2, 1)), [5], [0x42, 5], [0x42, 0, 2, 6, 7, 8], [0, 2, 6, 7, 8];
    custom(0x43, 0, Rule::Silence), [], [0x43], [0x43, 1, 2, 3, 4, 5], [1, 2, 3, 4, 5];
    // A function of the standard, sent as a user-defined one. A gateway forwards it so.
    custom(0x14, 8, Rule::Counted(1, 0)), [7, 6, 0, 4, 0, 0, 0, 2], [0x14, 7, 6, 0, 4, 0, 0, 0, 2],
        [0x14, 6, 5, 6, 0, 1, 0, 2], [6, 5, 6, 0, 1, 0, 2];
}

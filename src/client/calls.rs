//! The functions of a client whose calls wait for their end: each one of the standard, and those of
//! the user. A client that blocks and one whose functions are futures have the same.

/// The example of a call: what is before it, the call, what is after it.
macro_rules! example {
    ([] $($shown:literal),*) => {
        call_example!([] "# let mut client = mbm::client::BlockingClient::tcp(tcp());\n# macro_rules! pump { () => { client.port().units.device } }\n", $($shown),*)
    };
    ([async] $($shown:literal),*) => {
        call_example!([async] "# let port = mbm::port::AsyncIo::stream(tcp(), micros, Delay);\n# let mut client = mbm::client::AsyncClient::tcp(port);\n# macro_rules! pump { () => { client.port().device.units.device } }\n", $($shown),*)
    };
}

/// The functions. `async` and `.await` go into the places for them. `self.call` sends a request and
/// returns it once it has ended.
macro_rules! calls {
    ($($async:ident)?; $($wait:tt)*) => {
        /// 01: reads 1 to 2000 coils, as many as `coils` has.
        ///
        /// # Errors
        /// This and the other functions return an exception of the device, for example
        /// [`Error::IllegalDataAddress`]; [`Error::ResponseTimedOut`], [`Error::InvalidCrc`],
        /// [`Error::LinkLost`] or another error of the line. They send nothing if the standard does
        /// not allow the request ([`Error::InvalidQuantity`], [`Error::InvalidAddress`],
        /// [`Error::InvalidArgument`], [`Error::BroadcastNotAllowed`]), or if its data are more than
        /// the client holds ([`Error::BufferTooSmall`]).
        #[doc = example!([$($async)?] "let mut coils = [false; 2];", "client.read_coils(17, 0, &mut coils)", "assert_eq!(coils, [true, false]);")]
        pub $($async)? fn read_coils(
            &mut self,
            unit: u8,
            address: u16,
            coils: &mut [bool],
        ) -> Result<(), Error> {
            let count = quantity(coils.len());
            let spec = FunctionSpec::READ_COILS;
            let call = Call::short(unit, spec, (address, count), coils.len().div_ceil(8))?;
            self.call(call)$($wait)*?.fill_coils(coils)
        }

        /// 02: reads 1 to 2000 discrete inputs, as many as `inputs` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut inputs = [false; 2];", "client.read_discrete_inputs(17, 0, &mut inputs)", "assert_eq!(inputs, [false, true]);")]
        pub $($async)? fn read_discrete_inputs(
            &mut self,
            unit: u8,
            address: u16,
            inputs: &mut [bool],
        ) -> Result<(), Error> {
            let count = quantity(inputs.len());
            let spec = FunctionSpec::READ_DISCRETE_INPUTS;
            let call = Call::short(unit, spec, (address, count), inputs.len().div_ceil(8))?;
            self.call(call)$($wait)*?.fill_coils(inputs)
        }

        /// 03: reads 1 to 125 holding registers, as many as `registers` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut registers = [0; 2];", "client.read_holding_registers(17, 107, &mut registers)", "assert_eq!(registers, [555, 100]);")]
        pub $($async)? fn read_holding_registers(
            &mut self,
            unit: u8,
            address: u16,
            registers: &mut [u16],
        ) -> Result<(), Error> {
            let count = quantity(registers.len());
            let spec = FunctionSpec::READ_HOLDING_REGISTERS;
            let call = Call::short(unit, spec, (address, count), 2 * usize::from(count))?;
            self.call(call)$($wait)*?.fill_registers(registers)
        }

        /// 04: reads 1 to 125 input registers, as many as `registers` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut registers = [0; 2];", "client.read_input_registers(17, 0, &mut registers)", "assert_eq!(registers, [21, 22]);")]
        pub $($async)? fn read_input_registers(
            &mut self,
            unit: u8,
            address: u16,
            registers: &mut [u16],
        ) -> Result<(), Error> {
            let count = quantity(registers.len());
            let spec = FunctionSpec::READ_INPUT_REGISTERS;
            let call = Call::short(unit, spec, (address, count), 2 * usize::from(count))?;
            self.call(call)$($wait)*?.fill_registers(registers)
        }

        /// As [`Self::read_coils`], into an array: `let [door, pump] = client.coils(17, 0)?`. A
        /// quantity that the standard does not allow does not compile.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [door, pump] = client.coils(17, 0)", "assert!(door && !pump);")]
        pub $($async)? fn coils<const N: usize>(
            &mut self,
            unit: u8,
            address: u16,
        ) -> Result<[bool; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_BITS as usize, "1 to 2000 coils") };
            let mut coils = [false; N];
            self.read_coils(unit, address, &mut coils)$($wait)*?;
            Ok(coils)
        }

        /// As [`Self::read_discrete_inputs`], into an array, as [`Self::coils`].
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [is_open, is_wet] = client.discrete_inputs(17, 0)", "assert!(!is_open && is_wet);")]
        pub $($async)? fn discrete_inputs<const N: usize>(
            &mut self,
            unit: u8,
            address: u16,
        ) -> Result<[bool; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_BITS as usize, "1 to 2000 discrete inputs") };
            let mut inputs = [false; N];
            self.read_discrete_inputs(unit, address, &mut inputs)$($wait)*?;
            Ok(inputs)
        }

        /// As [`Self::read_holding_registers`], into an array:
        /// `let [flow, total] = client.holding_registers(17, 107)?`. A quantity that the standard
        /// does not allow does not compile.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [flow, total] = client.holding_registers(17, 107)", "assert_eq!([flow, total], [555, 100]);")]
        pub $($async)? fn holding_registers<const N: usize>(
            &mut self,
            unit: u8,
            address: u16,
        ) -> Result<[u16; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_REGISTERS as usize, "1 to 125 registers") };
            let mut registers = [0; N];
            self.read_holding_registers(unit, address, &mut registers)$($wait)*?;
            Ok(registers)
        }

        /// As [`Self::read_input_registers`], into an array, as [`Self::holding_registers`].
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [inside, outside] = client.input_registers(17, 0)", "assert_eq!([inside, outside], [21, 22]);")]
        pub $($async)? fn input_registers<const N: usize>(
            &mut self,
            unit: u8,
            address: u16,
        ) -> Result<[u16; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_REGISTERS as usize, "1 to 125 registers") };
            let mut registers = [0; N];
            self.read_input_registers(unit, address, &mut registers)$($wait)*?;
            Ok(registers)
        }

        /// 05: switches one coil.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "client.write_single_coil(17, 1, true)", "# assert!(pump!().values.coils.cells[1]);")]
        pub $($async)? fn write_single_coil(
            &mut self,
            unit: u8,
            address: u16,
            on: bool,
        ) -> Result<(), Error> {
            let spec = FunctionSpec::WRITE_SINGLE_COIL;
            let call = Call::short(unit, spec, (address, coil_value(on)), 0)?;
            self.call(call)$($wait)*?;
            Ok(())
        }

        /// 06: writes one register.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "client.write_single_register(17, 107, 888)", "# assert_eq!(pump!().values.holding_registers.cells[0], 888);")]
        pub $($async)? fn write_single_register(
            &mut self,
            unit: u8,
            address: u16,
            value: u16,
        ) -> Result<(), Error> {
            let call = Call::short(unit, FunctionSpec::WRITE_SINGLE_REGISTER, (address, value), 0)?;
            self.call(call)$($wait)*?;
            Ok(())
        }

        /// 0F: writes 1 to 1968 coils.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "client.write_multiple_coils(17, 0, &[false, true])", "# assert_eq!(pump!().values.coils.cells, [false, true]);")]
        pub $($async)? fn write_multiple_coils(
            &mut self,
            unit: u8,
            address: u16,
            coils: &[bool],
        ) -> Result<(), Error> {
            let count = quantity(coils.len());
            let call = Call::short(unit, FunctionSpec::WRITE_MULTIPLE_COILS, (address, count), 0)?;
            self.call(call.with_coils(coils))$($wait)*?;
            Ok(())
        }

        /// 10: writes 1 to 123 registers.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "client.write_multiple_registers(17, 109, &[7, 8])", "# assert_eq!(pump!().values.holding_registers.cells[2..], [7, 8]);")]
        pub $($async)? fn write_multiple_registers(
            &mut self,
            unit: u8,
            address: u16,
            registers: &[u16],
        ) -> Result<(), Error> {
            let count = quantity(registers.len());
            let spec = FunctionSpec::WRITE_MULTIPLE_REGISTERS;
            let call = Call::short(unit, spec, (address, count), 0)?;
            self.call(call.with_registers(registers))$($wait)*?;
            Ok(())
        }

        /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "// Sets bit 0, and leaves the others.", "client.mask_write_register(17, 107, 0xFFFE, 0x0001)", "# assert_eq!(pump!().values.holding_registers.cells[0], 555);")]
        pub $($async)? fn mask_write_register(
            &mut self,
            unit: u8,
            address: u16,
            and_mask: u16,
            or_mask: u16,
        ) -> Result<(), Error> {
            let call = Call::new(unit, 0, |request| {
                request.mask_write_register(address, and_mask, or_mask)
            })?;
            self.call(call)$($wait)*?;
            Ok(())
        }

        /// 17: writes 1 to 121 registers, then reads 1 to 125.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut read = [0; 2];", "client.read_write_multiple_registers(17, (109, &mut read), (109, &[7, 8]))", "// The write comes first.\nassert_eq!(read, [7, 8]);")]
        pub $($async)? fn read_write_multiple_registers(
            &mut self,
            unit: u8,
            (read_address, read): (u16, &mut [u16]),
            (write_address, write): (u16, &[u16]),
        ) -> Result<(), Error> {
            let (reads, writes) = (quantity(read.len()), quantity(write.len()));
            let call = Call::new(unit, 2 * usize::from(reads), |request| {
                request.read_write_registers(read_address, reads, write_address, writes)
            })?;
            self.call(call.with_registers(write))$($wait)*?.fill_registers(read)
        }

        /// 07: reads the eight exception status outputs, the first in the lowest bit.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let outputs = client.read_exception_status(17)", "assert_eq!(outputs, 0b0000_0101);")]
        pub $($async)? fn read_exception_status(&mut self, unit: u8) -> Result<u8, Error> {
            let call = Call::short(unit, FunctionSpec::READ_EXCEPTION_STATUS, (0, 0), 1)?;
            let call = self.call(call)$($wait)*?;
            Ok(call.bytes().first().copied().unwrap_or(0))
        }

        /// 08: sends the words of `data` with a sub-function, and replaces them by those of the
        /// response: one word, for sub-function 0 (Return Query Data) 1 to 125. No device answers
        /// sub-function 4, Force Listen Only Mode.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "// Return Query Data: the device sends the words back.\nlet mut data = [555, 100];", "client.diagnostics(17, 0, &mut data)", "assert_eq!(data, [555, 100]);")]
        pub $($async)? fn diagnostics(
            &mut self,
            unit: u8,
            sub_function: u16,
            data: &mut [u16],
        ) -> Result<(), Error> {
            let count = quantity(data.len());
            let call = Call::new(unit, 2 * usize::from(count), |request| {
                request.diagnostics(sub_function, count)
            })?;
            self.call(call.with_registers(data))$($wait)*?.take_registers(data);
            Ok(())
        }

        /// 0B: reads the status word and the event counter.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let counter = client.get_comm_event_counter(17)", "assert_eq!((counter.status, counter.events), (0, 0));")]
        pub $($async)? fn get_comm_event_counter(
            &mut self,
            unit: u8,
        ) -> Result<CommEventCounter, Error> {
            let call = Call::short(unit, FunctionSpec::GET_COMM_EVENT_COUNTER, (0, 0), 4)?;
            let mut words = [0; 2];
            self.call(call)$($wait)*?.fill_registers(&mut words)?;
            let [status, events] = words;
            Ok(CommEventCounter { status, events })
        }

        /// 0C: reads counters and the log of up to 64 events. `place` is where the log is put:
        /// [`CommEventLog::BYTES`] hold any.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "let mut place = [0; mbm::client::CommEventLog::BYTES];", "let log = client.get_comm_event_log(17, &mut place)", "assert_eq!((log.status, log.events), (0, 0));")]
        pub $($async)? fn get_comm_event_log<'b>(
            &mut self,
            unit: u8,
            place: &'b mut [u8],
        ) -> Result<CommEventLog<'b>, Error> {
            let call = Call::short(unit, FunctionSpec::GET_COMM_EVENT_LOG, (0, 0), place.len())?;
            CommEventLog::parse(self.call(call)$($wait)*?.take_bytes(place))
        }

        /// 11: reads what the device says about itself: its id, its run indicator, and more, in a
        /// form that its manual explains. Returns the part of `place` that it fills.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "let mut place = [0; 250];", "let id = client.report_server_id(17, &mut place)", "assert_eq!(id.last(), Some(&0xFF)); // The run indicator of this device: on.")]
        pub $($async)? fn report_server_id<'b>(
            &mut self,
            unit: u8,
            place: &'b mut [u8],
        ) -> Result<&'b [u8], Error> {
            let call = Call::short(unit, FunctionSpec::REPORT_SERVER_ID, (0, 0), place.len())?;
            Ok(self.call(call)$($wait)*?.take_bytes(place))
        }

        /// 14: reads 1 to 121 consecutive records of a file, as many as `records` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "// Records 0 and 1 of file 4.\nlet mut records = [0; 2];", "client.read_file_record(17, 4, 0, &mut records)", "# assert_eq!(records, [0, 0]);")]
        pub $($async)? fn read_file_record(
            &mut self,
            unit: u8,
            file: u16,
            record: u16,
            records: &mut [u16],
        ) -> Result<(), Error> {
            let count = quantity(records.len());
            let call = Call::new(unit, 2 * usize::from(count), |request| {
                request.read_file_record(file, record, count)
            })?;
            self.call(call)$($wait)*?.fill_registers(records)
        }

        /// 15: writes 1 to 122 consecutive records of a file.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "client.write_file_record(17, 4, 0, &[7, 8])", "# assert_eq!(pump!().records[..2], [7, 8]);")]
        pub $($async)? fn write_file_record(
            &mut self,
            unit: u8,
            file: u16,
            record: u16,
            records: &[u16],
        ) -> Result<(), Error> {
            let count = quantity(records.len());
            let call = Call::new(unit, 0, |request| {
                request.write_file_record(file, record, count)
            })?;
            self.call(call.with_registers(records))$($wait)*?;
            Ok(())
        }

        /// 14 with several groups: reads records of several files, or of several ranges, in one
        /// request.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "use mbm::client::ReadRecords;\n\nlet (mut first, mut last) = ([0; 2], [0; 1]);\nlet mut groups = [\n    ReadRecords { file: 4, record: 0, records: &mut first },\n    ReadRecords { file: 4, record: 9, records: &mut last },\n];", "client.read_file_records(17, &mut groups)", "# assert_eq!((first, last), ([0, 0], [0]));")]
        pub $($async)? fn read_file_records(
            &mut self,
            unit: u8,
            groups: &mut [ReadRecords<'_>],
        ) -> Result<(), Error> {
            let sent = Groups::read(groups)?;
            let call = Call::new(unit, CALL_BYTES, |request| {
                request.read_file_records(sent.length())
            })?;
            let call = call.with_bytes(sent.as_bytes());
            take_records(self.call(call)$($wait)*?.bytes(), groups)
        }

        /// 15 with several groups: writes records of several files, or of several ranges, in one
        /// request.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "use mbm::client::WriteRecords;\n\nlet groups = [\n    WriteRecords { file: 4, record: 0, records: &[7, 8] },\n    WriteRecords { file: 4, record: 9, records: &[9] },\n];", "client.write_file_records(17, &groups)", "# assert_eq!(pump!().records, [7, 8, 0, 0, 0, 0, 0, 0, 0, 9]);")]
        pub $($async)? fn write_file_records(
            &mut self,
            unit: u8,
            groups: &[WriteRecords<'_>],
        ) -> Result<(), Error> {
            let sent = Groups::write(groups)?;
            let call = Call::new(unit, 0, |request| {
                request.write_file_records(sent.length())
            })?;
            self.call(call.with_bytes(sent.as_bytes()))$($wait)*?;
            Ok(())
        }

        /// 18: reads a queue of up to 31 registers. Returns those that the queue has.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the queue has more than `place`.
        #[doc = example!([$($async)?] "let mut place = [0; 31];", "let queue = client.read_fifo_queue(17, 1000, &mut place)", "assert_eq!(queue, [7, 8]);")]
        pub $($async)? fn read_fifo_queue<'b>(
            &mut self,
            unit: u8,
            address: u16,
            place: &'b mut [u16],
        ) -> Result<&'b [u16], Error> {
            let spec = FunctionSpec::READ_FIFO_QUEUE;
            let call = Call::short(unit, spec, (address, 0), place.len().saturating_mul(2))?;
            Ok(self.call(call)$($wait)*?.take_registers(place))
        }

        /// 2B/0E: reads objects that identify the device, as many as one response has, from `object`
        /// on. `place` is where the objects are put: 250 bytes hold any response.
        /// [`Self::identify`] reads all.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "use mbm::pdu::identification::DeviceIdCode;\n\nlet mut place = [0; 250];", "let reply = client.read_device_identification(17, DeviceIdCode::Basic, 0, &mut place)", "assert_eq!(reply.objects.iter().next(), Some((0, &b\"mbm\"[..])));")]
        pub $($async)? fn read_device_identification<'b>(
            &mut self,
            unit: u8,
            code: DeviceIdCode,
            object: u8,
            place: &'b mut [u8],
        ) -> Result<IdentificationReply<'b>, Error> {
            let call = Call::new(unit, place.len(), |request| {
                request.read_device_identification(code as u8, object)
            })?;
            let data = self.call(call)$($wait)*?.take_bytes(place);
            IdentificationReply::parse(code as u8, data)
        }

        /// 2B/0E: reads all objects of a category, with as many requests as the device needs, and
        /// calls `object` with the id and the value of each.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::NoProgress`] if the device repeats itself.
        #[doc = example!([$($async)?] "use mbm::pdu::identification::DeviceIdCode;\n\nlet mut objects = vec![];\nlet take = |id, value: &[u8]| objects.push((id, value.to_vec()));", "client.identify(17, DeviceIdCode::Basic, take)", "assert_eq!(objects[1], (1, b\"pump\".to_vec()));")]
        pub $($async)? fn identify(
            &mut self,
            unit: u8,
            code: DeviceIdCode,
            mut object: impl FnMut(u8, &[u8]),
        ) -> Result<(), Error> {
            let mut stream = ObjectStream::new(code as u8, 0);
            let mut from = 0;
            loop {
                let call = Call::new(unit, CALL_BYTES, |request| {
                    request.read_device_identification(code as u8, from)
                })?;
                let call = self.call(call)$($wait)*?;
                let reply = IdentificationReply::parse(code as u8, call.bytes())?;
                let next = stream.take(&reply)?;
                reply.objects.iter().for_each(|(id, value)| object(id, value));
                match next {
                    Next::End => return Ok(()),
                    Next::Stuck => return Err(Error::NoProgress),
                    Next::Request(next) => from = next,
                }
            }
        }

        /// 2B with any MEI type, for example 0D (hex), CANopen: sends `data` after it. Returns the
        /// part of `place` that the bytes after the MEI type of the response fill. On an RTU line,
        /// silence ends the response.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "// A request of CANopen.\nlet mut place = [0; 250];", "let answer = client.encapsulated_interface_transport(17, 0x0D, &[1, 2], &mut place)", "assert_eq!(answer, [1, 2]);")]
        pub $($async)? fn encapsulated_interface_transport<'b>(
            &mut self,
            unit: u8,
            mei_type: u8,
            data: &[u8],
            place: &'b mut [u8],
        ) -> Result<&'b [u8], Error> {
            let bytes = quantity(data.len());
            let call = Call::new(unit, place.len(), |request| {
                request.encapsulated(mei_type, bytes)
            })?;
            Ok(self.call(call.with_bytes(data))$($wait)*?.take_bytes(place))
        }

        /// Any function code, 1 to 127: sends `data` after it. Returns the part of `place` that the
        /// bytes after the function code of the response fill. `response` says how long that is.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "use mbm::pdu::custom::Rule;\n\n// Function 65 of a device, whose response has the byte after the function code and two more.\nlet mut place = [0; 3];", "let answer = client.custom(17, 65, &[1, 2, 3], Rule::Fixed(4), &mut place)", "assert_eq!(answer, [1, 2, 3]);")]
        pub $($async)? fn custom<'b>(
            &mut self,
            unit: u8,
            function: u8,
            data: &[u8],
            response: Rule,
            place: &'b mut [u8],
        ) -> Result<&'b [u8], Error> {
            let bytes = quantity(data.len());
            let call = Call::new(unit, place.len(), |request| {
                request.custom(function, bytes, response)
            })?;
            Ok(self.call(call.with_bytes(data))$($wait)*?.take_bytes(place))
        }

        /// Forwards a request that has arrived from elsewhere: a function code, and the bytes after
        /// it. Returns the part of `place` that the bytes after the function code of the response
        /// fill. The response must match the request, as for the other functions.
        ///
        /// # Errors
        /// As [`Self::read_coils`]; [`Error::BufferTooSmall`] if the place is.
        #[doc = example!([$($async)?] "// Reads two registers from 107 on.\nlet mut place = [0; 250];", "let answer = client.forward(17, 3, &[0, 107, 0, 2], &mut place)", "assert_eq!(answer, [4, 0x02, 0x2B, 0, 100]);")]
        pub $($async)? fn forward<'b>(
            &mut self,
            unit: u8,
            function: u8,
            body: &[u8],
            place: &'b mut [u8],
        ) -> Result<&'b [u8], Error> {
            if body.len() > CALL_BYTES {
                return Err(Error::InvalidQuantity);
            }
            let call = Call::new(unit, place.len(), |request| request.forward(function, body))?;
            Ok(self.call(call.with_last_of(body))$($wait)*?.take_bytes(place))
        }
    };
}

pub(super) use {calls, example};

//! The functions of a master whose calls wait for their end: the ten of the Arduino library
//! ModbusMaster, and reads into arrays. A master that blocks and one whose functions are futures have
//! the same.

/// The example of a call: what is before it, the call, what is after it.
macro_rules! example {
    ([] $($shown:literal),*) => {
        call_example!([] "# let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);\n# let mut master = mbm::master::Master::new(17, rtu(), buffers);\n# macro_rules! pump { () => { master.port().units.device } }\n", $($shown),*)
    };
    ([async] $($shown:literal),*) => {
        call_example!([async] "# let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);\n# let mut master = mbm::master::AsyncMaster::new(17, rtu(), micros, Delay, buffers);\n# macro_rules! pump { () => { master.device().units.device } }\n", $($shown),*)
    };
}

/// The functions. `async` and `.await` go into the places for them. `self.request` makes a request and
/// waits for its end.
macro_rules! calls {
    ($($async:ident)?; $($wait:tt)*) => {
        /// 01: reads 1 to 2000 coils, as many as `coils` has.
        ///
        /// # Errors
        /// This and the other functions return an exception of the device, for example
        /// [`Error::IllegalDataAddress`]; [`Error::ResponseTimedOut`], [`Error::InvalidCrc`],
        /// [`Error::LinkLost`] or another error of the line. They send nothing if the standard
        /// does not allow the quantity or the addresses ([`Error::InvalidQuantity`],
        /// [`Error::InvalidAddress`]), or if the buffers cannot hold the data
        /// ([`Error::BufferTooSmall`], [`Error::InvalidQuantity`]).
        #[doc = example!([$($async)?] "let mut coils = [false; 2];", "master.read_coils(0, &mut coils)", "assert_eq!(coils, [true, false]);")]
        pub $($async)? fn read_coils(&mut self, address: u16, coils: &mut [bool]) -> Result<(), Error> {
            let quantity = quantity(coils.len());
            self.request(|master| master.start_read_coils(address, quantity))$($wait)*?;
            self.take_bits(coils)
        }

        /// 02: reads 1 to 2000 discrete inputs, as many as `inputs` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut inputs = [false; 2];", "master.read_discrete_inputs(0, &mut inputs)", "assert_eq!(inputs, [false, true]);")]
        pub $($async)? fn read_discrete_inputs(
            &mut self,
            address: u16,
            inputs: &mut [bool],
        ) -> Result<(), Error> {
            let quantity = quantity(inputs.len());
            self.request(|master| master.start_read_discrete_inputs(address, quantity))$($wait)*?;
            self.take_bits(inputs)
        }

        /// 03: reads 1 to 125 holding registers, as many as `registers` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut registers = [0; 2];", "master.read_holding_registers(107, &mut registers)", "assert_eq!(registers, [555, 100]);")]
        pub $($async)? fn read_holding_registers(
            &mut self,
            address: u16,
            registers: &mut [u16],
        ) -> Result<(), Error> {
            let quantity = quantity(registers.len());
            self.request(|master| master.start_read_holding_registers(address, quantity))$($wait)*?;
            self.take_words(registers)
        }

        /// 04: reads 1 to 125 input registers, as many as `registers` has.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut registers = [0; 2];", "master.read_input_registers(0, &mut registers)", "assert_eq!(registers, [21, 22]);")]
        pub $($async)? fn read_input_registers(
            &mut self,
            address: u16,
            registers: &mut [u16],
        ) -> Result<(), Error> {
            let quantity = quantity(registers.len());
            self.request(|master| master.start_read_input_registers(address, quantity))$($wait)*?;
            self.take_words(registers)
        }

        /// 05: switches one coil.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "master.write_single_coil(1, true)", "# assert!(pump!().values.coils.cells[1]);")]
        pub $($async)? fn write_single_coil(&mut self, address: u16, on: bool) -> Result<(), Error> {
            self.request(|master| master.start_write_single_coil(address, on))$($wait)*
        }

        /// 06: writes one register.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "master.write_single_register(107, 888)", "# assert_eq!(pump!().values.holding_registers.cells[0], 888);")]
        pub $($async)? fn write_single_register(&mut self, address: u16, value: u16) -> Result<(), Error> {
            self.request(|master| master.start_write_single_register(address, value))$($wait)*
        }

        /// 0F: writes 1 to 1968 coils.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "master.write_multiple_coils(0, &[false, true])", "# assert_eq!(pump!().values.coils.cells, [false, true]);")]
        pub $($async)? fn write_multiple_coils(
            &mut self,
            address: u16,
            coils: &[bool],
        ) -> Result<(), Error> {
            self.request(|master| master.start_write_multiple_coils(address, coils))$($wait)*
        }

        /// 10: writes 1 to 123 registers.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "master.write_multiple_registers(109, &[7, 8])", "# assert_eq!(pump!().values.holding_registers.cells[2..], [7, 8]);")]
        pub $($async)? fn write_multiple_registers(
            &mut self,
            address: u16,
            registers: &[u16],
        ) -> Result<(), Error> {
            self.request(|master| master.start_write_multiple_registers(address, registers))$($wait)*
        }

        /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "// Sets bit 0, and leaves the others.", "master.mask_write_register(107, 0xFFFE, 0x0001)", "# assert_eq!(pump!().values.holding_registers.cells[0], 555);")]
        pub $($async)? fn mask_write_register(
            &mut self,
            address: u16,
            and_mask: u16,
            or_mask: u16,
        ) -> Result<(), Error> {
            self.request(|master| master.start_mask_write_register(address, and_mask, or_mask))$($wait)*
        }

        /// 17: writes 1 to 121 registers, then reads 1 to 125.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "let mut read = [0; 2];", "master.read_write_multiple_registers((109, &mut read), (109, &[7, 8]))", "// The write comes first.\nassert_eq!(read, [7, 8]);")]
        pub $($async)? fn read_write_multiple_registers(
            &mut self,
            (read_address, read): (u16, &mut [u16]),
            (write_address, write): (u16, &[u16]),
        ) -> Result<(), Error> {
            let quantity = quantity(read.len());
            self.request(|master| {
                master.start_read_write_multiple_registers(read_address, quantity, write_address, write)
            })$($wait)*?;
            self.take_words(read)
        }

        /// As [`Self::read_coils`], into an array: `let [door, pump] = master.coils(0)?`. A quantity that
        /// the standard does not allow does not compile.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [door, pump] = master.coils(0)", "assert!(door && !pump);")]
        pub $($async)? fn coils<const N: usize>(&mut self, address: u16) -> Result<[bool; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_BITS as usize, "1 to 2000 coils") };
            let mut coils = [false; N];
            self.read_coils(address, &mut coils)$($wait)*?;
            Ok(coils)
        }

        /// As [`Self::read_discrete_inputs`], into an array, as [`Self::coils`].
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [is_open, is_wet] = master.discrete_inputs(0)", "assert!(!is_open && is_wet);")]
        pub $($async)? fn discrete_inputs<const N: usize>(
            &mut self,
            address: u16,
        ) -> Result<[bool; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_BITS as usize, "1 to 2000 discrete inputs") };
            let mut inputs = [false; N];
            self.read_discrete_inputs(address, &mut inputs)$($wait)*?;
            Ok(inputs)
        }

        /// As [`Self::read_holding_registers`], into an array:
        /// `let [flow, total] = master.holding_registers(107)?`. A quantity that the standard does not
        /// allow does not compile.
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [flow, total] = master.holding_registers(107)", "assert_eq!([flow, total], [555, 100]);")]
        pub $($async)? fn holding_registers<const N: usize>(
            &mut self,
            address: u16,
        ) -> Result<[u16; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_REGISTERS as usize, "1 to 125 registers") };
            let mut registers = [0; N];
            self.read_holding_registers(address, &mut registers)$($wait)*?;
            Ok(registers)
        }

        /// As [`Self::read_input_registers`], into an array, as [`Self::holding_registers`].
        ///
        /// # Errors
        /// As [`Self::read_coils`].
        #[doc = example!([$($async)?] "", "let [inside, outside] = master.input_registers(0)", "assert_eq!([inside, outside], [21, 22]);")]
        pub $($async)? fn input_registers<const N: usize>(
            &mut self,
            address: u16,
        ) -> Result<[u16; N], Error> {
            const { assert!(N >= 1 && N <= MAX_READ_REGISTERS as usize, "1 to 125 registers") };
            let mut registers = [0; N];
            self.read_input_registers(address, &mut registers)$($wait)*?;
            Ok(registers)
        }
    };
}

pub(super) use {calls, example};

// The code that the examples of the documentation hide: a `Uart` with a simulated device on its
// line.

/// Each call of the clock takes 100 us. After a write, `sends` arrives.
struct Uart {
    sends: &'static [u8],
    now: u32,
    arriving: &'static [u8],
    sent: usize,
}

impl mbm::port::Port for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.arriving.len());
        let (now, later) = self.arriving.split_at(count);
        bytes[..count].copy_from_slice(now);
        self.arriving = later;
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.sent += bytes.len();
        self.arriving = self.sends;
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now += 100;
        self.now
    }
}

/// The UART of a line on which unit 17 answers that registers 107 and 108 are 555 and 100.
#[allow(dead_code)]
fn uart() -> Uart {
    Uart {
        sends: &[17, 3, 4, 0x02, 0x2B, 0x00, 0x64, 0x9B, 0xA9],
        now: 0,
        arriving: &[],
        sent: 0,
    }
}

// The code that the examples of the documentation hide: a port on which a request arrives. The link is
// lost some time later.

/// Each call of the clock takes 1 ms.
struct Requests {
    arriving: &'static [u8],
    now: u32,
}

impl mbm::port::Port for Requests {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.arriving.len());
        let (now, later) = self.arriving.split_at(count);
        bytes[..count].copy_from_slice(now);
        self.arriving = later;
        match self.now {
            2_000_000.. => Err(mbm::Error::LinkLost),
            _ => Ok(count),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now += 1_000;
        self.now
    }
}

fn requests(arriving: &'static [u8]) -> Requests {
    Requests { arriving, now: 0 }
}

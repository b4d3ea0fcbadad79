//! Bits of entropy-coded data (T.81, F.2.2.5), up to the marker that ends them.

/// A reader at one place of a file.
pub(super) struct Bits<'a> {
    data: &'a [u8],
    at: usize,
    /// The next bits, the first of them highest.
    buffer: u64,
    count: u32,
    /// How many of these stand for nothing in the file.
    missing: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self { data, at, buffer: 0, count: 0, missing: 0 }
    }

    /// At least 32 bits; behind the end of the data they are 0.
    #[inline]
    pub(super) fn fill(&mut self) {
        if self.count >= 32 {
            return;
        }
        if let Some(eight) = self.data.get(self.at..).and_then(|rest| rest.first_chunk()) {
            let word = u64::from_be_bytes(*eight);
            if !has_marker(word) {
                self.buffer |= word >> self.count;
                let bytes = (63 - self.count) / 8;
                self.at += bytes as usize;
                self.count += 8 * bytes;
                return;
            }
        }
        self.fill_slowly();
    }

    #[cold]
    fn fill_slowly(&mut self) {
        // what the quick way left below the counted bits is read again
        self.buffer &= !(u64::MAX >> self.count);
        while self.count <= 56 {
            let byte = match self.data.get(self.at..) {
                Some([0xFF, 0, ..]) => {
                    self.at += 2;
                    0xFF
                }
                Some([byte, ..]) if *byte != 0xFF => {
                    self.at += 1;
                    *byte
                }
                _ => {
                    self.missing += 8;
                    0
                }
            };
            self.buffer |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    /// The next 32 bits, the first of them highest, after [`fill`](Bits::fill).
    #[inline]
    pub(super) fn peek(&self) -> u32 {
        (self.buffer >> 32) as u32
    }

    /// Steps over `count` bits, at most as many as were filled.
    #[inline]
    pub(super) fn skip(&mut self, count: u32) {
        self.buffer <<= count;
        self.count -= count;
    }

    /// A number of `count` bits, at most 16.
    pub(super) fn take(&mut self, count: u32) -> u32 {
        self.fill();
        let value = self.peek().checked_shr(32 - count).unwrap_or(0);
        self.skip(count);
        value
    }

    /// Whether more was read than there is.
    #[inline]
    pub(super) fn is_short(&self) -> bool {
        self.missing > self.count
    }

    /// Where the next marker begins, and how many bytes before it were not used.
    pub(super) fn end(&self) -> (usize, usize) {
        let mut unused = (self.count.saturating_sub(self.missing) / 8) as usize;
        let mut at = self.at;
        while let Some(next) = self.data.get(at..).and_then(|rest| rest.iter().position(|b| *b == 0xFF)) {
            unused += next;
            at += next;
            if self.data.get(at + 1) != Some(&0) {
                return (at, unused);
            }
            (unused, at) = (unused + 1, at + 2);
        }
        (self.data.len(), unused)
    }
}

/// Whether any of eight bytes is 0xFF (the inverse of the well-known test for 0; false alarms only cost time).
fn has_marker(word: u64) -> bool {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let inverse = !word;
    inverse.wrapping_sub(ONES) & !inverse & (ONES << 7) != 0
}

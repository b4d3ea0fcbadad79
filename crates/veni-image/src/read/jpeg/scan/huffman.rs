//! Huffman tables (T.81, annex C), made for stepping over coefficients whose values do not matter.

use super::bits::Bits;

/// Codes up to this length are found in one step.
const QUICK: u32 = 10;

/// One table.
pub(super) struct Huffman {
    /// Of every beginning: length of the code and its symbol; 0 where the code is longer, or none.
    codes: Vec<(u8, u8)>,
    /// The same for coefficients of sequential pictures: bits of code and value together, and how many coefficients on.
    steps: Vec<(u8, u8)>,
    /// Of each length: the first code, one more than the last, and where its symbols begin.
    lengths: [(u32, u32, usize); 17],
    symbols: Vec<u8>,
}

impl Huffman {
    /// From the numbers of codes of 1 to 16 bits and their symbols; nothing if they are no code.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self {
            codes: vec![(0, 0); 1 << QUICK],
            steps: vec![(0, 0); 1 << QUICK],
            lengths: [(0, 0, 0); 17],
            symbols: symbols.to_vec(),
        };
        let (mut code, mut next) = (0_u32, 0);
        for (length, count) in (1_u32..).zip(counts) {
            let first = code;
            for _ in 0..*count {
                let symbol = *symbols.get(next)?;
                if code >> length != 0 {
                    return None;
                }
                if length <= QUICK {
                    let from = (code << (QUICK - length)) as usize;
                    let all = from..from + (1 << (QUICK - length));
                    table.codes[all.clone()].fill((length as u8, symbol));
                    table.steps[all].fill((length as u8 + (symbol & 15), forward(symbol)));
                }
                (code, next) = (code + 1, next + 1);
            }
            table.lengths[length as usize] = (first, code, next - usize::from(*count));
            code <<= 1;
        }
        Some(table)
    }

    /// The next symbol; nothing where no code begins with these bits.
    #[inline]
    pub(super) fn symbol(&self, bits: &mut Bits<'_>) -> Option<u8> {
        bits.fill();
        let (length, symbol) = self.codes[(bits.peek() >> (32 - QUICK)) as usize];
        if length > 0 {
            bits.skip(u32::from(length));
            return Some(symbol);
        }
        self.long(bits)
    }

    /// Steps over a code and the value behind it, and says how many coefficients that takes; 64 at the end of a block.
    #[inline]
    pub(super) fn step(&self, bits: &mut Bits<'_>) -> Option<u32> {
        bits.fill();
        let (length, on) = self.steps[(bits.peek() >> (32 - QUICK)) as usize];
        if length > 0 {
            bits.skip(u32::from(length));
            return Some(u32::from(on));
        }
        let symbol = self.long(bits)?;
        bits.fill();
        bits.skip(u32::from(symbol & 15));
        Some(u32::from(forward(symbol)))
    }

    #[cold]
    fn long(&self, bits: &mut Bits<'_>) -> Option<u8> {
        for length in QUICK + 1..=16 {
            let code = bits.peek() >> (32 - length);
            let (first, end, at) = self.lengths[length as usize];
            if (first..end).contains(&code) {
                bits.skip(length);
                return self.symbols.get(at + (code - first) as usize).copied();
            }
        }
        None
    }
}

/// How far a symbol of a run and a size leads (T.81, F.1.2.2.1).
fn forward(symbol: u8) -> u8 {
    match (symbol >> 4, symbol & 15) {
        (15, 0) => 16,
        (_, 0) => 64,
        (run, _) => run + 1,
    }
}

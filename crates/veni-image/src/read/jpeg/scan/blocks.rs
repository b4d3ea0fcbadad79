//! Steps over the coefficients of one block of 8 × 8 (T.81, F.2.2 and G.2).

use super::bits::Bits;
use super::huffman::Huffman;

/// All coefficients of a block in a sequential picture; nothing where a code is none.
#[inline]
pub(super) fn sequential(bits: &mut Bits<'_>, dc: &Huffman, ac: &Huffman) -> Option<()> {
    dc.step(bits)?;
    let mut k = 1;
    while k < 64 {
        k += ac.step(bits)?;
    }
    Some(())
}

/// What a scan of a progressive picture adds: bits of coefficients `first` to `last`, for the first time or not.
pub(super) struct Band {
    pub(super) first: u32,
    pub(super) last: u32,
    pub(super) refines: bool,
}

impl Band {
    /// The lowest coefficient of a block; the `table` is of its first bits.
    pub(super) fn lowest(&self, bits: &mut Bits<'_>, table: Option<&Huffman>) -> Option<()> {
        if self.refines {
            bits.take(1);
            return Some(());
        }
        table?.step(bits).map(|_| ())
    }

    /// Other coefficients of a block, of which those other than 0 are `known`. `run` counts the blocks that follow without
    /// codes.
    pub(super) fn others(
        &self,
        bits: &mut Bits<'_>,
        table: &Huffman,
        known: &mut u64,
        run: &mut u32,
    ) -> Option<()> {
        if self.refines {
            self.more_bits(bits, table, known, run)
        } else {
            self.first_bits(bits, table, known, run)
        }
    }

    fn first_bits(&self, bits: &mut Bits<'_>, table: &Huffman, known: &mut u64, run: &mut u32) -> Option<()> {
        if *run > 0 {
            *run -= 1;
            return Some(());
        }
        let mut k = self.first;
        while k <= self.last {
            let symbol = table.symbol(bits)?;
            let (zeros, size) = (u32::from(symbol >> 4), u32::from(symbol & 15));
            match (zeros, size) {
                (15, 0) => k += 16,
                (_, 0) => {
                    *run = (1 << zeros) - 1 + bits.take(zeros);
                    break;
                }
                _ => {
                    k += zeros;
                    *known |= 1_u64.checked_shl(k).unwrap_or(0);
                    bits.take(size);
                    k += 1;
                }
            }
        }
        Some(())
    }

    fn more_bits(&self, bits: &mut Bits<'_>, table: &Huffman, known: &mut u64, run: &mut u32) -> Option<()> {
        let mut k = self.first;
        while *run == 0 && k <= self.last {
            let symbol = table.symbol(bits)?;
            let (mut zeros, size) = (u32::from(symbol >> 4), u32::from(symbol & 15));
            if size == 0 && zeros < 15 {
                *run = (1 << zeros) + bits.take(zeros);
                break;
            }
            // the sign of a new one
            bits.take(u32::from(size > 0));
            // one more bit for those that are passed and known
            while k <= self.last && (*known >> k & 1 == 1 || zeros > 0) {
                if *known >> k & 1 == 1 {
                    bits.take(1);
                } else {
                    zeros -= 1;
                }
                k += 1;
            }
            if size > 0 && k <= self.last {
                *known |= 1 << k;
            }
            k += 1;
        }
        if *run > 0 {
            *run -= 1;
            let mut rest = (*known >> k & (u64::MAX >> (63 - self.last + k))).count_ones();
            while rest > 0 {
                let some = rest.min(16);
                bits.take(some);
                rest -= some;
            }
        }
        Some(())
    }
}

//! Frames, tables and scan headers (T.81, annex B.2), as far as a walk over the coefficients needs them.

use super::huffman::Huffman;

/// One component of a frame.
pub(super) struct Component {
    id: u8,
    /// Blocks of an interleaved unit, across and down.
    pub(super) sampling: [usize; 2],
    /// Blocks of this component alone, across and down.
    pub(super) blocks: [usize; 2],
    /// Blocks in a row of whole units.
    pub(super) stride: usize,
    /// Progressive: which coefficients of each block are known not to be 0.
    pub(super) known: Vec<u64>,
    /// The lowest bit that was sent of each coefficient.
    pub(super) sent: [Option<u8>; 64],
}

/// The picture.
pub(super) struct Frame {
    pub(super) progressive: bool,
    pub(super) components: Vec<Component>,
    /// Interleaved units across and down.
    pub(super) units: [usize; 2],
}

impl Frame {
    /// Nothing for what the decoder refuses.
    pub(super) fn new(marker: u8, content: &[u8]) -> Option<Self> {
        let (&[_, a, b, c, d, count], rest) = content.split_first_chunk()?;
        let size = [[c, d], [a, b]].map(|n| usize::from(u16::from_be_bytes(n)));
        let specified = rest.as_chunks::<3>().0.get(..usize::from(count))?;
        let factors = |byte: u8| [usize::from(byte >> 4), usize::from(byte & 15)];
        let all = specified.iter().map(|[_, factor, _]| factors(*factor));
        if count == 0 || size.contains(&0) || all.clone().flatten().any(|f| !(1..=4).contains(&f)) {
            return None;
        }
        let largest = all.fold([1; 2], |[h, v], [a, b]| [h.max(a), v.max(b)]);
        let units = [0, 1].map(|axis| size[axis].div_ceil(8 * largest[axis]));
        let progressive = marker == 0xC2;
        let component = |&[id, factor, _]: &[u8; 3]| {
            let sampling = factors(factor);
            let blocks = [0, 1].map(|axis| (size[axis] * sampling[axis]).div_ceil(largest[axis]).div_ceil(8));
            let [across, down] = [0, 1].map(|axis| units[axis] * sampling[axis]);
            let known = if progressive { vec![0; across * down] } else { Vec::new() };
            Component { id, sampling, blocks, stride: across, known, sent: [None; 64] }
        };
        Some(Self { progressive, components: specified.iter().map(component).collect(), units })
    }
}

/// Tables that are in force.
#[derive(Default)]
pub(super) struct Tables {
    pub(super) dc: [Option<Huffman>; 4],
    pub(super) ac: [Option<Huffman>; 4],
}

impl Tables {
    /// Takes the tables of a segment; those that are none are left to the decoder.
    pub(super) fn define(&mut self, mut content: &[u8]) {
        while let Some((&[place], rest)) = content.split_first_chunk() {
            let Some((counts, rest)) = rest.split_first_chunk::<16>() else { return };
            let total = counts.iter().map(|n| usize::from(*n)).sum();
            let Some((symbols, rest)) = rest.split_at_checked(total) else { return };
            content = rest;
            let class = if place >> 4 == 0 { &mut self.dc } else { &mut self.ac };
            if let Some(table) = class.get_mut(usize::from(place & 15)) {
                *table = Huffman::new(counts, symbols);
            }
        }
    }
}

/// A scan header: the components (by their place in the frame) with their tables, and which bits of which coefficients.
pub(super) struct Scan {
    pub(super) parts: Vec<(usize, [usize; 2])>,
    pub(super) band: [u8; 2],
    pub(super) high: u8,
    pub(super) low: u8,
}

impl Scan {
    /// Nothing for what the decoder refuses.
    pub(super) fn new(frame: &Frame, content: &[u8]) -> Option<Self> {
        let (&[count], rest) = content.split_first_chunk()?;
        let (named, rest) = rest.split_at_checked(2 * usize::from(count))?;
        let &[first, last, bits, ..] = rest else { return None };
        let part = |&[id, tables]: &[u8; 2]| {
            let place = frame.components.iter().position(|c| c.id == id)?;
            Some((place, [usize::from(tables >> 4), usize::from(tables & 15)]))
        };
        let parts: Vec<_> = named.as_chunks().0.iter().map(part).collect::<Option<_>>()?;
        let plausible = !frame.progressive || (first <= last && last < 64 && (parts.len() == 1 || last == 0));
        let band = if frame.progressive { [first, last] } else { [0, 63] };
        let [high, low] = if frame.progressive { [bits >> 4, bits & 15] } else { [0, 0] };
        (plausible && !parts.is_empty()).then_some(Self { parts, band, high, low })
    }
}

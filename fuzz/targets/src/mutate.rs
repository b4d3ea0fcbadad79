//! Deterministic mutations: the same seed and inputs give the same sequence everywhere.

use veni_light::random::Stream;

/// Numbers at which readers stumble.
const EDGES: [u64; 14] =
    [0, 1, 2, 3, 4, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFF_FFFF, 0xFFFF_FFFF, i64::MAX as u64, u64::MAX];
/// No input grows beyond this.
const LONGEST: usize = 1 << 16;

/// Makes new inputs of old ones.
#[derive(Debug)]
pub struct Mutator {
    random: Stream,
    inputs: Vec<Vec<u8>>,
}

impl Mutator {
    /// From the inputs of a target; none of them is empty.
    pub fn new(seed: u64, mut inputs: Vec<Vec<u8>>) -> Self {
        inputs.retain(|input| !input.is_empty() && input.len() <= LONGEST);
        assert!(!inputs.is_empty(), "no inputs to begin with");
        Self { random: Stream::from_seed(seed), inputs }
    }

    /// One of the inputs with one to eight changes.
    pub fn next(&mut self) -> Vec<u8> {
        let pick = self.below(self.inputs.len());
        let mut data = self.inputs[pick].clone();
        for _ in 0..=self.below(8) {
            self.change(&mut data);
            if data.is_empty() {
                break;
            }
        }
        data.truncate(LONGEST);
        data
    }

    fn below(&mut self, count: usize) -> usize {
        self.random.below(count.max(1))
    }

    fn change(&mut self, data: &mut Vec<u8>) {
        let at = self.below(data.len());
        let length = 1 + self.below(16.min(data.len() - at));
        match self.below(8) {
            0 => data[at] ^= 1 << self.below(8),
            1 => data[at] = self.below(256) as u8,
            2 => self.number(data, at),
            3 => drop(data.drain(at..at + length)),
            4 => {
                let copy = data[at..at + length].to_vec();
                let to = self.below(data.len() + 1);
                data.splice(to..to, copy);
            }
            5 => {
                let (from, to) = (at, self.below(data.len() - length + 1));
                data.copy_within(from..from + length, to);
            }
            6 => {
                let other = self.below(self.inputs.len());
                let cut = self.below(self.inputs[other].len());
                data.truncate(at + 1);
                data.extend(&self.inputs[other][cut..]);
            }
            _ => data.truncate(at),
        }
    }

    /// An edge case, or a step up or down, in one, two, four or eight bytes of either order.
    fn number(&mut self, data: &mut [u8], at: usize) {
        let width = [1, 2, 4, 8][self.below(4)].min(data.len() - at);
        let little = self.below(2) == 0;
        let bytes = &mut data[at..at + width];
        let mut value = bytes.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
        if !little {
            value = value.swap_bytes() >> (8 * (8 - width));
        }
        value = match self.random.next_u64() % 3 {
            0 => value.wrapping_add(1),
            1 => value.wrapping_sub(1),
            _ => EDGES[(self.random.next_u64() % EDGES.len() as u64) as usize],
        };
        let all = value.to_le_bytes();
        let new = all[..width].iter();
        if little {
            bytes.iter_mut().zip(new).for_each(|(to, from)| *to = *from);
        } else {
            bytes.iter_mut().zip(new.rev()).for_each(|(to, from)| *to = *from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_inputs_and_they_differ() {
        let make = |seed| {
            let mut mutator = Mutator::new(seed, vec![b"the quick brown fox".to_vec(), vec![7; 100]]);
            (0..200).map(|_| mutator.next()).collect::<Vec<_>>()
        };
        assert_eq!(make(1), make(1));
        assert_ne!(make(1), make(2));
        let mut all = make(1);
        all.sort();
        all.dedup();
        assert!(all.len() > 150, "{}", all.len());
    }
}

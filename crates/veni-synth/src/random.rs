//! Draws for scenes: streams named by (seed, index, what for), as everywhere in veni.

use veni_light::random::Stream;

/// What a stream of one scene is for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    /// The parameters of the scene.
    Scene,
    /// Where things stand.
    Layout,
    /// Stars.
    Stars,
    /// Where the sun is looked for.
    Sun,
}

/// A stream of random numbers with the draws that scenes need.
pub(super) struct Draw(Stream);

impl Draw {
    pub(super) fn new(seed: u64, index: u64, part: Part) -> Self {
        // the last word keeps these streams apart from those of training
        Self(Stream::from_key([seed, index, part as u64, 0x5359_4e54_4853_4b59]))
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
    }

    /// Uniform between two numbers.
    pub(super) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm.
    pub(super) fn log_range(&mut self, low: f32, high: f32) -> f32 {
        self.range(low.ln(), high.ln()).exp()
    }

    /// Normal with this mean and deviation.
    pub(super) fn normal(&mut self, mean: f32, deviation: f32) -> f32 {
        mean + deviation * self.0.normal() as f32
    }

    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    pub(super) fn bits(&mut self) -> u32 {
        self.0.next_u32()
    }

    /// A whole number, both ends included.
    pub(super) fn count(&mut self, low: usize, high: usize) -> usize {
        low + ((high - low + 1) as f32 * self.unit()) as usize
    }

    /// One of these, by weight.
    pub(super) fn weighted<T: Copy>(&mut self, choices: &[(f32, T)]) -> T {
        let total: f32 = choices.iter().map(|c| c.0).sum();
        let mut at = self.unit() * total;
        for (weight, choice) in choices {
            at -= weight;
            if at < 0.0 {
                return *choice;
            }
        }
        choices[choices.len() - 1].1
    }

    /// An azimuth in radians.
    pub(super) fn azimuth(&mut self) -> f32 {
        self.range(-std::f32::consts::PI, std::f32::consts::PI)
    }
}

//! A window against negative values, only where there are some. LIGHT (14).

use super::{Basis, Sh};
use crate::sphere::Equirect;
use crate::vector::{unit, wide};

/// The function that is kept from being negative, and what that took.
#[derive(Clone, Debug, PartialEq)]
pub struct Windowed<const L: usize> {
    /// Coefficients, of band l times 1 / (1 + λ l²(l + 1)²).
    pub sh: Sh<L>,
    /// λ; 0 where nothing was negative and nothing was changed.
    pub strength: f64,
}

impl<const L: usize> Sh<L> {
    /// The least value over the sphere, of the darkest channel, on a grid four times as fine as the highest band.
    pub fn least(&self) -> f64 {
        Samples::new(L).least(self)
    }

    /// The weakest window that leaves no value negative: the mean is kept, higher bands shrink. Nothing is changed where nothing
    /// is negative. Where the mean itself is negative nothing helps, and only the mean is left.
    #[must_use]
    pub fn windowed(&self) -> Windowed<L> {
        let samples = Samples::new(L);
        if samples.least(self) >= 0.0 {
            return Windowed { sh: self.clone(), strength: 0.0 };
        }
        let window = |strength: f64| {
            self.banded(|l| {
                let l = l as f64;
                1.0 / (1.0 + strength * (l * (l + 1.0)).powi(2))
            })
        };
        let (mut weak, mut strong) = (0.0, 1e-4);
        while samples.least(&window(strong)) < 0.0 && strong < 1e12 {
            (weak, strong) = (strong, strong * 4.0);
        }
        for _ in 0..40 {
            let middle = 0.5 * (weak + strong);
            if samples.least(&window(middle)) < 0.0 { weak = middle } else { strong = middle }
        }
        Windowed { sh: window(strong), strength: strong }
    }
}

/// The basis at many directions.
struct Samples {
    rows: Vec<f64>,
    len: usize,
}

impl Samples {
    fn new(order: usize) -> Self {
        let height = (8 * order).max(16);
        let directions: Vec<_> =
            Equirect::new(2 * height, height).directions().iter().map(|d| unit(wide(*d))).collect();
        let basis = Basis::new(order);
        Self { rows: basis.matrix(&directions), len: basis.len() }
    }

    fn least<const L: usize>(&self, sh: &Sh<L>) -> f64 {
        let values = self.rows.chunks_exact(self.len).flat_map(|row| sh.combine(row));
        values.fold(f64::INFINITY, f64::min)
    }
}

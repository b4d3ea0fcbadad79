//! Adam on a few numbers.

/// The state of Adam (Kingma & Ba 2015) with β = (0.9, 0.999), in double precision: these are few numbers, and a tiny ε
/// amplifies every rounding. The numbers themselves are the caller's, in whatever precision.
#[derive(Clone, Debug)]
pub struct Adam {
    first: Vec<f64>,
    second: Vec<f64>,
    epsilon: f64,
    updates: u64,
}

impl Adam {
    /// For `count` numbers, with `epsilon` added to the root of the second moment.
    pub fn new(count: usize, epsilon: f64) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count], epsilon, updates: 0 }
    }

    /// What to add to each number, against `gradient` (a derivative for each): at first about `rate` in length.
    ///
    /// # Panics
    /// If there are not as many derivatives as numbers.
    pub fn step(&mut self, gradient: &[f64], rate: f64) -> Vec<f64> {
        assert_eq!(gradient.len(), self.first.len(), "a derivative for each number");
        self.updates += 1;
        let t = self.updates as f64;
        let (bias1, bias2) = (1.0 - 0.9_f64.powf(t), 1.0 - 0.999_f64.powf(t));
        let moments = self.first.iter_mut().zip(&mut self.second);
        let change = |((m, v), g): ((&mut f64, &mut f64), &f64)| {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            -(rate / bias1 * *m / ((*v / bias2).sqrt() + self.epsilon))
        };
        moments.zip(gradient).map(change).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_rate_as_its_length_and_many_reach_the_minimum() {
        let (mut x, mut adam) = ([0.0, 0.0], Adam::new(2, 1e-15));
        let mut step = |x: &mut [f64; 2], rate| {
            let change = adam.step(&[200.0 * (x[0] - 1.0), 0.02 * (x[1] + 2.0)], rate);
            x.iter_mut().zip(change).for_each(|(x, by)| *x += by);
        };
        step(&mut x, 0.1);
        assert!((x[0] - 0.1).abs() < 1e-12 && (x[1] + 0.1).abs() < 1e-12, "{x:?}");
        for k in 0..400 {
            step(&mut x, 0.1 * 0.98_f64.powi(k));
        }
        assert!((x[0] - 1.0).abs() < 5e-3 && (x[1] + 2.0).abs() < 5e-3, "{x:?}");
    }

    /// The fits' numbers depend on how each update is rounded.
    #[test]
    fn updates_are_rounded_as_ever() {
        let (mut x, mut adam) = ([0.7_f32, -1.3, 0.01], Adam::new(3, 1e-15));
        for k in 0..50 {
            let gradient = x.map(|v| f64::from(v) * 3.0 + 0.1 - 0.01 * f64::from(k));
            let change = adam.step(&gradient, 0.05);
            x.iter_mut().zip(change).for_each(|(x, by)| *x = (f64::from(*x) + by) as f32);
        }
        assert_eq!(x.map(f32::to_bits), [0x3e26_10c7, 0x3e3f_7d81, 0x3e0a_a760]);
    }
}

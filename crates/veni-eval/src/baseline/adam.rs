//! Adam on a few numbers.

/// The state of Adam (Kingma & Ba 2015) with β = (0.9, 0.999), in f64.
#[derive(Clone, Debug)]
pub struct Adam {
    first: Vec<f64>,
    second: Vec<f64>,
    epsilon: f64,
    updates: i32,
}

impl Adam {
    /// For `count` numbers, with `epsilon` added to the root of the second moment.
    pub fn new(count: usize, epsilon: f64) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count], epsilon, updates: 0 }
    }

    /// One step of length about `rate` against `gradient`.
    ///
    /// # Panics
    /// If there are not as many values and gradients as at the start.
    pub fn step(&mut self, values: &mut [f64], gradient: &[f64], rate: f64) {
        assert!(values.len() == self.first.len() && gradient.len() == self.first.len(), "Adam's state");
        self.updates += 1;
        let (bias1, bias2) = (1.0 - 0.9_f64.powi(self.updates), 1.0 - 0.999_f64.powi(self.updates));
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((x, (m, v)), g) in values.iter_mut().zip(moments).zip(gradient) {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            *x -= rate * *m / bias1 / ((*v / bias2).sqrt() + self.epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_rate_as_its_length_and_many_reach_the_minimum() {
        let gradient = |x: &[f64]| [200.0 * (x[0] - 1.0), 0.02 * (x[1] + 2.0)];
        let (mut x, mut adam) = ([0.0, 0.0], Adam::new(2, 1e-15));
        let g = gradient(&x);
        adam.step(&mut x, &g, 0.1);
        assert!((x[0] - 0.1).abs() < 1e-12 && (x[1] + 0.1).abs() < 1e-12, "{x:?}");
        for k in 0..400 {
            let g = gradient(&x);
            adam.step(&mut x, &g, 0.1 * 0.98_f64.powi(k));
        }
        assert!((x[0] - 1.0).abs() < 5e-3 && (x[1] + 2.0).abs() < 5e-3, "{x:?}");
    }
}

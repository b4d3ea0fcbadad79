//! Adam on a few numbers.

/// Numbers under optimisation, with Adam's moments.
#[derive(Clone, Debug)]
pub(super) struct Variable {
    pub(super) values: Vec<f32>,
    first: Vec<f64>,
    second: Vec<f64>,
    epsilon: f64,
}

impl Variable {
    pub(super) fn new(values: Vec<f32>, epsilon: f64) -> Self {
        let zeros = vec![0.0; values.len()];
        Self { values, first: zeros.clone(), second: zeros, epsilon }
    }

    /// Adam with β = (0.9, 0.999), in double precision: these are few numbers, and a tiny ε amplifies every rounding.
    pub(super) fn update(&mut self, gradient: &[f64], rate: f64, t: u64) {
        assert_eq!(gradient.len(), self.values.len(), "a derivative for each number");
        let (bias1, bias2) = (1.0 - 0.9_f64.powf(t as f64), 1.0 - 0.999_f64.powf(t as f64));
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((x, (m, v)), g) in self.values.iter_mut().zip(moments).zip(gradient) {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            let root = (*v / bias2).sqrt();
            *x = (f64::from(*x) - rate / bias1 * *m / (root + self.epsilon)) as f32;
        }
    }
}

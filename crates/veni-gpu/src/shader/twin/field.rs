//! `field.wgsl`, and `tile.wgsl` with `bake_tiled.wgsl`, which compute the same for many directions at once.

use super::{Twin, veni_encode};

impl Twin {
    /// Natural log of radiance from native unit direction d by latent `index`, without its lights.
    pub fn veni_log_radiance_of(&self, index: usize, d: [f32; 3]) -> [f64; 3] {
        let mut x = self.project(index, d);
        for layer in 0..self.sizes.layers {
            self.residual_layer(index, layer, &mut x);
        }
        let (network, lobes) = (self.output(index, &x), self.veni_lobes(index, d));
        [0, 1, 2].map(|c| network[c] + lobes[c])
    }

    /// Input bias plus the encoded direction times the input matrix.
    pub fn project(&self, index: usize, d: [f32; 3]) -> Vec<f64> {
        let mut x: Vec<_> = self.latent(index)[..self.sizes.hidden].iter().map(|v| f64::from(*v)).collect();
        for input in 0..self.sizes.latents + 2 {
            let features = veni_encode(self, index, input, d);
            self.multiply(5 * input, &features, &mut x);
        }
        x
    }

    /// y += x times the matrix that begins at row `first`.
    pub fn multiply(&self, first: usize, x: &[f64], y: &mut [f64]) {
        for (x, row) in x.iter().zip(self.matrices.chunks_exact(self.row()).skip(first)) {
            y.iter_mut().zip(row).for_each(|(y, w)| *y += x * f64::from(*w));
        }
    }

    /// x = γ (x − mean) / √(variance + 1e-5).
    pub fn normalise(&self, gamma: &[f32], x: &mut [f64]) {
        let count = x.len() as f64;
        let mean = x.iter().sum::<f64>() / count;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        let scale = 1.0 / (variance + 1e-5).sqrt();
        x.iter_mut().zip(gamma).for_each(|(x, gamma)| *x = (*x - mean) * (scale * f64::from(*gamma)));
    }

    /// One residual layer, both norms included.
    pub fn residual_layer(&self, index: usize, layer: usize, x: &mut [f64]) {
        let add = |x: &mut [f64], v: &[f32]| x.iter_mut().zip(v).for_each(|(x, v)| *x += f64::from(*v));
        let matrix = |part: usize| 5 * self.sizes.padded_inputs() + (2 * layer + part) * self.row();
        self.normalise(self.vector(layer, 0), x);
        add(x, self.vector(layer, 1));
        let mut y = vec![0.0; x.len()];
        add(&mut y, self.vector(layer, 2));
        self.multiply(matrix(0), x, &mut y);
        y.iter_mut().for_each(|y| *y = y.max(0.0));
        add(x, self.vector(layer, 3));
        self.multiply(matrix(1), &y, x);
        self.normalise(self.vector(layer, 4), x);
        add(x, &self.latent(index)[(layer + 1) * self.row()..]);
    }

    /// Log radiance of the last features, without lobes.
    pub fn output(&self, index: usize, x: &[f64]) -> [f64; 3] {
        let row = |channel: usize| &self.vectors[(5 * self.sizes.layers + channel) * self.row()..];
        let (exposure, _) = self.after_vectors(index);
        std::array::from_fn(|c| {
            let sum: f64 = x.iter().zip(row(c)).map(|(x, w)| x * f64::from(*w)).sum();
            sum + f64::from(row(3)[c]) + exposure
        })
    }
}

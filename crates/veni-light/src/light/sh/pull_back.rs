//! From a derivative with respect to what light does to one with respect to the latent that it came from. LIGHT (15).

use super::Sh;
use super::pixels::Integrals;
use crate::field::{Field, Gradient};
use crate::sphere::Equirect;
use crate::vector::dot;

impl<const L: usize> Sh<L> {
    /// The gradient with respect to the latent of Σ ∂_lm c_lm, where `self` holds ∂, the derivative of some loss with respect to
    /// every coefficient of [`Sh::of_field`] on this grid: the coefficients are linear in radiance, and radiance has
    /// [`Field::gradient`]. The gradient's `loss` is that sum.
    pub fn pull_back(&self, field: &Field, grid: Equirect) -> Gradient {
        let integrals = Integrals::new(grid, L);
        field.gradient(&grid.directions(), |index, log_radiance| {
            let mut row = vec![0.0; Self::LEN];
            integrals.of_pixel(index % grid.width, index / grid.width, &mut row);
            weighted(self.combine(&row), log_radiance)
        })
    }
}

/// The gradient with respect to the latent of Σ_k ⟨∂_k, E(n_k)⟩, E the irradiance on a surface of normal n_k summed over the
/// pixels of `grid`. Pairs of a unit normal and ∂ (R, G, B).
pub fn pull_back_irradiance(field: &Field, grid: Equirect, normals: &[([f32; 3], [f64; 3])]) -> Gradient {
    let directions = grid.directions();
    field.gradient(&directions, |index, log_radiance| {
        let solid_angle = grid.solid_angle(index / grid.width);
        let mut weight = [0.0; 3];
        for (normal, derivative) in normals {
            let cosine = dot(directions[index], *normal);
            let light = solid_angle * f64::from(cosine.max(0.0));
            weight = [0, 1, 2].map(|c| weight[c] + light * derivative[c]);
        }
        weighted(weight, log_radiance)
    })
}

/// Σ w L and its derivatives with respect to ln L.
fn weighted(weight: [f64; 3], log_radiance: [f32; 3]) -> (f64, [f32; 3]) {
    let part = [0, 1, 2].map(|c| weight[c] * f64::from(log_radiance[c]).exp());
    (part.iter().sum(), part.map(|v| v as f32))
}

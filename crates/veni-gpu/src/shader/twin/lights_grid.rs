//! `lights_grid.wgsl`. MODEL (72).

use super::Twin;
use crate::shader::Request;

impl Twin {
    /// Radiance of the lights of latent `latent` on pixel `index` of the whole grid, whose middle is in the native unit direction d;
    /// `gains` are those of [`pack_gains`](crate::shader::pack_gains).
    pub fn lights_at(
        &self,
        request: &Request,
        gains: &[[u32; 4]],
        latent: usize,
        index: u32,
        d: [f32; 3],
    ) -> [f64; 3] {
        let smooth = self.lights_where(latent, d, |extent| extent < 0.0 && extent >= -request.smoothest());
        let gained = gained(gains, latent, index);
        [0, 1, 2].map(|c| smooth[c] + f64::from(gained[c]))
    }
}

/// What pixel `index` gains in a list.
pub fn gained(gains: &[[u32; 4]], latent: usize, index: u32) -> [f32; 3] {
    let Some([first, count, ..]) = gains.get(latent).copied() else { return [0.0; 3] };
    let own = &gains[first as usize..][..count as usize];
    let found = own.binary_search_by_key(&index, |gain| gain[0]);
    found.map_or([0.0; 3], |at| [1, 2, 3].map(|c| f32::from_bits(own[at][c])))
}

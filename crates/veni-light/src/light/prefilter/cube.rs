//! Six faces of radiance, and how they are filled.

use super::CubeAxes;
use crate::sphere::CubeFace;
use crate::tasks;

/// A cube map: six faces in the order +X −X +Y −Y +Z −Z, row-major each.
#[derive(Clone, Debug, PartialEq)]
pub struct CubeMap {
    size: usize,
    texels: Vec<[f32; 3]>,
}

impl CubeMap {
    /// From texels, face after face.
    ///
    /// # Panics
    /// If there are not 6·size² texels.
    pub fn new(size: usize, texels: Vec<[f32; 3]>) -> Self {
        assert_eq!(texels.len(), 6 * size * size, "texels of a cube map of {size}");
        Self { size, texels }
    }

    /// Texels along a side.
    pub fn size(&self) -> usize {
        self.size
    }

    /// All texels, face after face.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// All texels, to be changed.
    pub fn texels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.texels
    }

    /// One face, row-major.
    pub fn face(&self, face: CubeFace) -> &[[f32; 3]] {
        let area = self.size * self.size;
        &self.texels[face as usize * area..][..area]
    }

    /// The integral of radiance over the sphere.
    pub fn integral(&self) -> [f64; 3] {
        let areas = CubeFace::solid_angles(self.size);
        self.texels.chunks_exact(areas.len()).fold([0.0; 3], |sum, face| {
            face.iter()
                .zip(&areas)
                .fold(sum, |s, (texel, w)| [0, 1, 2].map(|c| s[c] + w * f64::from(texel[c])))
        })
    }

    /// Brings the integral to what is known to be right: values at texel centres miss it by some 1e-4, by where the light falls.
    pub(super) fn scale_to(&mut self, integral: [f64; 3]) {
        let own = self.integral();
        let factor = [0, 1, 2].map(|c| if own[c] > 0.0 { (integral[c] / own[c]) as f32 } else { 1.0 });
        for texel in &mut self.texels {
            *texel = [0, 1, 2].map(|c| texel[c] * factor[c]);
        }
    }

    /// A cube whose texels are means of `radiance` (of unit native directions) over `samples`² places each, weighted by solid
    /// angle.
    pub(super) fn of(
        size: usize,
        axes: CubeAxes,
        samples: usize,
        radiance: impl Fn([f32; 3]) -> [f32; 3] + Sync + Send,
    ) -> Self {
        let mut texels = vec![[0.0; 3]; 6 * size * size];
        let n = samples.max(1);
        let place = |k: usize, s: usize| ((2 * (k * n + s) + 1) as f64 / (size * n) as f64 - 1.0) as f32;
        tasks::each(
            texels.chunks_exact_mut(size).enumerate(),
            || (),
            |(), (line, texels)| {
                let (face, row) = (CubeFace::ALL[line / size], line % size);
                for (column, texel) in texels.iter_mut().enumerate() {
                    let (mut sum, mut weight) = ([0f32; 3], 0.0);
                    for s in 0..n * n {
                        let (a, b) = (place(column, s % n), place(row, s / n));
                        let square = 1.0 + a * a + b * b;
                        let scale = 1.0 / square.sqrt();
                        let w = scale / square;
                        let v = face.lookup(f64::from(a), f64::from(b)).map(|v| v as f32 * scale);
                        let value = radiance(axes.native(v));
                        sum = [0, 1, 2].map(|c| sum[c] + w * value[c]);
                        weight += w;
                    }
                    // a spectrum cut off may fall below zero by its last waves
                    *texel = sum.map(|s| (s / weight).max(0.0));
                }
            },
        );
        Self { size, texels }
    }

    /// The texel that a native direction falls into, and its place in [`CubeMap::texels`].
    pub(super) fn index(size: usize, axes: CubeAxes, direction: [f32; 3]) -> usize {
        let v = axes.lookup(direction);
        let largest = (0..3).fold(0, |k, i| if v[i].abs() > v[k].abs() { i } else { k });
        let face = CubeFace::ALL[2 * largest + usize::from(v[largest] < 0.0)];
        let [x, y, z] = v.map(|c| c / v[largest].abs());
        let (a, b) = match face {
            CubeFace::PosX => (-z, -y),
            CubeFace::NegX => (z, -y),
            CubeFace::PosY => (x, z),
            CubeFace::NegY => (x, -z),
            CubeFace::PosZ => (x, -y),
            CubeFace::NegZ => (-x, -y),
        };
        let cell = |t: f32| ((0.5 * (t + 1.0) * size as f32) as usize).min(size - 1);
        (face as usize * size + cell(b)) * size + cell(a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_found_by_their_directions() {
        for axes in [CubeAxes::GLTF, CubeAxes::FILAMENT, CubeAxes::BEVY, CubeAxes::THREE] {
            let size = 5;
            for (k, face) in CubeFace::ALL.into_iter().enumerate() {
                for t in 0..size * size {
                    let centre = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
                    let v = axes.native(face.lookup(centre(t % size), centre(t / size)).map(|x| x as f32));
                    assert_eq!(CubeMap::index(size, axes, v), k * size * size + t);
                }
            }
        }
    }

    #[test]
    fn a_constant_cube_holds_four_pi() {
        let cube = CubeMap::of(9, CubeAxes::GLTF, 3, |_| [1.0, 2.0, 3.0]);
        for (sum, v) in cube.integral().into_iter().zip([1.0, 2.0, 3.0]) {
            assert!((sum / (4.0 * std::f64::consts::PI) - v).abs() < 1e-6);
        }
    }
}

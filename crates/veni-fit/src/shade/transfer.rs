//! The linear map from the light to the image, row by row. MODEL (54).

use std::collections::HashMap;
use std::sync::Arc;

use pulp::Arch;
use rayon::prelude::*;

use super::kernel::{self, LANES, ROWS};
use super::material::{Lobes, REFERENCE_FLOOR};
use super::{Colour, DistantLights, Material, ShadingForm, Surface};
use crate::{Error, Result};
use veni_light::vector::wide;

/// The memory that [`Transfer::new`] may take for its matrix: 512 MiB.
pub const DEFAULT_MEMORY: usize = 512 << 20;

/// Parts that an image is cut into, whatever the number of threads, so that sums have one order.
const PARTS: usize = 32;

/// Light to image: everything of a rendered image but the light.
///
/// Pixels of equal normal (and, with a specular lobe, equal ray) share a row. The matrix is kept if it fits into the
/// memory allowed; else its rows are computed each time they are needed, which costs time and no memory. Clones share
/// it.
#[derive(Clone, Debug)]
pub struct Transfer {
    size: [usize; 2],
    form: ShadingForm,
    lights: DistantLights,
    lobes: LobeRows,
    shininess: f32,
    /// The result is at least this.
    floor: f32,
    groups: Vec<Group>,
    pixels: Vec<Pixel>,
    /// Row-major, groups × rows of a group × padded lights.
    stored: Option<Arc<Vec<f32>>>,
}

/// What the rows of a group hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LobeRows {
    /// The diffuse lobe, to be coloured by pixel.
    Diffuse,
    /// diffuse grey × its lobe + specular grey × its lobe.
    Mixed { diffuse: f64, specular: f64 },
    /// The diffuse lobe, then the specular one.
    Both { specular: [f32; 3] },
}

/// Pixels that share their rows.
#[derive(Clone, Debug)]
struct Group {
    normal: [f32; 3],
    ray: [f32; 3],
    pixels: std::ops::Range<usize>,
}

/// A pixel that shows the surface.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    at: usize,
    diffuse: [f32; 3],
}

impl Transfer {
    /// A surface of a material under these lights, with at most [`DEFAULT_MEMORY`] for the matrix.
    ///
    /// # Errors
    /// As [`Transfer::with_memory`].
    pub fn new(
        surface: &Surface,
        material: &Material,
        lights: DistantLights,
        form: ShadingForm,
    ) -> Result<Self> {
        Self::with_memory(surface, material, lights, form, DEFAULT_MEMORY)
    }

    /// The same with at most `bytes` for the matrix (0: never kept; right for a single image).
    ///
    /// # Errors
    /// [`Error::Invalid`] for an albedo map of another size, and for reflectances or a shininess that are negative or not
    /// finite.
    pub fn with_memory(
        surface: &Surface,
        material: &Material,
        lights: DistantLights,
        form: ShadingForm,
        bytes: usize,
    ) -> Result<Self> {
        let size = [surface.width(), surface.height()];
        material.check(size[0] * size[1])?;
        let lobes = LobeRows::of(material);
        let (groups, pixels) = group(surface, material);
        let mut transfer = Self {
            size,
            form,
            lights,
            lobes,
            shininess: material.specular.map_or(0.0, |s| s.shininess),
            floor: match form {
                ShadingForm::Reference if material.specular.is_some() => REFERENCE_FLOOR,
                _ => f32::NEG_INFINITY,
            },
            groups,
            pixels,
            stored: None,
        };
        let row = transfer.lobes.rows() * transfer.stride();
        let needed = transfer.groups.len().checked_mul(row).and_then(|n| n.checked_mul(size_of::<f32>()));
        if needed.is_some_and(|n| n <= bytes) {
            let mut rows = vec![0.0; transfer.groups.len() * row];
            rows.par_chunks_exact_mut(row)
                .zip(&transfer.groups)
                .for_each(|(out, group)| transfer.fill(group, out));
            transfer.stored = Some(Arc::new(rows));
        }
        Ok(transfer)
    }

    /// Columns and rows of the image.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The lights, in the order in which their radiance is given.
    pub fn lights(&self) -> &DistantLights {
        &self.lights
    }

    /// The form of the shading.
    pub fn form(&self) -> ShadingForm {
        self.form
    }

    /// Whether the matrix is kept in memory, and not computed for every image.
    #[cfg(test)]
    pub(crate) fn is_stored(&self) -> bool {
        self.stored.is_some()
    }

    /// What a pixel shows that shows no surface.
    pub fn background(&self) -> f32 {
        match self.form {
            ShadingForm::Physical => 0.0,
            ShadingForm::Reference => 1.0,
        }
    }

    /// Row-major indices of the pixels that show the surface, in no particular order.
    pub(super) fn visible(&self) -> impl Iterator<Item = usize> + '_ {
        self.pixels.iter().map(|p| p.at)
    }

    /// The image [H·W, 3], row-major, for the lights' linear radiance [L, 3].
    ///
    /// # Panics
    /// If there is not one radiance per light.
    pub fn render(&self, radiance: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let light = self.planes(radiance);
        let parts = self.parts().map(|range| {
            let mut part = Vec::new();
            self.each_block(range, |groups, rows| {
                let sums = kernel::dot(Arch::new(), rows, &light);
                self.each_pixel(groups, &sums, |pixel, _, value| part.push((pixel.at, value)));
            });
            part
        });
        let parts: Vec<_> = parts.collect();
        let mut image = vec![[self.background(); 3]; self.size[0] * self.size[1]];
        for (at, value) in parts.into_iter().flatten() {
            image[at] = value.map(|v| v.max(self.floor));
        }
        image
    }

    /// The transpose: gradients [H·W, 3] of a loss with respect to the image become gradients [L, 3] with respect to the
    /// lights' radiance, at that `radiance` (on which they depend only through the floor of the reference form).
    ///
    /// # Panics
    /// If there is not one radiance per light, or not one gradient per pixel.
    pub fn pull_back(&self, radiance: &[[f32; 3]], gradient: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let pixels = self.size[0] * self.size[1];
        assert_eq!(gradient.len(), pixels, "{} gradients for {pixels} pixels", gradient.len());
        self.evaluate(&self.planes(radiance), |at, _| (0.0, gradient[at])).1
    }

    /// One pass over the matrix: for every visible pixel `loss` gets its index and value and returns its part of the
    /// loss with the gradient; gives the sum and the gradient with respect to linear radiance.
    pub(super) fn evaluate(
        &self,
        light: &[Vec<f32>; 3],
        loss: impl Fn(usize, [f32; 3]) -> (f64, [f32; 3]) + Sync,
    ) -> (f64, Vec<[f32; 3]>) {
        let parts = self.parts().map(|range| {
            let (mut total, mut gradient) = (0.0, [(); 3].map(|()| vec![0.0; self.stride()]));
            self.each_block(range, |groups, rows| {
                let arch = Arch::new();
                let sums = kernel::dot(arch, rows, light);
                let mut factors = [[0.0; 3]; ROWS];
                self.each_pixel(groups, &sums, |pixel, first, value| {
                    let (part, by_value) = loss(pixel.at, value.map(|v| v.max(self.floor)));
                    total += part;
                    for c in 0..3 {
                        let by_value = if value[c] < self.floor { 0.0 } else { by_value[c] };
                        match self.lobes {
                            LobeRows::Diffuse => factors[first][c] += by_value * pixel.diffuse[c],
                            LobeRows::Mixed { .. } => factors[first][c] += by_value,
                            LobeRows::Both { specular } => {
                                factors[first][c] += by_value * pixel.diffuse[c];
                                factors[first + 1][c] += by_value * specular[c];
                            }
                        }
                    }
                });
                kernel::add(arch, rows, &factors, &mut gradient);
            });
            (total, gradient)
        });
        let parts: Vec<_> = parts.collect();
        let total = parts.iter().map(|p| p.0).sum();
        let mut gradient = vec![[0.0f64; 3]; self.lights.len()];
        for (_, part) in &parts {
            for (c, plane) in part.iter().enumerate() {
                gradient.iter_mut().zip(plane).for_each(|(sum, v)| sum[c] += f64::from(*v));
            }
        }
        (total, gradient.into_iter().map(|g| g.map(|v| v as f32)).collect())
    }

    /// Radiance as three padded planes.
    ///
    /// # Panics
    /// If there is not one radiance per light.
    pub(super) fn planes(&self, radiance: &[[f32; 3]]) -> [Vec<f32>; 3] {
        let (n, m) = (self.lights.len(), radiance.len());
        assert_eq!(n, m, "{m} radiances for {n} lights");
        [0, 1, 2].map(|c| {
            let mut plane = vec![0.0; self.stride()];
            plane.iter_mut().zip(radiance).for_each(|(p, v)| *p = v[c]);
            plane
        })
    }

    fn stride(&self) -> usize {
        self.lights.len().next_multiple_of(LANES)
    }

    /// Ranges of groups, in parallel.
    fn parts(&self) -> impl IndexedParallelIterator<Item = std::ops::Range<usize>> {
        let (n, block) = (self.groups.len(), ROWS / self.lobes.rows());
        let part = n.div_ceil(PARTS).next_multiple_of(block);
        (0..n.div_ceil(part)).into_par_iter().map(move |k| k * part..((k + 1) * part).min(n))
    }

    /// Calls back with a few groups at a time and their rows; rows that are left over are zero.
    fn each_block(&self, range: std::ops::Range<usize>, mut block: impl FnMut(&[Group], kernel::Rows<'_>)) {
        let (stride, rows) = (self.stride(), self.lobes.rows());
        let size = rows * stride;
        let zero = vec![0.0; stride];
        let mut scratch = vec![0.0; if self.stored.is_some() { 0 } else { ROWS * stride }];
        for start in range.clone().step_by(ROWS / rows) {
            let end = (start + ROWS / rows).min(range.end);
            let groups = &self.groups[start..end];
            let used = match &self.stored {
                Some(stored) => &stored[start * size..end * size],
                None => {
                    let used = &mut scratch[..groups.len() * size];
                    used.chunks_exact_mut(size).zip(groups).for_each(|(out, group)| self.fill(group, out));
                    used
                }
            };
            let mut views: kernel::Rows<'_> = [&zero; ROWS];
            views.iter_mut().zip(used.chunks_exact(stride)).for_each(|(view, row)| *view = row);
            block(groups, views);
        }
    }

    /// Colours the sums over the lights of a block: calls back with each pixel, its group's first row in the block, and
    /// its value.
    fn each_pixel(
        &self,
        groups: &[Group],
        sums: &[[f32; 3]; ROWS],
        mut each: impl FnMut(&Pixel, usize, [f32; 3]),
    ) {
        for (k, group) in groups.iter().enumerate() {
            let first = k * self.lobes.rows();
            for pixel in &self.pixels[group.pixels.clone()] {
                let value = [0, 1, 2].map(|c| match self.lobes {
                    LobeRows::Diffuse => pixel.diffuse[c] * sums[first][c],
                    LobeRows::Mixed { .. } => sums[first][c],
                    LobeRows::Both { specular } => {
                        pixel.diffuse[c] * sums[first][c] + specular[c] * sums[first + 1][c]
                    }
                });
                each(pixel, first, value);
            }
        }
    }

    /// Computes a group's rows; the padding stays as it is.
    fn fill(&self, group: &Group, out: &mut [f32]) {
        let lobes = Lobes::new(self.form, wide(group.normal), wide(group.ray), self.shininess);
        let (first, second) = out.split_at_mut(self.stride());
        let lights = self.lights.directions().iter().zip(self.lights.solid_angles());
        for (l, (direction, weight)) in lights.enumerate() {
            let (light, weight) = (wide(*direction), f64::from(*weight));
            match self.lobes {
                LobeRows::Diffuse => first[l] = (weight * lobes.diffuse(light)) as f32,
                LobeRows::Mixed { diffuse, specular } => {
                    let sum = diffuse * lobes.diffuse(light) + specular * lobes.specular(light);
                    first[l] = (weight * sum) as f32;
                }
                LobeRows::Both { .. } => {
                    first[l] = (weight * lobes.diffuse(light)) as f32;
                    second[l] = (weight * lobes.specular(light)) as f32;
                }
            }
        }
    }
}

impl LobeRows {
    /// One row if one is enough: no lobe, or greys that are the same everywhere.
    fn of(material: &Material) -> Self {
        let grey = |c: [f32; 3]| (c[0] == c[1] && c[1] == c[2]).then_some(f64::from(c[0]));
        let Some(specular) = material.specular.map(|s| s.colour) else { return Self::Diffuse };
        match &material.diffuse {
            Colour::Uniform(diffuse) => match (grey(*diffuse), grey(specular)) {
                (Some(diffuse), Some(specular)) => Self::Mixed { diffuse, specular },
                _ => Self::Both { specular },
            },
            Colour::Map(_) => Self::Both { specular },
        }
    }

    /// Rows of a group.
    fn rows(self) -> usize {
        if matches!(self, Self::Both { .. }) { 2 } else { 1 }
    }
}

/// Visible pixels sorted into groups of equal rows, in the order of their first pixels.
fn group(surface: &Surface, material: &Material) -> (Vec<Group>, Vec<Pixel>) {
    let shiny = material.specular.is_some();
    let visible: Vec<usize> = (0..surface.valid().len()).filter(|at| surface.valid()[*at]).collect();
    let mut known: HashMap<[u32; 6], usize> = HashMap::new();
    let mut groups: Vec<Group> = Vec::new();
    let mut group_of = Vec::with_capacity(visible.len());
    for at in &visible {
        let (normal, ray) = (surface.normals()[*at], surface.rays()[*at]);
        let seen = if shiny { ray } else { [0.0; 3] };
        let key = [normal[0], normal[1], normal[2], seen[0], seen[1], seen[2]].map(f32::to_bits);
        let group = *known.entry(key).or_insert(groups.len());
        if group == groups.len() {
            groups.push(Group { normal, ray, pixels: 0..0 });
        }
        // the number of members, until their places are known
        groups[group].pixels.end += 1;
        group_of.push(group);
    }
    let mut start = 0;
    for group in &mut groups {
        let count = group.pixels.end;
        group.pixels = start..start;
        start += count;
    }
    let mut pixels = vec![Pixel { at: 0, diffuse: [0.0; 3] }; visible.len()];
    for (at, group) in visible.into_iter().zip(group_of) {
        let place = &mut groups[group].pixels.end;
        pixels[*place] = Pixel { at, diffuse: material.diffuse.at(at) };
        *place += 1;
    }
    (groups, pixels)
}

/// The one error of everything that takes an image for a transfer.
pub(super) fn check_image(transfer: &Transfer, what: &str, pixels: usize) -> Result<()> {
    let [width, height] = transfer.size();
    if pixels != width * height {
        return Err(Error::invalid(format!(
            "{what} has {pixels} pixels, the surface {width} × {height}: they must be of one size"
        )));
    }
    Ok(())
}

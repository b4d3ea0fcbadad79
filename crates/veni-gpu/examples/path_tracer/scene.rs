//! Camera and spheres, in the native frame: z up, units as you like.

/// Words of the uniform `View` of `tracer.wgsl`.
pub(crate) const VIEW_WORDS: usize = 20;

const EYE: [f32; 3] = [-9.0, 0.6, 1.5];
const LOOK_AT: [f32; 3] = [0.0, 0.0, 1.2];
/// Tangent of half the horizontal angle of view.
const HALF_WIDTH: f32 = 0.39;

/// The uniform `View` for a picture of `size`, a sample, the first row of a portion; then a sampler, a seed, and 1 if every surface is
/// diffuse.
pub(crate) fn view(
    size: [u32; 2],
    sample: u32,
    first_row: u32,
    [sampler, seed, diffuse]: [u32; 3],
) -> [u32; VIEW_WORDS] {
    let [width, height] = size;
    let sub = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let unit = |a: [f32; 3]| a.map(|v| v / a.iter().map(|v| v * v).sum::<f32>().sqrt());
    let cross = |a: [f32; 3], b: [f32; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let forward = unit(sub(LOOK_AT, EYE));
    let right = unit(cross(forward, [0.0, 0.0, 1.0]));
    let up = cross(right, forward);
    let row = |v: [f32; 3], w: u32| [v[0].to_bits(), v[1].to_bits(), v[2].to_bits(), w];
    let words = [
        row(EYE, 0),
        row(forward, sample),
        row(right.map(|v| v * HALF_WIDTH), first_row),
        row(up.map(|v| v * HALF_WIDTH * height as f32 / width as f32), width),
        [height, sampler, seed, diffuse],
    ];
    bytemuck::cast(words)
}

/// What a sphere is made of; the numbers stand in `tracer.wgsl`.
#[derive(Clone, Copy)]
enum Material {
    Diffuse = 0,
    Metal = 1,
    Glass = 2,
    Coated = 3,
}

/// A sphere that stands on the ground.
#[derive(Clone, Copy)]
pub(crate) struct Sphere {
    at: [f32; 2],
    radius: f32,
    colour: [f32; 3],
    roughness: f32,
    material: Material,
}

pub(crate) const SPHERES: [Sphere; 8] = [
    ball([0.6, 0.0], 1.15, [0.96, 0.96, 0.97], 0.0, Material::Metal),
    ball([0.2, 2.25], 0.9, [1.0, 0.78, 0.34], 0.45, Material::Metal),
    ball([0.2, -2.25], 0.9, [0.98, 0.99, 1.0], 0.0, Material::Glass),
    ball([-1.7, 1.15], 0.4, [0.62, 0.07, 0.05], 0.1, Material::Coated),
    ball([-2.1, 0.1], 0.33, [0.8, 0.8, 0.8], 0.0, Material::Diffuse),
    ball([-1.7, -0.95], 0.4, [0.05, 0.14, 0.5], 0.1, Material::Coated),
    ball([2.9, 1.75], 0.55, [0.1, 0.1, 0.11], 0.2, Material::Coated),
    ball([2.7, -1.5], 0.6, [0.1, 0.34, 0.12], 0.0, Material::Diffuse),
];

const fn ball(at: [f32; 2], radius: f32, colour: [f32; 3], roughness: f32, material: Material) -> Sphere {
    Sphere { at, radius, colour, roughness, material }
}

impl Sphere {
    /// As `tracer.wgsl` declares it.
    pub(crate) fn words(self) -> [u32; 12] {
        let Self { at: [x, y], radius, colour: [r, g, b], roughness, material } = self;
        let numbers = [x, y, radius, radius, r, g, b, roughness].map(f32::to_bits);
        let mut words = [0; 12];
        words[..8].copy_from_slice(&numbers);
        words[8] = material as u32;
        words
    }
}

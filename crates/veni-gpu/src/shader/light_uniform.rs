//! The uniform of a light: `VeniLight` in `light_layout.wgsl`.

/// Most compact lights of a light, and of a latent: [`Lights::MOST`](veni_light::light::Lights::MOST).
pub const MAX_LIGHTS: usize = 8;

/// A light's few numbers. Directions are native and as they are before the rotation.
#[derive(Clone, Debug, PartialEq)]
pub struct LightUniform {
    /// Sine and cosine of the rotation about z, counter-clockwise seen from above.
    pub rotation: [f32; 2],
    /// W and H of the map.
    pub size: [u32; 2],
    /// Two unit vectors across the sun's direction and each other.
    pub across: [[f32; 3]; 2],
    /// Probability of drawing the sun; 0 without one.
    pub share: f32,
    /// 1 − cos of the sun's angular radius.
    pub cap: f32,
    /// Cells of the alias table, a power of two.
    pub cells: u32,
    /// Whether the first compact light is the sun.
    pub has_sun: bool,
    /// sin² of half the polar angle at the lower edge of the first row.
    pub pole: f32,
    /// Compact lights, [`MAX_LIGHTS`] at most.
    pub lights: Vec<PackedDisc>,
    /// Irradiance of the map without compact lights, E(n) = s₀ + s₁y + s₂z + s₃x + s₄xy + s₅yz + s₆(3z² − 1) + s₇xz + s₈(x² − y²).
    pub diffuse: [[f32; 3]; 9],
}

/// A compact light: a disc of constant radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackedDisc {
    /// Unit, towards the light.
    pub direction: [f32; 3],
    /// Angular radius, radians.
    pub radius: f32,
    /// E⊥, the integral of radiance over the disc (R, G, B).
    pub irradiance: [f32; 3],
    /// 1/Ω, Ω = 2π(1 − cos r), 1/sr; 0 for a point.
    pub per_solid_angle: f32,
}

impl LightUniform {
    /// Bytes of the uniform.
    pub const BYTES: usize = 464;

    /// The first eight bytes of the uniform for a rotation by `radians` about z, counter-clockwise seen from above: all
    /// that is written to rotate a light.
    pub fn rotation_bytes(radians: f64) -> [u8; 8] {
        let (sin, cos) = radians.sin_cos();
        bytes([(sin as f32).to_bits(), (cos as f32).to_bits()])
    }

    /// The uniform, little endian as WGSL lays it out.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let row = |[x, y, z]: [f32; 3], w: u32| [x.to_bits(), y.to_bits(), z.to_bits(), w];
        let [sin, cos] = self.rotation.map(f32::to_bits);
        let [width, height] = self.size;
        let mut rows = [[0; 4]; Self::BYTES / 16];
        rows[0] = [sin, cos, width, height];
        rows[1] = row(self.across[0], self.share.to_bits());
        rows[2] = row(self.across[1], self.cap.to_bits());
        rows[3] = [self.cells, self.lights.len() as u32, u32::from(self.has_sun), self.pole.to_bits()];
        for (rows, light) in rows[4..].as_chunks_mut::<2>().0.iter_mut().zip(&self.lights).take(MAX_LIGHTS) {
            rows[0] = row(light.direction, light.radius.to_bits());
            rows[1] = row(light.irradiance, light.per_solid_angle.to_bits());
        }
        for (to, from) in rows[4 + 2 * MAX_LIGHTS..].iter_mut().zip(&self.diffuse) {
            *to = row(*from, 0);
        }
        bytes(rows.as_flattened().iter().copied())
    }

    /// Every number that must be finite.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f32> + '_ {
        let discs = self.lights.iter().flat_map(|light| {
            let [x, y, z] = light.direction;
            let [r, g, b] = light.irradiance;
            [x, y, z, light.radius, r, g, b, light.per_solid_angle]
        });
        let own = [self.share, self.cap, self.pole].into_iter().chain(self.rotation);
        own.chain(self.across.as_flattened().iter().copied())
            .chain(discs)
            .chain(self.diffuse.as_flattened().iter().copied())
    }
}

fn bytes<const N: usize>(words: impl IntoIterator<Item = u32>) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(b, w)| *b = w.to_le_bytes());
    bytes
}

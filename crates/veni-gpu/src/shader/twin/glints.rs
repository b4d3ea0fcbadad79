//! `veni_glints` of `level.wgsl`

/// What the lights of a latent, packed by [`Glints::pack`](crate::shader::Glints::pack), are through the lobe of their level, in a
/// native unit direction.
pub fn veni_glints(glints: &[[u32; 4]], latent: usize, d: [f64; 3]) -> [f64; 3] {
    let Some([first, count, ..]) = glints.get(latent).copied() else { return [0.0; 3] };
    let float = |row: [u32; 4]| row.map(|v| f64::from(f32::from_bits(v)));
    let mut sum = [0.0; 3];
    for rows in glints[first as usize..].chunks_exact(3).take(count as usize) {
        let (light, irradiance, table) = (float(rows[0]), float(rows[1]), rows[2][0] as usize);
        let square: f64 = d.iter().zip(light).map(|(d, u)| (d - u) * (d - u)).sum();
        let x = (square.sqrt() * light[3]).asinh() * irradiance[3];
        let low = (x as usize).min(1024);
        let value = |k: usize| float(glints[table + k / 4])[k % 4];
        let t = x - low as f64;
        let value = value(low) * (1.0 - t) + value(low + 1) * t;
        sum = [0, 1, 2].map(|c| sum[c] + value * irradiance[c]);
    }
    sum
}

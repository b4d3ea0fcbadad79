//! The scripts behind the tables of docs/results are in `examples/`.

/// The 26 ways from the middle of a cube of 3 × 3 × 3 to the others, of length 1: normals of the surfaces whose irradiance is
/// compared.
pub fn ways() -> Vec<[f32; 3]> {
    (0..27)
        .filter(|k| *k != 13)
        .map(|k| {
            let v = [k / 9, k / 3 % 3, k % 3].map(|c| c as f32 - 1.0);
            let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
            v.map(|c| c / length)
        })
        .collect()
}

//! A few directions that stand for all.

use crate::vector::unit;

/// The 26 unit vectors from the middle of a cube of 3 × 3 × 3 to the others: normals of surfaces on which light is compared.
pub fn ways() -> Vec<[f32; 3]> {
    (0..27).filter(|k| *k != 13).map(|k| unit([k / 9, k / 3 % 3, k % 3].map(|c| c as f32 - 1.0))).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn they_are_even() {
        let ways = super::ways();
        assert_eq!(ways.len(), 26);
        for c in 0..3 {
            assert!(ways.iter().map(|w| w[c]).sum::<f32>().abs() < 1e-5);
            let square: f32 = ways.iter().map(|w| w[c] * w[c]).sum();
            assert!((square / 26.0 - 1.0 / 3.0).abs() < 1e-5);
        }
    }
}

//! Errors as colours.

/// The error of log radiance that is shown as white: a factor of e².
pub const HEAT_RANGE: f32 = 2.0;

/// |P − I| of log radiance, averaged over the channels of each pixel, from black (0) over red and yellow to white
/// ([`HEAT_RANGE`] and more).
///
/// # Panics
/// If the images differ in size.
pub fn heat(prediction: &[f32], target: &[f32]) -> Vec<[u8; 3]> {
    assert_eq!(prediction.len(), target.len(), "two images of different size");
    let pixels = prediction.as_chunks::<3>().0.iter().zip(target.as_chunks::<3>().0);
    pixels
        .map(|(p, i)| {
            let error = p.iter().zip(i).map(|(p, i)| (p - i).abs()).sum::<f32>() / 3.0;
            let level = 3.0 * (error / HEAT_RANGE).clamp(0.0, 1.0);
            [level, level - 1.0, level - 2.0].map(|v| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_follow_the_error() {
        let prediction = [0.0, 0.0, 0.0, 1.0, 0.0, 1.0, -5.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let target = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, -5.0, 1.0, 1.0, 1.0];
        assert_eq!(heat(&prediction, &target), [[0; 3], [255, 0, 0], [255; 3], [255, 128, 0]]);
    }
}

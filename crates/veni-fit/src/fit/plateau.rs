//! The end of improvement.

use super::Plateau;

/// Watches for the end of improvement, image by image.
pub(super) struct PlateauDetector {
    plateau: Option<Plateau>,
    best: Vec<f64>,
    since: Vec<u64>,
}

impl PlateauDetector {
    pub(super) fn new(plateau: Option<Plateau>, images: usize) -> Self {
        Self { plateau, best: vec![f64::INFINITY; images], since: vec![0; images] }
    }

    /// Whether no image has got better for long enough.
    pub(super) fn ended(&mut self, losses: &[f64]) -> bool {
        let Some(Plateau { patience, improvement }) = self.plateau else { return false };
        for ((best, since), loss) in self.best.iter_mut().zip(&mut self.since).zip(losses) {
            if best.is_infinite() || *loss < *best - improvement * best.abs() {
                (*best, *since) = (*loss, 0);
            } else {
                *since += 1;
            }
        }
        self.since.iter().all(|since| *since >= patience)
    }
}

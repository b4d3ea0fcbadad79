//! Where the losses of a step are computed.

use serde::{Deserialize, Serialize};

/// Directions on which the losses are computed in training (validation always takes every pixel).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum LossGrid {
    /// Every pixel of the panorama.
    // with braces: without, keys that belong to another kind would be taken in silence
    Full {},
    /// The panorama averaged over `factor` × `factor` pixels by solid angle, in log radiance.
    Averaged {
        /// Pixels per side of a cell; must divide width and height.
        factor: usize,
    },
    /// Every `factor`-th pixel of every `factor`-th row, from an offset drawn in each step: exact pixel
    /// values, and every pixel in its turn. (Rows are weighted as if each were in the middle of its
    /// neighbours; over the offsets that evens out.)
    Strided {
        /// Distance of neighbours in pixels; must divide width and height.
        factor: usize,
    },
}

impl LossGrid {
    /// Pixels of the panorama per pixel of the loss grid, along each side.
    pub fn factor(self) -> usize {
        match self {
            Self::Full {} => 1,
            Self::Averaged { factor } | Self::Strided { factor } => factor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_no_kind_and_of_another_are_refused() {
        let read = |text: &str| toml::from_str::<LossGrid>(text);
        assert_eq!(read("kind = \"full\"").unwrap(), LossGrid::Full {});
        assert_eq!(read("kind = \"strided\"\nfactor = 2").unwrap(), LossGrid::Strided { factor: 2 });
        for text in [
            "kind = \"full\"\nfoo = 1",
            "kind = \"full\"\nfactor = 2",
            "kind = \"strided\"\nfactor = 2\nx = 1",
        ] {
            assert!(read(text).unwrap_err().to_string().contains("unknown field"), "{text}");
        }
    }
}

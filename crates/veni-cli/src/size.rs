//! `--size W` or `WxH`, and what it means in each layout.

use std::str::FromStr;

use anyhow::{Result, bail};

/// The longest side that is baked: 2¹⁶ pixels. A larger number is far more often a slip than a wish.
const MAX_SIDE: usize = 1 << 16;

/// A size as typed: a width, and a height if one was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    width: usize,
    height: Option<usize>,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |t: &str| {
            let n: usize = t.trim().parse().map_err(|_| {
                format!(
                    "'{text}' is not a size: give a width (2048) or width x height (2048x1024), in pixels"
                )
            })?;
            match n {
                0 => Err("a side of 0 pixels holds no image: give at least 1".to_owned()),
                n if n > MAX_SIDE => {
                    Err(format!("{n} pixels on a side is too large: give at most {MAX_SIDE}"))
                }
                n => Ok(n),
            }
        };
        match text.split_once(['x', 'X', '×']) {
            Some((w, h)) => Ok(Self { width: side(w)?, height: Some(side(h)?) }),
            None => Ok(Self { width: side(text)?, height: None }),
        }
    }
}

impl Size {
    /// (width, height) of an equirectangular image: twice as wide as high.
    pub(crate) fn equirect(self) -> Result<(usize, usize)> {
        let height = self.height.unwrap_or(self.width / 2);
        if height * 2 != self.width {
            let w = self.width.max(2) / 2 * 2;
            bail!(
                "--size {self}: an equirectangular image is twice as wide as high: give --size {w}x{} (or just {w})",
                w / 2
            );
        }
        Ok((self.width, height))
    }

    /// (width, height) of any image: square if only a width was given.
    pub(crate) fn image(self) -> (usize, usize) {
        (self.width, self.height.unwrap_or(self.width))
    }

    /// The edge of one cube face.
    pub(crate) fn cube(self) -> Result<usize> {
        match self.height {
            Some(h) if h != self.width => bail!(
                "--size {self}: with --layout cubemap the size is that of one square face: give --size {}",
                self.width
            ),
            _ => Ok(self.width),
        }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.height {
            Some(height) => write!(f, "{}x{height}", self.width),
            None => write!(f, "{}", self.width),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_widths_and_pairs() {
        for (text, equirect) in
            [("2048", (2048, 1024)), ("64x32", (64, 32)), ("64X32", (64, 32)), ("8×4", (8, 4))]
        {
            assert_eq!(text.parse::<Size>().unwrap().equirect().unwrap(), equirect, "{text}");
        }
        assert_eq!("256".parse::<Size>().unwrap().image(), (256, 256));
        assert_eq!("256x16".parse::<Size>().unwrap().image(), (256, 16));
        assert_eq!("256".parse::<Size>().unwrap().cube().unwrap(), 256);
        assert_eq!("256x256".parse::<Size>().unwrap().cube().unwrap(), 256);
    }

    #[test]
    fn refuses_what_is_no_size_and_says_what_is() {
        for (text, remedy) in [
            ("", "2048x1024"),
            ("x", "2048x1024"),
            ("12x", "2048x1024"),
            ("-4", "2048x1024"),
            ("0", "at least 1"),
            ("64x0", "at least 1"),
            ("99999", "at most 65536"),
            ("99999999999999999999999", "2048x1024"),
        ] {
            let error = text.parse::<Size>().unwrap_err();
            assert!(error.contains(remedy), "{text}: {error}");
        }
        for (text, remedy) in [("96x32", "96x48"), ("33", "32x16"), ("1", "2x1")] {
            let error = text.parse::<Size>().unwrap().equirect().unwrap_err().to_string();
            assert!(error.contains(remedy), "{text}: {error}");
        }
        assert!("64x32".parse::<Size>().unwrap().cube().unwrap_err().to_string().contains("--size 64"));
    }
}

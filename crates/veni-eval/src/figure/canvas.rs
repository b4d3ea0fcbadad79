//! Pixels to draw on, and the file they end in.

use std::convert::Infallible;
use std::path::Path;

use crate::{Error, Result};
use embedded_graphics::mono_font::{MonoTextStyle, iso_8859_1::FONT_6X10};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Pixel, Point, RgbColor, Size};
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use veni_light::output::Overwrite;

/// Width and height of a letter, pixels.
pub(super) const LETTER: [i32; 2] = [6, 10];

/// An 8-bit sRGB picture that starts white.
#[derive(Clone, Debug)]
pub struct Canvas {
    size: [usize; 2],
    pixels: Vec<[u8; 3]>,
}

impl Canvas {
    /// `width` × `height` white pixels.
    pub fn new(width: usize, height: usize) -> Self {
        Self { size: [width, height], pixels: vec![[255; 3]; width * height] }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The colour of a pixel.
    ///
    /// # Panics
    /// If there is none at (x, y).
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        self.pixels[y * self.size[0] + x]
    }

    /// All pixels, row-major.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    /// Sets a pixel; one outside is left out.
    pub(super) fn set(&mut self, [x, y]: [i32; 2], colour: [u8; 3]) {
        let [width, height] = self.size;
        if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y))
            && x < width
            && y < height
        {
            self.pixels[y * width + x] = colour;
        }
    }

    /// Draws a shape; drawing on pixels in memory cannot fail.
    pub(super) fn draw(&mut self, shape: &impl Drawable<Color = Rgb888>) {
        let Ok(_) = shape.draw(self);
    }

    /// Writes black text, its vertical middle at `at`; letters beyond Latin-1 appear as "?".
    pub(super) fn text(&mut self, text: &str, [x, y]: [i32; 2], alignment: Alignment) {
        let style = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Middle).build();
        let letters = MonoTextStyle::new(&FONT_6X10, Rgb888::BLACK);
        self.draw(&Text::with_text_style(text, Point::new(x, y), letters, style));
    }

    /// Writes the PNG, replacing an earlier one.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        }
        veni_image::write_png(path, self.size, &self.pixels, Overwrite::Replace)
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        // figures are some thousands of pixels a side
        Size::new(self.size[0] as u32, self.size[1] as u32)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(Point { x, y }, colour) in pixels {
            self.set([x, y], [colour.r(), colour.g(), colour.b()]);
        }
        Ok(())
    }
}

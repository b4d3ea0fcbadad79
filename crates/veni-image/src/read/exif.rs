//! The few entries of EXIF (2.32) that say how display values are meant: orientation and colour space.

use image::metadata::Orientation;

/// What EXIF says of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColourSpace {
    /// Also where nothing is said.
    Srgb,
    /// By the DCF's option file, or by the value 2 that some cameras write.
    AdobeRgb,
    /// The value of sRGB in an option file, which is Adobe RGB.
    Both,
    /// 0xFFFF: something else, which a profile is to say.
    Uncalibrated,
}

/// Some writers of WebP and PNG keep the header that JPEG needs.
fn body(exif: &[u8]) -> &[u8] {
    exif.strip_prefix(b"Exif\0\0").unwrap_or(exif)
}

/// How the picture is to be turned, by tag 0x0112 of the first directory; nothing where it says none of the eight.
pub(super) fn orientation(exif: &[u8]) -> Option<Orientation> {
    let tiff = Tiff(body(exif));
    let entry = tiff.whole(tiff.first()?, 0x0112)?;
    // by the standard SHORT; some write LONG
    let value = match tiff.short(&entry[2..])? {
        3 => usize::from(tiff.short(&entry[8..])?),
        4 => tiff.long(&entry[8..])?,
        _ => return None,
    };
    Orientation::from_exif(u8::try_from(value).ok()?)
}

/// Tags 0xA001 (ColorSpace) of the Exif directory and 1 of the interoperability directory.
pub(super) fn colour_space(exif: &[u8]) -> ColourSpace {
    let tiff = Tiff(body(exif));
    let adobe_file = || {
        let interop = tiff.directory(tiff.exif()?, 0xA005)?;
        tiff.entry(interop, 1).map(|value| value.starts_with(b"R03"))
    };
    match tiff.exif().and_then(|exif| tiff.entry(exif, 0xA001)).and_then(|value| tiff.short(value)) {
        Some(2) => ColourSpace::AdobeRgb,
        Some(0xFFFF) | None if adobe_file() == Some(true) => ColourSpace::AdobeRgb,
        Some(0xFFFF) => ColourSpace::Uncalibrated,
        Some(1) if adobe_file() == Some(true) => ColourSpace::Both,
        _ => ColourSpace::Srgb,
    }
}

/// TIFF 6.0 directories; every offset may be wrong.
struct Tiff<'a>(&'a [u8]);

impl<'a> Tiff<'a> {
    fn short(&self, bytes: &[u8]) -> Option<u16> {
        let bytes = *bytes.first_chunk()?;
        match self.0.first()? {
            b'I' => Some(u16::from_le_bytes(bytes)),
            b'M' => Some(u16::from_be_bytes(bytes)),
            _ => None,
        }
    }

    fn long(&self, bytes: &[u8]) -> Option<usize> {
        let bytes = *bytes.first_chunk()?;
        let value =
            if self.0.first()? == &b'I' { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
        Some(value as usize)
    }

    /// The four bytes of an entry's value.
    fn entry(&self, directory: usize, tag: u16) -> Option<&'a [u8]> {
        self.whole(directory, tag).map(|entry| &entry[8..])
    }

    /// The twelve bytes of an entry: tag, type, count, value.
    fn whole(&self, directory: usize, tag: u16) -> Option<&'a [u8]> {
        let count = self.short(self.0.get(directory..)?)?;
        let mut entries =
            (0..usize::from(count)).map_while(|k| self.0.get(directory + 2 + 12 * k..)?.get(..12));
        entries.find(|entry| self.short(entry) == Some(tag))
    }

    fn directory(&self, parent: usize, tag: u16) -> Option<usize> {
        self.long(self.entry(parent, tag)?)
    }

    fn first(&self) -> Option<usize> {
        self.long(self.0.get(4..)?)
    }

    fn exif(&self) -> Option<usize> {
        self.directory(self.first()?, 0x8769)
    }
}

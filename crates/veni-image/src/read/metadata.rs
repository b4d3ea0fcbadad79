//! What is done with what files say of their numbers: one row per format and tag.

/// What becomes of a tag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treatment {
    /// Values are converted by it.
    Applied,
    /// The file is refused, and the message names the tag.
    Refused,
    /// Values stay as they are, and a note names the tag.
    Noted,
}

/// One tag of one format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metadata {
    /// "EXR", "PNG, JPEG, WebP".
    pub format: &'static str,
    /// As the format calls it.
    pub tag: &'static str,
    /// What becomes of it.
    pub treatment: Treatment,
    /// What people see.
    pub effect: &'static str,
}

/// A row.
const fn row(
    format: &'static str,
    tag: &'static str,
    treatment: Treatment,
    effect: &'static str,
) -> Metadata {
    Metadata { format, tag, treatment, effect }
}

use Treatment::{Applied, Noted, Refused};

const EXR: &str = "EXR";
const HDR: &str = "Radiance";
const PNG: &str = "PNG";
const ALL: &str = "PNG, JPEG, WebP";
const JPEG: &str = "JPEG";
const AVIF: &str = "AVIF";

/// Every tag that changes what numbers mean, or might be thought to. What is not listed changes nothing.
pub const METADATA: &[Metadata] = &[
    row(EXR, "chromaticities", Applied, "other primaries become Rec. 709, white stays white (Bradford)"),
    row(
        EXR,
        "chromaticities of CIE X, Y, Z",
        Applied,
        "measured colours become Rec. 709; what has the chromaticity of D65 is grey",
    ),
    row(
        EXR,
        "colorInteropID",
        Applied,
        "curve (lin, srgb, g18 to g26, pq, hlg) and primaries (rec709, rec2020, p3d65, adobergb, ap0, ap1, xyz)",
    ),
    row(EXR, "colorInteropID = data, or of another space", Refused, "the message names the value"),
    row(EXR, "colorInteropID beside other chromaticities", Noted, "the chromaticities are taken"),
    row(EXR, "acesImageContainerFlag", Applied, "ACES2065-1 primaries where no others are named"),
    row(
        EXR,
        "oiio:ColorSpace",
        Applied,
        "names that everybody writes alike (ACEScg, sRGB, lin_rec709); others are noted",
    ),
    row(EXR, "whiteLuminance", Noted, "radiance has no absolute unit here"),
    row(EXR, "adoptedNeutral", Noted, "colours are not balanced by it"),
    row(EXR, "pixelAspectRatio", Noted, "pixels are taken for square"),
    row(EXR, "alpha", Applied, "colours are divided by it; what is transparent is unknown"),
    row(EXR, "alpha of 0 everywhere beside colours", Noted, "it is ignored"),
    row(EXR, "alpha below 1/64 under a colour", Noted, "such pixels are unknown"),
    row(EXR, "half precision, infinite", Noted, "taken for 65504, the largest value"),
    row(EXR, "chromaticities of eight zeros", Noted, "they are ignored"),
    row(EXR, "Orientation", Noted, "pixels are taken as they are stored"),
    row(EXR, "data window", Applied, "what it leaves of the display window is unknown"),
    row(EXR, "veni:radianceScale", Applied, "divided out"),
    row(HDR, "EXPOSURE", Applied, "values are divided by the product of all lines"),
    row(HDR, "EXPOSURE=0", Noted, "not known: taken for 1"),
    row(HDR, "COLORCORR", Applied, "red, green and blue are divided by the product of all lines"),
    row(HDR, "PRIMARIES", Applied, "as chromaticities in EXR; eight zeros say nothing"),
    row(HDR, "GAMMA", Applied, "stored values are raised to this power"),
    row(HDR, "FORMAT=32-bit_rle_xyze", Applied, "X, Y, Z become Rec. 709; white of equal energy is white"),
    row(HDR, "FORMAT of another kind", Refused, "the message names it"),
    row(HDR, "PIXASPECT", Noted, "pixels are taken for square"),
    row(HDR, "resolution (-Y +X and others)", Applied, "all eight orientations are brought upright"),
    row(
        PNG,
        "cICP",
        Applied,
        "PQ, HLG, linear, sRGB; BT.709, BT.2020, P3 and other primaries; goes before all others",
    ),
    row(PNG, "cICP of another curve, matrix or range", Refused, "the message names the code point"),
    row(PNG, "sRGB", Applied, "goes before gAMA and cHRM"),
    row(PNG, "gAMA", Applied, "values to the power of 1/gAMA; 1/2.2 stands for sRGB"),
    row(PNG, "cHRM", Applied, "as chromaticities in EXR"),
    row(PNG, "gAMA, cHRM of zeros", Noted, "they are ignored"),
    row(PNG, "second gAMA (cHRM, cICP, sRGB, iCCP, eXIf)", Noted, "the first counts"),
    row(PNG, "chunk with a wrong checksum", Noted, "it is ignored; chunks of pixels are refused"),
    row(PNG, "eXIf, XMP behind the pixels", Applied, "as before them"),
    row(
        PNG,
        "text \"Raw profile type exif\" (APP1, xmp)",
        Applied,
        "as ImageMagick writes it: EXIF where there is no eXIf, and XMP",
    ),
    row(PNG, "acTL (animated)", Noted, "the still image is taken"),
    row(ALL, "ICC profile: matrix and curves, or grey", Applied, "goes before sRGB, gAMA, cHRM and EXIF"),
    row(
        ALL,
        "ICC profile of another kind (tables, also beside a matrix)",
        Refused,
        "the message names the profile",
    ),
    row(
        ALL,
        "ICC profile with the curve of PQ or HLG, without cicp",
        Noted,
        "its largest value is taken for a display's white",
    ),
    row(ALL, "EXIF Orientation", Applied, "all eight; the picture is brought upright"),
    row(ALL, "XMP tiff:Orientation", Applied, "where no EXIF says one"),
    row(ALL, "EXIF ColorSpace = Adobe RGB (or R03)", Applied, "where no profile says otherwise"),
    row(ALL, "EXIF ColorSpace = uncalibrated", Noted, "without a profile taken for sRGB"),
    row(ALL, "EXIF ColorSpace = sRGB beside R03", Noted, "taken for sRGB"),
    row(ALL, "alpha", Applied, "what is transparent is unknown"),
    row(ALL, "XMP GPano, cropped", Applied, "placed in its full sphere, the rest unknown"),
    row(ALL, "XMP GPano ProjectionType", Refused, "other projections than equirectangular, by name"),
    row(ALL, "XMP GPano pose", Noted, "a tilted camera is not levelled"),
    row(
        ALL,
        "XMP in UTF-16 or UTF-32, or with wrong bytes",
        Applied,
        "what can be read of it counts, but for comments",
    ),
    row(JPEG, "several XMP packets", Applied, "of each kind of property the first packet that has it"),
    row(JPEG, "extended XMP", Applied, "put together from its segments"),
    row(JPEG, "extended XMP of which pieces are missing", Noted, "it is ignored"),
    row(JPEG, "second EXIF", Applied, "the first counts"),
    row(
        JPEG,
        "gain map (hdrgm)",
        Applied,
        "high dynamic range: the brightest rendition; white of the first picture is 1",
    ),
    row(
        JPEG,
        "gain map without hdrgm values (Apple, ISO 21496-1)",
        Noted,
        "the picture is taken as a display of limited range shows it",
    ),
    row(JPEG, "gain map to limited range (BaseRenditionIsHDR)", Refused, "the message names it"),
    row(JPEG, "CMYK profile", Noted, "colours are converted by the plain formula"),
    row(
        JPEG,
        "picture data that end early, also a gain map's",
        Refused,
        "the message says after how many blocks, or which bits no scan holds",
    ),
    row(JPEG, "arithmetic, lossless, hierarchical coding, 12 bits, JPEG-LS", Refused, "the message names it"),
    row(
        JPEG,
        "sampling factors",
        Refused,
        "where the first component's is not the largest across, or one is 3: the message names them",
    ),
    row("WebP", "animation", Noted, "the first frame is taken"),
    row(AVIF, "nclx, or the stream's own code points", Applied, "as cICP in PNG"),
    row(AVIF, "ICC profile", Applied, "goes before nclx for curve and primaries"),
    row(AVIF, "irot, imir, clap", Refused, "the message says which"),
];

//! PNG, JPEG and WebP: curves, primaries, profiles, EXIF, GPano.

use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb};
use moxcms::ColorProfile;

use super::super::super::*;
use super::Case;
use super::files::{File, close, encoded, exif, hundred_thousandths, jpeg, png, png_icc, segment, webp, xmp};
use crate::tonemap::srgb_to_linear;

pub(super) const CASES: &[Case] = &[
    ("PNG", "cICP", cicp),
    ("PNG", "cICP of another curve, matrix or range", foreign_cicp),
    ("PNG", "sRGB", srgb),
    ("PNG", "gAMA", gama),
    ("PNG", "cHRM", chrm),
    ("PNG", "acTL (animated)", apng),
    ("PNG, JPEG, WebP", "ICC profile: matrix and curves, or grey", icc),
    ("PNG, JPEG, WebP", "ICC profile of another kind (tables, also beside a matrix)", foreign_icc),
    ("PNG, JPEG, WebP", "ICC profile with the curve of PQ or HLG, without cicp", unnamed_curve),
    ("PNG, JPEG, WebP", "EXIF Orientation", orientation),
    ("PNG, JPEG, WebP", "EXIF ColorSpace = Adobe RGB (or R03)", adobe),
    ("PNG, JPEG, WebP", "EXIF ColorSpace = sRGB beside R03", both),
    ("PNG, JPEG, WebP", "EXIF ColorSpace = uncalibrated", uncalibrated),
    ("PNG, JPEG, WebP", "alpha", alpha),
    ("PNG, JPEG, WebP", "XMP GPano, cropped", crop),
    ("PNG, JPEG, WebP", "XMP GPano ProjectionType", projection),
    ("PNG, JPEG, WebP", "XMP GPano pose", pose),
    ("WebP", "animation", animation),
];

const COLOUR: [f32; 3] = [0.6, 0.3, 0.45];
const GPANO: &str = "http://ns.google.com/photos/1.0/panorama/";

/// Display P3 to Rec. 709, both with D65 (CSS Color 4, 10.1).
fn from_p3([r, g, b]: [f32; 3]) -> [f32; 3] {
    [1.224_94 * r - 0.224_94 * g, -0.042_06 * r + 1.042_06 * g, -0.019_64 * r - 0.078_64 * g + 1.098_27 * b]
}

/// BT.2020 to BT.709 (ITU-R BT.2087).
fn from_2020([r, g, b]: [f32; 3]) -> [f32; 3] {
    [
        1.6605 * r - 0.5876 * g - 0.0728 * b,
        -0.1246 * r + 1.1329 * g - 0.0083 * b,
        -0.0182 * r - 0.1006 * g + 1.1187 * b,
    ]
}

fn cicp() {
    let tagged = |code: [u8; 4], colour| png(colour, &[(b"cICP", &code)]);
    // PQ: 58.07 % is 203 cd/m²; half the signal is 92.2 cd/m²
    close(tagged([1, 16, 0, 1], [0.580_69; 3]).first(), [1.0; 3]);
    close(tagged([1, 16, 0, 1], [0.5; 3]).first(), [92.245 / 203.0; 3]);
    assert!(matches!(tagged([9, 16, 0, 1], COLOUR).content().unwrap(), Content::Radiance(_)));
    close(tagged([1, 18, 0, 1], [0.75; 3]).first(), [1.0; 3]);
    close(tagged([1, 8, 0, 1], COLOUR).first(), COLOUR);
    close(tagged([1, 13, 0, 1], COLOUR).first(), COLOUR.map(srgb_to_linear));
    close(tagged([9, 8, 0, 1], COLOUR).first(), from_2020(COLOUR));
    close(tagged([12, 13, 0, 1], COLOUR).first(), from_p3(COLOUR.map(srgb_to_linear)));
    // before a profile and all others
    let gamma = hundred_thousandths(&[1.0]);
    let others: [(&[u8; 4], &[u8]); 3] = [(b"cICP", &[1, 13, 0, 1]), (b"sRGB", &[0]), (b"gAMA", &gamma)];
    let all = png_icc(COLOUR, &ColorProfile::new_display_p3().encode().unwrap(), &others);
    close(all.first(), COLOUR.map(srgb_to_linear));
}

fn foreign_cicp() {
    for (code, word) in [
        ([1, 9, 0, 1], "characteristic 9"),
        ([1, 13, 9, 1], "matrix 9"),
        ([1, 13, 0, 0], "range flag 0"),
        ([8, 13, 0, 1], "primaries 8"),
    ] {
        let error = png(COLOUR, &[(b"cICP", &code)]).error();
        assert!(error.contains("cICP") && error.contains(word), "{error}");
    }
}

fn srgb() {
    let gamma = hundred_thousandths(&[1.0]);
    close(png(COLOUR, &[(b"sRGB", &[0]), (b"gAMA", &gamma)]).first(), COLOUR.map(srgb_to_linear));
}

fn gama() {
    let tagged = |gamma: f64| png(COLOUR, &[(b"gAMA", &hundred_thousandths(&[gamma]))]).first();
    close(tagged(1.0), COLOUR);
    close(tagged(0.55556), COLOUR.map(|v| v.powf(1.8)));
    close(tagged(0.45455), COLOUR.map(srgb_to_linear));
    let none = png(COLOUR, &[(b"gAMA", &[0; 4])]);
    close(none.first(), COLOUR.map(srgb_to_linear));
    assert!(none.notes().contains("gAMA chunk says 0"), "{}", none.notes());
}

fn chrm() {
    let chunk = hundred_thousandths(&[0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060]);
    close(png(COLOUR, &[(b"cHRM", &chunk)]).first(), from_p3(COLOUR.map(srgb_to_linear)));
    let srgb = hundred_thousandths(&[0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06]);
    close(png(COLOUR, &[(b"cHRM", &srgb)]).first(), COLOUR.map(srgb_to_linear));
}

fn apng() {
    // one frame: the still image
    let frame = [0u32, 8, 4, 0, 0].map(u32::to_be_bytes).concat();
    let frame = [frame, vec![0, 1, 0, 1, 0, 0]].concat();
    let file = png(COLOUR, &[(b"acTL", &[0, 0, 0, 1, 0, 0, 0, 0]), (b"fcTL", &frame)]);
    close(file.first(), COLOUR.map(srgb_to_linear));
    assert!(file.notes().contains("animated"), "{}", file.notes());
}

fn icc() {
    let p3 = ColorProfile::new_display_p3().encode().unwrap();
    close(png_icc(COLOUR, &p3, &[(b"sRGB", &[0])]).first(), from_p3(COLOUR.map(srgb_to_linear)));
    let srgb = ColorProfile::new_srgb().encode().unwrap();
    let plain = png(COLOUR, &[]);
    assert_eq!(
        png_icc(COLOUR, &srgb, &[]).content().unwrap(),
        plain.content().unwrap(),
        "sRGB's own profile changes nothing"
    );
    let grey = ColorProfile::new_gray_with_gamma(1.8).encode().unwrap();
    close(png_icc([0.5; 3], &grey, &[]).first(), [0.5f32.powf(1.8); 3]);
    // one that the decoder passes over; cICP goes before it
    let lost: (&[u8; 4], &[u8]) = (b"iCCP", b"P3\0\0no zlib");
    let error = png(COLOUR, &[lost]).error();
    assert!(error.contains("ICC profile"), "{error}");
    close(png(COLOUR, &[lost, (b"cICP", &[1, 13, 0, 1])]).first(), COLOUR.map(srgb_to_linear));
    // code points of high dynamic range in a profile
    let pq = ColorProfile::new_display_p3_pq().encode().unwrap();
    assert!(matches!(png_icc([0.5; 3], &pq, &[]).content().unwrap(), Content::Radiance(_)));
    // in JPEG and WebP
    let pixel = Rgb(COLOUR.map(|v| (v * 255.0) as u8));
    let image = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(16, 8, pixel));
    let expected = from_p3(pixel.0.map(|v| srgb_to_linear(f32::from(v) / 255.0)));
    let tagged = jpeg(&image, &[segment(0xE2, &[b"ICC_PROFILE\0\x01\x01", p3.as_slice()].concat())]);
    // of two pieces the second is missing
    let half = segment(0xE2, &[b"ICC_PROFILE\0\x01\x02", p3.as_slice()].concat());
    let error = File::new(&jpeg(&image, &[half])).error();
    assert!(error.contains("ICC profile"), "{error}");
    let off = File::new(&tagged).first().iter().zip(expected).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(off < 0.01, "JPEG: {off}");
    close(File::new(&webp(&image, b"ICCP", &p3, 0x20)).first(), expected);
}

/// A profile without its three curves, as one has that maps by tables.
fn foreign_icc() {
    let mut plain = ColorProfile::new_display_p3();
    plain.cicp = None;
    let mut profile = plain.encode().unwrap();
    for name in [b"rTRC", b"gTRC", b"bTRC"] {
        let at = profile.windows(4).position(|w| w == name).unwrap();
        profile[at..at + 4].copy_from_slice(b"none");
    }
    let error = png_icc(COLOUR, &profile, &[]).error();
    assert!(error.contains("ICC profile") && error.contains("Display P3"), "{error}");
    let error = png_icc(COLOUR, &profile[..100], &[]).error();
    assert!(error.contains("damaged ICC profile"), "{error}");
    // tables beside the matrix: 8 bits, three channels to three, two points to a side (ICC.1:2022, 10.11)
    let unit = [65536, 0, 0, 0, 65536, 0, 0, 0, 65536].map(u32::to_be_bytes).concat();
    let line: Vec<u8> = (0..=255).collect();
    let table =
        [&b"mft1\0\0\0\0\x03\x03\x02\0"[..], &unit, &line.repeat(3), &[128; 24], &line.repeat(3)].concat();
    for name in [b"A2B0", b"D2B1"] {
        let error = png_icc(COLOUR, &with_tag(&plain.encode().unwrap(), name, &table), &[]).error();
        assert!(error.contains("Display P3") && error.contains("tables"), "{error}");
    }
    // those that lead back from colours are nobody's business here
    let back = with_tag(&plain.encode().unwrap(), b"B2A0", &table);
    close(png_icc(COLOUR, &back, &[]).first(), from_p3(COLOUR.map(srgb_to_linear)));
}

/// A profile with one more tag, at the end.
fn with_tag(profile: &[u8], name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let number = |at: usize| u32::from_be_bytes(profile[at..at + 4].try_into().unwrap());
    let end = 132 + 12 * number(128) as usize;
    let mut grown = profile[..end].to_vec();
    // what is there moves by the new entry
    for at in (136..end).step_by(12) {
        grown[at..at + 4].copy_from_slice(&(number(at) + 12).to_be_bytes());
    }
    grown[128..132].copy_from_slice(&(number(128) + 1).to_be_bytes());
    grown.extend(name);
    grown.extend([profile.len() as u32 + 12, content.len() as u32].map(u32::to_be_bytes).concat());
    grown.extend(&profile[end..]);
    grown.extend(content);
    let length = (grown.len() as u32).to_be_bytes();
    grown[..4].copy_from_slice(&length);
    grown
}

/// Curves of high dynamic range in tables of 16 bits, as some programs write them.
fn unnamed_curve() {
    let table = |curve: fn(f64) -> f64| {
        let entry = |k: u16| (curve(f64::from(k) / 4095.0) * 65535.0).round() as u16;
        let mut profile = ColorProfile::new_srgb();
        let curve = Some(moxcms::ToneReprCurve::Lut((0..4096).map(entry).collect()));
        (profile.red_trc, profile.green_trc, profile.blue_trc) = (curve.clone(), curve.clone(), curve);
        profile.cicp = None;
        png_icc([0.75; 3], &profile.encode().unwrap(), &[])
    };
    // ST 2084, equation 4.1, and ARIB STD-B67
    let pq = table(|v| {
        let power = v.powf(32.0 / 2523.0);
        ((power - 0.835_937_5).max(0.0) / (18.851_562_5 - 18.6875 * power)).powf(8192.0 / 1305.0)
    });
    let hlg = table(|v| {
        if v <= 0.5 { v * v / 3.0 } else { (((v - 0.559_910_73) / 0.178_832_77).exp() + 0.284_668_92) / 12.0 }
    });
    // 983 of 10,000 cd/m², and 0.265 of the peak
    for (file, name, value) in [(pq, "PQ", 0.0983), (hlg, "HLG", 0.2650)] {
        assert!((file.first()[1] - value).abs() < 1e-3, "{name}: {:?}", file.first());
        assert!(file.notes().contains(&format!("curve of {name} without")), "{}", file.notes());
    }
    assert_eq!(table(|v| v.powf(2.2)).notes(), "");
}

fn orientation() {
    let image =
        DynamicImage::ImageRgb8(ImageBuffer::from_fn(6, 4, |x, y| Rgb([(x * 40) as u8, (y * 60) as u8, 9])));
    let upright = File::new(&encoded(&image, ImageFormat::Png)).linear().0;
    // EXIF 2.32, tag 274: where the first row and the first column of what is stored lie in what is seen
    type Seen = fn(usize, usize) -> (usize, usize);
    let seen: [Seen; 8] = [
        |x, y| (x, y),
        |x, y| (5 - x, y),
        |x, y| (5 - x, 3 - y),
        |x, y| (x, 3 - y),
        |x, y| (y, x),
        |x, y| (5 - y, x),
        |x, y| (5 - y, 3 - x),
        |x, y| (y, 3 - x),
    ];
    for (code, seen) in (1u8..).zip(seen) {
        let (width, height) = if code < 5 { (6, 4) } else { (4, 6) };
        let stored = ImageBuffer::from_fn(width, height, |x, y| {
            let (x, y) = seen(x as usize, y as usize);
            Rgb([(x * 40) as u8, (y * 60) as u8, 9u8])
        });
        let bare = exif(code, 1, b"R98\0");
        let stored = DynamicImage::ImageRgb8(stored);
        for exif in [bare.clone(), [b"Exif\0\0".as_slice(), &bare].concat()] {
            let file = File::new(&webp(&stored, b"EXIF", &exif, 0x08));
            assert_eq!(file.linear().0, upright, "orientation {code}");
        }
    }
}

fn adobe() {
    let adobe = |v: f32| v.powf(563.0 / 256.0);
    // Adobe RGB (1998) to Rec. 709, both with D65
    let expected = |[r, g, b]: [f32; 3]| [1.398_28 * r - 0.398_28 * g, g, -0.042_93 * g + 1.042_93 * b];
    // 0xA002, the width, in place of the colour space
    let mut unsaid = exif(1, 1, b"R03\0");
    unsaid[41] = 2;
    for exif in [exif(1, 2, b"R98\0"), exif(1, 0xFFFF, b"R03\0"), unsaid] {
        close(png(COLOUR, &[(b"eXIf", &exif)]).first(), expected(COLOUR.map(adobe)));
        let profile = ColorProfile::new_srgb().encode().unwrap();
        close(png_icc(COLOUR, &profile, &[(b"eXIf", &exif)]).first(), COLOUR.map(srgb_to_linear));
    }
    let plain = png(COLOUR, &[(b"eXIf", &exif(1, 1, b"R98\0"))]);
    assert_eq!((plain.first(), plain.notes()), (png(COLOUR, &[]).first(), String::new()));
}

fn both() {
    let file = png(COLOUR, &[(b"eXIf", &exif(1, 1, b"R03\0"))]);
    assert_eq!(file.first(), png(COLOUR, &[]).first());
    assert!(file.notes().contains("R03"), "{}", file.notes());
}

fn uncalibrated() {
    let file = png(COLOUR, &[(b"eXIf", &exif(1, 0xFFFF, b"R98\0"))]);
    assert_eq!(file.first(), png(COLOUR, &[]).first());
    assert!(file.notes().contains("not sRGB"), "{}", file.notes());
}

fn alpha() {
    let image = ImageBuffer::from_fn(8, 4, |x, _| image::Rgba([100, 100, 100, if x < 2 { 0 } else { 255 }]));
    let file = File::new(&encoded(&DynamicImage::ImageRgba8(image), ImageFormat::Png));
    let Content::Display(ldr) = file.content().unwrap() else { panic!("display values") };
    assert_eq!((ldr.unknown(), ldr.linear(TransferFunction::Srgb).unknown()), (0.25, 0.25));
    assert_eq!(ldr.known().unwrap()[..3], [0.0, 0.0, 1.0]);
}

fn grey(width: u32, height: u32) -> DynamicImage {
    DynamicImage::ImageRgb8(ImageBuffer::from_pixel(width, height, Rgb([188; 3])))
}

fn gpano(full: [u32; 2], part: [u32; 2], corner: [u32; 2], others: &str) -> Vec<u8> {
    let pair = |names: [&str; 2], values: [u32; 2]| {
        format!("GPano:{}='{}' GPano:{}='{}' ", names[0], values[0], names[1], values[1])
    };
    let all = pair(["FullPanoWidthPixels", "FullPanoHeightPixels"], full)
        + &pair(["CroppedAreaImageWidthPixels", "CroppedAreaImageHeightPixels"], part)
        + &pair(["CroppedAreaLeftPixels", "CroppedAreaTopPixels"], corner)
        + others;
    xmp(GPANO, "GPano", &all)
}

fn crop() {
    // half as large as when the tag was written
    let file = File::new(&jpeg(&grey(16, 8), &[gpano([64, 32], [32, 16], [16, 8], "")]));
    let Content::Display(ldr) = file.content().unwrap() else { panic!("display values") };
    assert_eq!((ldr.grid().width, ldr.grid().height, ldr.unknown()), (32, 16, 0.75));
    let known = ldr.known().unwrap();
    let inside = |at: usize| (8..24).contains(&(at % 32)) && (4..12).contains(&(at / 32));
    (0..512).for_each(|at| assert_eq!(known[at], if inside(at) { 1.0 } else { 0.0 }, "{at}"));
    assert!(file.notes().contains("256") || file.notes().contains("32 × 16"), "{}", file.notes());
    let whole = File::new(&jpeg(&grey(16, 8), &[gpano([64, 32], [64, 32], [0, 0], "")]));
    let Content::Display(ldr) = whole.content().unwrap() else { panic!("display values") };
    assert_eq!((ldr.grid().width, ldr.unknown(), whole.notes()), (16, 0.0, String::new()));
    // as it is, for a photograph
    let options = ReadOptions { any_aspect: true, place_parts: false, ..ReadOptions::default() };
    let Content::Display(ldr) = Content::read(file.path(), &options).unwrap() else {
        panic!("display values")
    };
    assert!(ldr.grid().width == 16 && ldr.known().is_none() && ldr.notes()[0].contains("GPano"));
    let error = File::new(&jpeg(&grey(16, 8), &[gpano([64, 32], [32, 16], [40, 8], "")])).error();
    assert!(error.contains("GPano") && error.contains("do not fit"), "{error}");
    let sizes = "GPano:FullPanoWidthPixels='32' GPano:FullPanoHeightPixels='16' \
        GPano:CroppedAreaImageWidthPixels='16' GPano:CroppedAreaImageHeightPixels='8' ";
    let placed = |top: &str| {
        let all = format!("{sizes}GPano:CroppedAreaTopPixels='{top}'");
        File::new(&jpeg(&grey(16, 8), &[xmp(GPANO, "GPano", &all)]))
    };
    let error = placed("4,5").error();
    assert!(error.contains("CroppedAreaTopPixels") && error.contains("4,5"), "{error}");
    // what is not said is 0, whatever else is said
    let Content::Display(ldr) = placed("4").content().unwrap() else { panic!("display values") };
    let known = ldr.known().unwrap();
    assert_eq!([known[3 * 32], known[4 * 32], known[4 * 32 + 15], known[4 * 32 + 16]], [0.0, 1.0, 1.0, 0.0]);
}

fn projection() {
    let error =
        File::new(&jpeg(&grey(16, 8), &[xmp(GPANO, "GPano", "GPano:ProjectionType='cylindrical'")])).error();
    assert!(error.contains("ProjectionType") && error.contains("cylindrical"), "{error}");
}

fn pose() {
    let tilted =
        File::new(&jpeg(&grey(16, 8), &[xmp(GPANO, "G", "G:PosePitchDegrees='12' G:PoseRollDegrees='0'")]));
    assert!(tilted.notes().contains("12°"), "{}", tilted.notes());
}

/// Two frames of one colour each (RFC 9649, section 2.7.1.1).
fn animation() {
    let frame = |value: u8| {
        let image = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(8, 4, Rgb([value; 3])));
        let simple = encoded(&image, ImageFormat::WebP);
        let mut content = vec![0; 6];
        // not blended with what is below
        content.extend([7, 0, 0, 3, 0, 0, 100, 0, 0, 2]);
        content.extend(&simple[12..]);
        [b"ANMF".as_slice(), &(content.len() as u32).to_le_bytes(), &content].concat()
    };
    let mut body = b"WEBPVP8X\x0a\0\0\0\x02\0\0\0\x07\0\0\x03\0\0".to_vec();
    body.extend(b"ANIM\x06\0\0\0\0\0\0\0\0\0");
    body.extend(frame(51));
    body.extend(frame(204));
    let file = File::new(&[b"RIFF".as_slice(), &(body.len() as u32).to_le_bytes(), &body].concat());
    close(file.first(), [srgb_to_linear(0.2); 3]);
    assert!(file.notes().contains("first frame"), "{}", file.notes());
}

//! EXR: attributes, alpha, windows.

use exr::prelude::attribute::AttributeValue;
use exr::prelude::*;

use super::Case;
use super::files::{File, close};
use crate::io_tests::exr_file;
use crate::tonemap::srgb_to_linear;

pub(super) const CASES: &[Case] = &[
    ("EXR", "chromaticities", chromaticities),
    ("EXR", "chromaticities of CIE X, Y, Z", xyz),
    ("EXR", "colorInteropID", interop),
    ("EXR", "colorInteropID = data, or of another space", foreign),
    ("EXR", "colorInteropID beside other chromaticities", disagreement),
    ("EXR", "acesImageContainerFlag", aces),
    ("EXR", "oiio:ColorSpace", oiio),
    ("EXR", "whiteLuminance", white),
    ("EXR", "adoptedNeutral", neutral),
    ("EXR", "pixelAspectRatio", aspect),
    ("EXR", "alpha", alpha),
    ("EXR", "alpha of 0 everywhere beside colours", no_alpha),
    ("EXR", "alpha below 1/64 under a colour", hidden),
    ("EXR", "half precision, infinite", beyond),
    ("EXR", "chromaticities of eight zeros", unsaid),
    ("EXR", "Orientation", orientation),
    ("EXR", "data window", window),
    ("EXR", "veni:radianceScale", scale),
];

const RED: [f32; 3] = [0.5, 0.1, 0.2];

fn file(
    colour: [f32; 3],
    alpha: Option<f32>,
    change: impl Fn(&mut ImageAttributes, &mut LayerAttributes),
) -> File {
    let file = File::empty();
    let plane = |value: f32| FlatSamples::F32(vec![value; 32]);
    let mut channels: Vec<_> = ["R", "G", "B"].into_iter().zip(colour.map(plane)).collect();
    channels.extend(alpha.map(|alpha| ("A", plane(alpha))));
    exr_file(file.path(), (8, 4), channels, Encoding::UNCOMPRESSED, change);
    file
}

fn text(name: &'static str, value: &'static str) -> impl Fn(&mut ImageAttributes, &mut LayerAttributes) {
    move |_, own| {
        own.other.insert(name.into(), AttributeValue::Text(value.into()));
    }
}

fn primaries(xy: [[f32; 2]; 4]) -> impl Fn(&mut ImageAttributes, &mut LayerAttributes) {
    let [red, green, blue, white] = xy.map(|[x, y]| Vec2(x, y));
    move |shared, _| shared.chromaticities = Some(attribute::Chromaticities { red, green, blue, white })
}

const ACESCG: [[f32; 2]; 4] = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]];

/// AP1 to linear Rec. 709 with Bradford adaptation, as published with ACES.
fn from_ap1([r, g, b]: [f32; 3]) -> [f32; 3] {
    [
        1.705_05 * r - 0.621_79 * g - 0.083_26 * b,
        -0.130_26 * r + 1.140_80 * g - 0.010_55 * b,
        -0.024_00 * r - 0.128_97 * g + 1.152_97 * b,
    ]
}

fn chromaticities() {
    close(file(RED, None, primaries(ACESCG)).first(), from_ap1(RED));
}

fn xyz() {
    let white = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0]];
    // grey of D65, IEC 61966-2-1
    close(file([0.9505, 1.0, 1.0890].map(|v| v * 0.4), None, primaries(white)).first(), [0.4; 3]);
}

fn interop() {
    close(file(RED, None, text("colorInteropID", "lin_ap1_scene")).first(), from_ap1(RED));
    close(file(RED, None, text("colorInteropID", "srgb_rec709_scene")).first(), RED.map(srgb_to_linear));
    close(file(RED, None, text("colorInteropID", "g22_rec709_scene")).first(), RED.map(|v| v.powf(2.2)));
    assert_eq!(file(RED, None, text("colorInteropID", "lin_rec709_scene")).first(), RED);
    // 58.07 % of PQ is 203 cd/m², the white of a display
    close(file([0.580_69; 3], None, text("colorInteropID", "pq_rec709_display")).first(), [1.0; 3]);
}

fn foreign() {
    for id in ["data", "acescct_ap1_scene"] {
        let error = file(RED, None, text("colorInteropID", id)).error();
        assert!(error.contains("colorInteropID") && error.contains(id), "{error}");
    }
}

fn disagreement() {
    let both = file(RED, None, |shared, own| {
        primaries(ACESCG)(shared, own);
        text("colorInteropID", "lin_rec2020_scene")(shared, own);
    });
    close(both.first(), from_ap1(RED));
    assert!(both.notes().contains("disagree"), "{}", both.notes());
}

fn aces() {
    let flagged = file(RED, None, |shared, _| {
        shared.other.insert("acesImageContainerFlag".into(), AttributeValue::I32(1));
    });
    // ACES2065-1 to linear Rec. 709 with Bradford adaptation, as published with ACES
    let [r, g, b] = RED;
    let expected = [
        2.521_69 * r - 1.134_13 * g - 0.387_56 * b,
        -0.276_48 * r + 1.372_72 * g - 0.096_24 * b,
        -0.015_38 * r - 0.152_98 * g + 1.168_35 * b,
    ];
    close(flagged.first(), expected);
}

fn oiio() {
    close(file(RED, None, text("oiio:ColorSpace", "ACEScg")).first(), from_ap1(RED));
    close(file(RED, None, text("oiio:ColorSpace", "sRGB")).first(), RED.map(srgb_to_linear));
    let linear = file(RED, None, text("oiio:ColorSpace", "Linear"));
    assert_eq!((linear.first(), linear.notes()), (RED, String::new()));
    let other = file(RED, None, text("oiio:ColorSpace", "my space"));
    assert!(other.first() == RED && other.notes().contains("my space"), "{}", other.notes());
}

fn aspect() {
    let of = |ratio| file(RED, None, move |shared, _| shared.pixel_aspect = ratio);
    let wide = of(2.0);
    assert!(wide.first() == RED && wide.notes().contains("pixelAspectRatio = 2"), "{}", wide.notes());
    assert_eq!(of(1.0).notes(), "");
}

fn white() {
    let file = file(RED, None, |_, own| own.white_luminance = Some(120.0));
    assert!(file.first() == RED && file.notes().contains("whiteLuminance = 120"), "{}", file.notes());
}

fn neutral() {
    let file = file(RED, None, |_, own| own.adopted_neutral = Some(Vec2(0.3, 0.4)));
    assert!(file.first() == RED && file.notes().contains("adoptedNeutral"), "{}", file.notes());
}

fn known(file: &File) -> Option<Vec<f32>> {
    let crate::Content::Radiance(panorama) = file.content().unwrap() else { panic!("radiance") };
    panorama.known().map(<[f32]>::to_vec)
}

fn alpha() {
    let half = file(RED, Some(0.5), |_, _| ());
    close(half.first(), RED.map(|v| 2.0 * v));
    assert_eq!(known(&half), None);
    let whole = file(RED, Some(1.0), |_, _| ());
    assert_eq!((whole.first(), known(&whole)), (RED, None));
    let nothing = file([0.0; 3], Some(0.0), |_, _| ());
    assert_eq!(known(&nothing), Some(vec![0.0; 32]));
    // some transparent, with colours behind
    let file = File::empty();
    let mut alpha = vec![1.0; 32];
    alpha[3] = 0.0;
    alpha[4] = f32::NAN;
    let channels = vec![
        ("R", FlatSamples::F32(vec![0.5; 32])),
        ("G", FlatSamples::F32(vec![0.5; 32])),
        ("B", FlatSamples::F32(vec![0.5; 32])),
        ("A", FlatSamples::F32(alpha)),
    ];
    exr_file(file.path(), (8, 4), channels, Encoding::FAST_LOSSLESS, |_, _| ());
    let found = known(&file).unwrap();
    assert_eq!(
        found.iter().enumerate().filter(|(_, k)| **k == 0.0).map(|(at, _)| at).collect::<Vec<_>>(),
        [3, 4]
    );
    assert_eq!(file.linear().0[3], [0.0; 3]);
}

fn hidden() {
    let file = File::empty();
    let plane = |value: f32| FlatSamples::F32(vec![value; 32]);
    let half = (0..32)
        .map(|at| {
            if at < 4 {
                0.0
            } else if at < 8 {
                1e-4
            } else {
                1.0
            }
        })
        .collect();
    let channels =
        vec![("R", plane(0.5)), ("G", plane(0.5)), ("B", plane(0.5)), ("A", FlatSamples::F32(half))];
    exr_file(file.path(), (8, 4), channels, Encoding::FAST_LOSSLESS, |_, _| ());
    assert!(file.notes().contains("25.0 % of its pixels have a colour"), "{}", file.notes());
    assert_eq!(known(&file).unwrap().iter().sum::<f32>(), 24.0);
}

fn beyond() {
    let file = File::empty();
    let plane = |first: f16| {
        let mut values = vec![f16::ONE; 32];
        values[0] = first;
        FlatSamples::F16(values)
    };
    let channels = vec![("R", plane(f16::INFINITY)), ("G", plane(f16::INFINITY)), ("B", plane(f16::ONE))];
    exr_file(file.path(), (8, 4), channels, Encoding::FAST_LOSSLESS, |_, _| ());
    assert_eq!(file.first(), [65504.0, 65504.0, 1.0]);
    assert!(file.notes().contains("2 values are infinite"), "{}", file.notes());
}

fn unsaid() {
    let file = file(RED, None, primaries([[0.0; 2]; 4]));
    assert!(file.first() == RED && file.notes().contains("all 0"), "{}", file.notes());
}

fn orientation() {
    let of = |at| {
        file(RED, None, move |_, own| {
            own.other.insert("Orientation".into(), AttributeValue::I32(at));
        })
    };
    let turned = of(6);
    assert!(turned.first() == RED && turned.notes().contains("Orientation = 6"), "{}", turned.notes());
    assert_eq!(of(1).notes(), "");
}

fn no_alpha() {
    let file = file(RED, Some(0.0), |_, _| ());
    assert_eq!((file.first(), known(&file)), (RED, None));
    assert!(file.notes().contains("alpha"), "{}", file.notes());
    // outside of what the file holds nothing is known all the same
    let part = self::file(RED, Some(0.0), |shared, own| {
        own.layer_position = Vec2(2, 1);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(12, 6));
    });
    assert_eq!(known(&part).unwrap().iter().sum::<f32>(), 32.0);
}

fn window() {
    let file = file(RED, None, |shared, own| {
        own.layer_position = Vec2(2, 1);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(12, 6));
    });
    let found = known(&file).unwrap();
    let inside = |at: usize| (2..10).contains(&(at % 12)) && (1..5).contains(&(at / 12));
    (0..72).for_each(|at| assert_eq!(found[at], if inside(at) { 1.0 } else { 0.0 }, "{at}"));
}

fn scale() {
    close(file(RED, None, text("veni:radianceScale", "0.25")).first(), RED.map(|v| 4.0 * v));
}

//! Radiance: header lines.

use super::Case;
use super::files::{File, close};

pub(super) const CASES: &[Case] = &[
    ("Radiance", "EXPOSURE", exposure),
    ("Radiance", "EXPOSURE=0", unknown_exposure),
    ("Radiance", "COLORCORR", correction),
    ("Radiance", "PRIMARIES", primaries),
    ("Radiance", "GAMMA", gamma),
    ("Radiance", "FORMAT=32-bit_rle_xyze", xyze),
    ("Radiance", "FORMAT of another kind", foreign),
    ("Radiance", "PIXASPECT", aspect),
    ("Radiance", "resolution (-Y +X and others)", resolution),
];

/// Two pixels: 1, ½, ¼ and black.
fn file(lines: &str) -> File {
    let head = format!("#?RADIANCE\n{lines}\n\n-Y 1 +X 2\n");
    File::new(&[head.as_bytes(), &[128, 64, 32, 129, 0, 0, 0, 0]].concat())
}

fn exposure() {
    close(file("EXPOSURE=2\nEXPOSURE= 4").first(), [0.125, 0.0625, 0.031_25]);
    // of the picture that this one was made of
    let made = file("other.hdr:\n\tEXPOSURE=8\n\tFORMAT=unknown\n  EXPOSURE=8\npcomb other.hdr\nEXPOSURE=2");
    close(made.first(), [0.5, 0.25, 0.125]);
}

fn unknown_exposure() {
    let file = file("EXPOSURE=0\nEXPOSURE=2");
    close(file.first(), [0.5, 0.25, 0.125]);
    assert!(file.notes().contains("EXPOSURE=0"), "{}", file.notes());
}

fn correction() {
    close(file("COLORCORR=2 4 0.5\nEXPOSURE=2\nCOLORCORR=1 1 2").first(), [0.25, 0.0625, 0.125]);
    assert!(file("COLORCORR=0 0 0").notes().contains("COLORCORR"));
}

fn primaries() {
    // ACES2065-1 to Rec. 709 with Bradford adaptation, as published with ACES
    let expected = [
        2.521_69 - 0.5 * 1.134_13 - 0.25 * 0.387_56,
        -0.276_48 + 0.5 * 1.372_72 - 0.25 * 0.096_24,
        -0.015_38 - 0.5 * 0.152_98 + 0.25 * 1.168_35,
    ];
    close(file("PRIMARIES=0.7347 0.2653 0 1 0.0001 -0.077 0.32168 0.33767").first(), expected);
    for none in ["PRIMARIES=0 0 0 0 0 0 0 0", "PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329"] {
        assert_eq!(file(none).first(), [1.0, 0.5, 0.25], "{none}");
    }
}

fn gamma() {
    close(file("GAMMA=2\nEXPOSURE=2").first(), [0.5, 0.125, 0.031_25]);
    assert_eq!(file("GAMMA=1").first(), [1.0, 0.5, 0.25]);
}

fn xyze() {
    let file = File::new(
        &[b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n".as_slice(), &[128, 128, 128, 129]].concat(),
    );
    close(file.first(), [1.0; 3]);
    let green = File::new(
        &[b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n".as_slice(), &[0, 128, 0, 129]].concat(),
    );
    let [r, g, b] = green.first();
    assert!(r < 0.0 && g > 1.0 && b < 0.0, "Y alone lies outside of Rec. 709: {r} {g} {b}");
}

fn foreign() {
    assert!(file("FORMAT=32-bit_rle_abcd").error().contains("32-bit_rle_abcd"));
}

fn aspect() {
    let file = file("PIXASPECT=2");
    assert!(file.first() == [1.0, 0.5, 0.25] && file.notes().contains("PIXASPECT=2"), "{}", file.notes());
    assert_eq!(self::file("PIXASPECT=1").notes(), "");
}

/// The reader's own tests have all eight.
fn resolution() {
    let file =
        File::new(&[b"#?RADIANCE\n\n+Y 2 +X 1\n".as_slice(), &[0, 0, 0, 0, 128, 64, 32, 129]].concat());
    assert_eq!(file.linear().0, [[1.0, 0.5, 0.25], [0.0; 3]]);
}

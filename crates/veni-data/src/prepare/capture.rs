//! Which capture a file belongs to, by its name.

use std::path::Path;

/// Words at the end of a name that say how a capture was processed or stored, not which one it is.
const VARIANTS: [&str; 22] = [
    "hdr",
    "hdri",
    "ldr",
    "exr",
    "sdr",
    "env",
    "latlong",
    "equirect",
    "equirectangular",
    "panorama",
    "puresky",
    "mirror",
    "mirrored",
    "flipped",
    "turned",
    "rotated",
    "tonemapped",
    "copy",
    "small",
    "large",
    "preview",
    "8bit",
];

/// Names that cameras and tools count up: the number is all that tells one capture from the next.
const COUNTERS: [&str; 16] = [
    "img", "image", "dsc", "dscn", "dscf", "pano", "panorama", "photo", "pic", "frame", "r", "gs", "gopr",
    "sky", "hdr", "hdri",
];

/// The capture that a file's name speaks of: without extension, in lower case, words joined by `_`. Taken off from
/// its end:
///
/// - resolutions (`_1k`, `_16k`, `_4096x2048`, `_2048px`),
/// - exposures and brackets (`_ev0`, `_ev-2`, `_ev+1`, `_exp3`, `_0ev`),
/// - variants (`_ldr`, `_puresky`, `_mirrored`, `_copy`, …),
/// - and once, a number of one or two digits (`_02`), since series at one place and time are counted so: `forest_01`
///   and `forest_02` share most of their light. Longer numbers, numbers alone and numbers behind a camera's
///   counter word (`IMG_07`, `frame_3`) stay.
///
/// A name of numbers and counter words alone is told apart by its folder: `monday/IMG_0001` and `tuesday/IMG_0001` are
/// two captures. What is left is never empty.
pub fn capture(path: &Path) -> String {
    let name = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().to_lowercase();
    let own = strip(&name(path.file_stem()));
    let counted = own.split('_').all(|w| COUNTERS.contains(&w) || !w.chars().any(char::is_alphabetic));
    match name(path.parent().and_then(Path::file_name)) {
        folder if counted && !folder.is_empty() => format!("{folder}/{own}"),
        _ => own,
    }
}

/// The name without what does not tell captures apart.
fn strip(lower: &str) -> String {
    let mut words: Vec<&str> = lower.split(['_', ' ', '.', '(', ')']).collect();
    // a hyphen divides words too, but belongs to the exposure in `ev-2`
    words = words.iter().flat_map(|word| split_hyphens(word)).filter(|w| !w.is_empty()).collect();
    while words.len() > 1 && words.last().is_some_and(|w| is_variant(w)) {
        words.pop();
    }
    if words.len() > 1 && words.last().is_some_and(|w| is_series_number(w)) {
        let before = words[words.len() - 2];
        let named = words[..words.len() - 1].iter().any(|w| w.chars().any(char::is_alphabetic));
        if named && !COUNTERS.contains(&before) && !before.chars().all(|c| c.is_ascii_digit()) {
            words.pop();
        }
        while words.len() > 1 && words.last().is_some_and(|w| is_variant(w)) {
            words.pop();
        }
    }
    if words.is_empty() { lower.to_owned() } else { words.join("_") }
}

fn split_hyphens(word: &str) -> Vec<&str> {
    if is_exposure(word) { vec![word] } else { word.split('-').collect() }
}

fn is_variant(word: &str) -> bool {
    VARIANTS.contains(&word) || is_resolution(word) || is_exposure(word)
}

fn is_resolution(word: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    match word.split_once('x') {
        Some((width, height)) => digits(width) && digits(height),
        None => ["k", "px"].iter().any(|unit| word.strip_suffix(unit).is_some_and(digits)),
    }
}

fn is_exposure(word: &str) -> bool {
    let number = |text: &str| text.parse::<f32>().is_ok_and(f32::is_finite);
    ["ev", "exp", "exposure"].iter().any(|unit| {
        word.strip_prefix(unit).is_some_and(number) || word.strip_suffix(unit).is_some_and(number)
    })
}

fn is_series_number(word: &str) -> bool {
    (1..=2).contains(&word.len()) && word.chars().all(|c| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_of_a_capture_share_its_name() {
        for stem in [
            "kloofendal_43d_clear",
            "kloofendal_43d_clear_1k",
            "Kloofendal_43d_Clear_puresky_16k",
            "kloofendal_43d_clear_4096x2048",
            "kloofendal_43d_clear_ev-2",
            "kloofendal 43d clear (2)",
            "kloofendal-43d-clear_EV+1.5_ldr",
            "kloofendal_43d_clear_02_2k",
            "kloofendal_43d_clear_copy",
        ] {
            let path = Path::new("any").join(format!("{stem}.exr"));
            assert_eq!(capture(&path), "kloofendal_43d_clear", "{stem}");
        }
    }

    #[test]
    fn what_tells_captures_apart_stays() {
        for (stem, name) in [
            ("IMG_07", "img_07"),
            ("frame_3", "frame_3"),
            ("dresden_1234", "dresden_1234"),
            ("2023_05_12", "2023_05_12"),
            ("monday/IMG_07", "monday/img_07"),
            ("tuesday/0001", "tuesday/0001"),
            ("tuesday/square", "square"),
            ("9C4A0003-e05009bcad", "9c4a0003_e05009bcad"),
            ("qwantani_noon", "qwantani_noon"),
            ("hdr", "hdr"),
            ("4k", "4k"),
            ("_", "_"),
            ("été_2", "été"),
        ] {
            assert_eq!(capture(Path::new(&format!("{stem}.jpg"))), name, "{stem}");
        }
        assert_ne!(capture(Path::new("pano_000123.png")), capture(Path::new("pano_000124.png")));
    }
}

//! Fingerprints and groups of real panoramas.

use std::path::{Path, PathBuf};

use super::*;
use crate::expand::{Expand, ExpandOptions};
use veni_image::tonemap::srgb;
use veni_image::{LdrPanorama, Panorama, ReadOptions};
use veni_light::sphere::Equirect;

fn files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas");
    let list = |side| std::fs::read_dir(root.join(side)).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = ["train", "val"]
        .into_iter()
        .flat_map(list)
        .filter(|f| f.extension().is_some_and(|e| e == "exr"))
        .collect();
    files.sort();
    files
}

fn panoramas() -> Vec<Panorama> {
    files().iter().map(|f| Panorama::read(f).unwrap()).collect()
}

/// As a camera that clips its brightest tenth would have recorded it.
fn clipped(panorama: &Panorama) -> Panorama {
    let white = veni_image::tonemap::quantile(panorama.pixels().as_flattened(), 0.9);
    let code = |v: f32| (srgb((v / white).min(1.0)) * 255.0).round() / 255.0;
    let values = panorama.pixels().iter().map(|p| p.map(code)).collect();
    LdrPanorama::new(panorama.grid(), values).expand(&ExpandOptions::default()).panorama
}

#[test]
fn copies_are_found_and_other_places_are_not() {
    let originals = panoramas();
    let prints: Vec<_> = originals.iter().map(Fingerprint::new).collect();
    for (a, first) in prints.iter().enumerate() {
        for second in &prints[a + 1..] {
            assert!(
                first.unpack().near_duplicate(&second.unpack()).is_none(),
                "{:?}",
                first.likeness(second)
            );
        }
    }
    let mut rotated_back = 0;
    for (panorama, print) in originals.iter().zip(&prints) {
        let alike = |other: &Panorama| print.unpack().near_duplicate(&Fingerprint::new(other).unpack());
        let mut bright = panorama.clone();
        bright.scale(37.0);
        for copy in [
            bright,
            panorama.resample(Equirect::new(100, 50)),
            panorama.rotated(2.345),
            panorama.mirror().rotated(-1.0),
            clipped(panorama),
        ] {
            assert!(alike(&copy).is_some(), "{:?}", print.likeness(&Fingerprint::new(&copy)));
        }
        let found = alike(&panorama.rotated(2.345)).unwrap();
        rotated_back += usize::from(!found.mirrored && (found.rotation - 2.345).abs() < 0.05);
        assert!(alike(&panorama.mirror()).unwrap().mirrored);
    }
    assert_eq!(rotated_back, originals.len(), "the rotation is found");
}

#[test]
fn the_bound_spares_comparisons_and_loses_none() {
    let prints: Vec<_> = panoramas().iter().map(|p| Fingerprint::new(p).unpack()).collect();
    for a in &prints {
        for b in &prints {
            let around = a.likeness(b).around;
            assert!(around <= a.bound(b) + 1e-5, "{around} is above the bound {}", a.bound(b));
        }
    }
}

#[test]
fn captures_and_copies_are_joined_through_each_other() {
    let originals = panoramas();
    let prints: Vec<_> = [&originals[0], &originals[1], &originals[0].rotated(1.0), &originals[2]]
        .map(Fingerprint::new)
        .into();
    let members: Vec<_> = (["b", "a", "c", "c"].into_iter().zip(&prints))
        .map(|(capture, fingerprint)| Member { capture, fingerprint })
        .collect();
    let groups = group(&members);
    assert_eq!(groups.keys, ["b", "a", "b", "b"], "0 and 2 look alike, 2 and 3 are one capture");
    assert_eq!(groups.bonds.iter().map(|b| (b.first, b.second)).collect::<Vec<_>>(), [(0, 2)]);
}

/// The first and the last of five have nothing in common but what lies between them: look, name, look, name.
#[test]
fn a_group_reaches_through_several_links_and_leaves_the_others_out() {
    let originals = panoramas();
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| &originals[k]);
    let prints: Vec<_> = [a, &a.mirror(), b, &b.rotated(2.0), c, d].map(Fingerprint::new).into();
    let captures = ["e", "d", "d", "c", "c", "z"];
    let members: Vec<_> = (captures.into_iter().zip(&prints))
        .map(|(capture, fingerprint)| Member { capture, fingerprint })
        .collect();
    let groups = group(&members);
    assert_eq!(groups.keys, ["c", "c", "c", "c", "c", "z"]);
    assert_eq!(groups.bonds.iter().map(|b| (b.first, b.second)).collect::<Vec<_>>(), [(0, 1), (2, 3)]);
    // without the middle the two ends are strangers
    let apart = group(&[members[0], members[1], members[3], members[4]]);
    assert_eq!(apart.keys, ["d", "d", "c", "c"]);
}

/// A picture of a display's range: what is clipped is counted by solid angle, the sun is added where it is, and the facts are
/// those of the expansion.
#[test]
fn an_expanded_file_says_what_was_clipped_and_where_its_sun_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.png");
    let grid = Equirect::new(64, 32);
    // two rows of four columns at an elevation of about 40°, around the middle column but one
    let white = |column: usize, row: usize| (8..10).contains(&row) && (38..42).contains(&column);
    let pixels: Vec<[u8; 3]> = (0..grid.len())
        .map(|k| (k % 64, k / 64))
        .map(|(column, row)| if white(column, row) { [255; 3] } else { [60 + row as u8, 80, 120] })
        .collect();
    veni_image::write_png(&path, [64, 32], &pixels, veni_light::output::Overwrite::Refuse).unwrap();
    let config = PrepareConfig {
        grid: Equirect::new(32, 16),
        expand: Some(Expander::Fitted(ExpandOptions::default())),
        read: ReadOptions::default(),
    };
    let found = examine(&path, &config).unwrap();
    let expansion = found.expanded.unwrap();
    let angle = 4.0 * (grid.solid_angle(8) + grid.solid_angle(9));
    assert!((expansion.clipped - angle / (4.0 * std::f64::consts::PI)).abs() < 1e-12, "{expansion:?}");
    let sun = expansion.sun.unwrap().direction;
    let middle = grid.direction(40, 9);
    let cosine: f32 = sun.iter().zip(middle).map(|(a, b)| a * b).sum();
    assert!(cosine > 8f32.to_radians().cos(), "{sun:?} is not near {middle:?}");
    assert!(expansion.estimate.is_none() && found.replaced.total() == 0);
    assert_eq!((found.size, found.panorama.grid()), (grid, config.grid));
    // brighter than white, which is what a display shows of it
    assert!(found.panorama.pixels().iter().flatten().any(|v| *v > 1.5) && found.stops > 2.0);
    let off = PrepareConfig { expand: None, ..config };
    let refused = examine(&path, &off).unwrap_err().to_string();
    assert!(refused.contains("sky.png") && refused.contains("switched off"), "{refused}");
}

/// The expected digits are `sha256sum`'s, of a file longer than the buffer that it is read with.
#[test]
fn a_files_hash_is_the_standards() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    let hash = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        content_hash(&path).unwrap().to_string()
    };
    assert_eq!(hash(b""), "e3b0c44298fc1c14");
    assert_eq!(hash(b"a panorama, as far as its bytes go"), "1ed33f323d09ba02");
    assert_eq!(hash(&[7; 200_000]), "8cfcba83dcfc81a1");
    assert!(content_hash(&folder.path().join("none.exr")).unwrap_err().to_string().contains("none.exr"));
}

#[test]
fn what_is_unfit_is_refused_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let config = PrepareConfig {
        grid: Equirect::new(32, 16),
        expand: Some(Expander::Fitted(ExpandOptions::default())),
        read: ReadOptions::default(),
    };
    let good = panoramas().swap_remove(0);
    let write = |name: &str, change: fn(usize, f32) -> f32| {
        let path = folder.path().join(name);
        let (width, height) = (good.grid().width, good.grid().height);
        exr::prelude::write_rgb_file(&path, width, height, |x, y| {
            let [r, g, b] = good.pixel(x, y).map(|v| change(y * width + x, v));
            (r, g, b)
        })
        .unwrap();
        examine(&path, &config)
    };
    let fine = write("good.exr", |_, v| v).unwrap();
    assert_eq!((fine.panorama.grid(), fine.size, fine.replaced.total()), (config.grid, good.grid(), 0));
    assert!(fine.expanded.is_none() && fine.stops > 1.0);
    let patched = write("patched.exr", |k, v| if k % 50 == 0 { f32::NAN } else { v }).unwrap();
    assert!(patched.replaced.nan > 100 && patched.panorama.pixels().iter().flatten().all(|v| v.is_finite()));
    type Change = fn(usize, f32) -> f32;
    let cases: [(&str, &str, Change); 3] = [
        ("nan.exr", "not numbers", |k, v| if k % 10 == 0 { f32::NAN } else { v }),
        ("black.exr", "black", |k, v| if k % 8 < 5 { 0.0 } else { v }),
        ("grey.exr", "same value", |_, _| 0.5),
    ];
    for (name, words, change) in cases {
        let error = write(name, change).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(words), "{error}");
    }
    let config = PrepareConfig { grid: Equirect::new(256, 128), ..config };
    let error = examine(&folder.path().join("good.exr"), &config).unwrap_err().to_string();
    assert!(error.contains("128 × 64") && error.contains("256 × 128"), "{error}");
}

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

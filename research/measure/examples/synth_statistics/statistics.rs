//! The statistics of one panorama.

use veni_core::panorama::tonemap::quantile;
use veni_core::panorama::{Panorama, luminance};
use veni_core::sphere::Equirect;

pub(crate) const GRID: Equirect = Equirect { width: 128, height: 64 };

/// ln Y at exposure 0 beyond which the brightest pixel is taken for a sun (or moon) that nothing hides.
const SUN_IN_VIEW: f32 = 6.0;

/// The statistics of one panorama, by name.
pub(crate) fn statistics(panorama: &Panorama) -> Vec<(&'static str, f32)> {
    let exposure = panorama.mean_log_luminance();
    let log: Vec<f32> = panorama.pixels().iter().map(|p| luminance(*p).max(1e-30).ln() - exposure).collect();
    let weight = |k: usize| GRID.solid_angle(k / GRID.width);
    let mean = |rows: std::ops::Range<usize>, f: &dyn Fn(usize) -> f32| {
        let all = rows.start * GRID.width..rows.end * GRID.width;
        let total: f64 = all.clone().map(weight).sum();
        (all.map(|k| f64::from(f(k)) * weight(k)).sum::<f64>() / total) as f32
    };
    let ratio = |k: usize, a: usize, b: usize| {
        let p = panorama.pixels()[k];
        (p[a].max(1e-30) / p[b].max(1e-30)).ln()
    };
    // quantiles by solid angle: each row repeats in proportion
    let mut spread = Vec::new();
    for (k, v) in log.iter().enumerate() {
        let copies = (weight(k) / GRID.solid_angle(32) * 8.0).round().max(1.0) as usize;
        spread.extend(std::iter::repeat_n(*v, copies));
    }
    let q = |at: f64| quantile(&spread, at);
    let sd = |rows: std::ops::Range<usize>, f: &dyn Fn(usize) -> f32| {
        let m = mean(rows.clone(), f);
        mean(rows, &|k| (f(k) - m) * (f(k) - m)).sqrt()
    };
    let row_sd = (20..44).map(|j| sd(j..j + 1, &|k| log[k])).sum::<f32>() / 24.0;
    let step = |k: usize| (log[k] - log[k - k % 128 + (k + 1) % 128]).abs();
    let chroma = |k: usize| ratio(k, 2, 0);
    let mut out = vec![
        ("sd of ln Y", sd(0..64, &|k| log[k])),
        ("ln Y, 1 %", q(0.01)),
        ("5 %", q(0.05)),
        ("25 %", q(0.25)),
        ("50 %", q(0.5)),
        ("75 %", q(0.75)),
        ("95 %", q(0.95)),
        ("99 %", q(0.99)),
        ("largest", q(1.0)),
        ("mean ln Y, 60° to 90°", mean(0..11, &|k| log[k])),
        ("30° to 60°", mean(11..21, &|k| log[k])),
        ("10° to 30°", mean(21..28, &|k| log[k])),
        ("0° to 10°", mean(28..32, &|k| log[k])),
        ("−10° to 0°", mean(32..36, &|k| log[k])),
        ("−30° to −10°", mean(36..43, &|k| log[k])),
        ("−90° to −30°", mean(43..64, &|k| log[k])),
        ("upper half less lower", mean(0..32, &|k| log[k]) - mean(32..64, &|k| log[k])),
        ("sd of ln Y along rows within 33° of the horizon", row_sd),
        ("neighbours' difference in ln Y, above", mean(4..32, &step)),
        ("neighbours' difference in ln Y, below", mean(32..60, &step)),
        ("mean ln R/G, above", mean(0..32, &|k| ratio(k, 0, 1))),
        ("mean ln R/G, below", mean(32..64, &|k| ratio(k, 0, 1))),
        ("mean ln B/G, above", mean(0..32, &|k| ratio(k, 2, 1))),
        ("mean ln B/G, below", mean(32..64, &|k| ratio(k, 2, 1))),
        ("sd of ln B/R", sd(0..64, &chroma)),
    ];
    out.extend(bands(&log));
    out.extend(around_the_brightest(&log));
    out
}

/// Deviation of ln Y within octaves of size (differences of means over squares), above and below the horizon.
fn bands(log: &[f32]) -> Vec<(&'static str, f32)> {
    const NAMES: [[&str; 5]; 2] = [
        ["sd above, 3° to 6°", "6° to 11°", "11° to 22°", "22° to 45°", "45° to 90°"],
        ["sd below, 3° to 6°", "6° to 11°", "11° to 22°", "22° to 45°", "45° to 90°"],
    ];
    let mut out = Vec::new();
    for (half, names) in NAMES.iter().enumerate() {
        let (width, mut level) = (GRID.width, log[half * GRID.len() / 2..][..GRID.len() / 2].to_vec());
        for (k, name) in names.iter().enumerate() {
            let (w, h) = (width >> k, 32 >> k);
            let at = |i: usize, j: usize| level[j * w + i];
            let coarse: Vec<f32> = (0..w * h / 4)
                .map(|c| {
                    let (i, j) = (c % (w / 2) * 2, c / (w / 2) * 2);
                    0.25 * (at(i, j) + at(i + 1, j) + at(i, j + 1) + at(i + 1, j + 1))
                })
                .collect();
            let (mut sum, mut total) = (0.0, 0.0);
            for (c, v) in level.iter().enumerate() {
                let (i, j) = (c % w, c / w);
                let row = (half * 32 + (j << k) + (1 << k) / 2).min(GRID.height - 1);
                let weight = GRID.solid_angle(row);
                sum += weight * f64::from(v - coarse[j / 2 * (w / 2) + i / 2]).powi(2);
                total += weight;
            }
            out.push((*name, (sum / total).sqrt() as f32));
            level = coarse;
        }
    }
    out
}

/// Mean ln Y in rings around the brightest pixel, where it is bright enough to be a sun or moon in view.
fn around_the_brightest(log: &[f32]) -> Vec<(&'static str, f32)> {
    const RINGS: [(&str, f32, f32); 5] = [
        ("mean ln Y, 4° to 8° from a visible sun", 4.0, 8.0),
        ("8° to 15°", 8.0, 15.0),
        ("15° to 30°", 15.0, 30.0),
        ("30° to 60°", 30.0, 60.0),
        ("60° to 90°", 60.0, 90.0),
    ];
    let brightest = (0..log.len()).max_by(|a, b| log[*a].total_cmp(&log[*b])).unwrap_or(0);
    let seen = log[brightest] > SUN_IN_VIEW;
    let all = GRID.directions();
    let towards = all[brightest];
    let mut out = vec![("share with a visible sun (mean)", f32::from(u8::from(seen)))];
    for (name, from, to) in RINGS {
        let (mut sum, mut total) = (0.0, 0.0);
        for (k, d) in all.iter().enumerate().filter(|(_, d)| d[2] > 0.0) {
            let cosine: f32 = d.iter().zip(towards).map(|(a, b)| a * b).sum();
            if (from..to).contains(&cosine.clamp(-1.0, 1.0).acos().to_degrees()) {
                let weight = GRID.solid_angle(k / GRID.width);
                sum += weight * f64::from(log[k]);
                total += weight;
            }
        }
        out.push((name, if seen && total > 0.0 { (sum / total) as f32 } else { f32::NAN }));
    }
    out
}

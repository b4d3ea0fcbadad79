//! What the protocols report, against their definitions and against numbers written down.

use super::*;
use veni_light::latent::Latent;

/// Whether no value differs from what is expected by more than this part of it.
fn all_near<const N: usize>(values: [f64; N], expected: [f64; N], tolerance: f64) -> bool {
    values.iter().zip(expected).all(|(value, e)| (value - e).abs() <= tolerance * e.abs())
}

#[test]
fn interpolation_measures_steps_of_the_straight_way() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(2), [subject("tiny", 1)]);
    let settings = Settings { frames: 5, ..quick() };
    let (report, _) =
        evaluated(folder.path(), &subjects, &data, settings, |run| interpolation::run(run).unwrap());
    let ends: Vec<_> = data.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    let ends = subjects[0].encode(GRID, &ends).unwrap();
    let frame = |k: usize| {
        let t = k as f32 / 4.0;
        let mix = |a: &[f32; 3], b: &[f32; 3]| [0, 1, 2].map(|c| (1.0 - t) * a[c] + t * b[c]);
        let between = ends[0].vectors.iter().zip(&ends[1].vectors).map(|(a, b)| mix(a, b)).collect();
        subjects[0].decode(GRID, &[Latent::new(between)]).unwrap().concat()
    };
    let frames: Vec<_> = (0..5).map(frame).collect();
    let root_mean_square = |a: &[f32], b: &[f32]| {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (sum / a.len() as f64).sqrt()
    };
    let steps: Vec<_> = frames.windows(2).map(|pair| root_mean_square(&pair[0], &pair[1])).collect();
    let length: f64 = steps.iter().sum();
    let largest = steps.iter().copied().fold(0.0, f64::max) / (length / 4.0);
    let columns = ["mean step (RMS log radiance)", "largest step / mean", "length / direct distance"];
    let values = columns.map(|column| number(&report.tables[0], "tiny", column));
    let expected = [length / 4.0, largest, length / root_mean_square(&frames[0], &frames[4])];
    assert!(all_near(values, expected, 1e-4), "{values:?} instead of {expected:?}");
    let literal = [0.280_106, 1.016_741, 3.026_457];
    assert!(all_near(values, literal, 1e-3), "{values:?}; written down is {literal:?}");
}

#[test]
fn uniqueness_reports_the_numbers_written_down() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(2), [subject("tiny", 1)]);
    let (report, _) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| uniqueness::run(run).unwrap());
    let columns = ["MSE first to midpoint", "MSE of the fits", "latent distance (RMS)"];
    let values = columns.map(|column| number(&report.tables[0], "tiny", column));
    // 300 updates of Adam carry the last bits of a processor's sums further than one pass does
    let literal = [0.246_399, 2.186_853, 1.272_092];
    assert!(all_near(values, literal, 0.02), "{values:?}; written down is {literal:?}");
}

#[test]
fn consistency_reports_the_number_written_down() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(1), [subject("tiny", 1)]);
    let (report, _) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| consistency::run(run).unwrap());
    let value = number(&report.tables[0], "tiny", "Spearman, N(0, 1)");
    assert!(all_near([value], [0.261_969_6], 1e-3), "{value}");
}

#[test]
fn a_training_set_size_has_the_scores_of_reconstruction() {
    let (folder, data) = (tempfile::tempdir().unwrap(), skies(2));
    let mut model = model(2);
    let training = veni_light::model::Training { panoramas: Some(76), ..Default::default() };
    model.set_info(ModelInfo { training: Some(training), ..ModelInfo::default() });
    let subjects = [LoadedModel::new("sized", model, &Device::flex()).unwrap()];
    let (sizes, _) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| dataset_size::run(run).unwrap());
    let (scores, _) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| reconstruction::run(run).unwrap());
    assert_eq!(sizes.tables[0].rows[0][1].number(), Some(76.0));
    let values = [&sizes, &scores].map(|report| {
        let table = &report.tables[0];
        let at = table.columns.iter().position(|c| c.title == "LDR PSNR (exp.)").unwrap();
        [0, 1].map(|pass| table.rows[pass][at].number().unwrap())
    });
    assert_eq!(values[0], values[1]);
    let literal = [6.985_331, 7.095_595];
    assert!(all_near(values[0], literal, 1e-3), "{values:?}; written down is {literal:?}");
}

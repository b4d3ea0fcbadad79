//! Examining files, several at a time, and keeping what was learnt of each as soon as it is known.

use std::sync::Mutex;

use anyhow::Result;
use veni_data::parallel::parallel;
use veni_data::prepare::{PrepareConfig, content_hash, examine};
use veni_image::{Budget, HALF_ERROR, HalfRange, Panorama, Precision, WriteFormat, WriteOptions, half_error};
use veni_light::output::Overwrite;

use super::network::NetworkSettings;
use super::record::{Facts, Fate, Record};
use super::scan::Source;
use super::store::Store;
use crate::output::{CHOOSE_LAYER, with_remedy};
use crate::progress::ProgressBars;
use crate::report::{Report, complain};

/// The brightest value that is written without a factor, with headroom for rounding.
const BRIGHTEST: f32 = 60_000.0;
/// A mean luminance below this loses digits in half precision: 2⁻⁸.
const DARKEST: f32 = 1.0 / 256.0;

/// Examines what the store does not know yet.
pub(super) fn examine_all(
    store: &mut Store,
    sources: &[Source],
    config: &PrepareConfig,
    network: Option<&NetworkSettings>,
    report: Report,
) -> Result<()> {
    let todo: Vec<&Source> = sources.iter().filter(|s| !store.is_done(s)).collect();
    let skipped = sources.len() - todo.len();
    if skipped > 0 {
        report.note(format_args!("{skipped} of {} files were examined before", sources.len()));
    }
    let progress = ProgressBars::new(report);
    progress.begin_after(skipped as u64, "", "file", Some(sources.len() as u64));
    let store = Mutex::new(store);
    // as many at a time as there is memory for the pixels that their headers declare
    parallel(todo.len(), |at| -> Result<()> {
        let source = todo[at];
        let _claim = Budget::shared().claim_file(&source.path, &config.read);
        let fate = fate(&store, source, config, network)?;
        if let Fate::Refused(reason) = &fate {
            complain(&format!("{}: {reason}", source.path.display()));
        }
        lock(&store).add(Record::new(source, fate))?;
        progress.add(1);
        Ok(())
    })?;
    progress.end();
    Ok(())
}

/// A panic in another file's thread is reported there; the data behind the lock is whole between calls.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// What becomes of one file; an error is about the output, or the system.
fn fate(
    store: &Mutex<&mut Store>,
    source: &Source,
    config: &PrepareConfig,
    network: Option<&NetworkSettings>,
) -> Result<Fate> {
    let refused = |error: veni_light::Error| {
        let text = match &error {
            veni_light::Error::Layers { .. } => format!("{error}; {CHOOSE_LAYER}"),
            _ => error.with_source(),
        };
        let prefix = format!("{}: ", source.path.display());
        Fate::Refused(text.strip_prefix(&prefix).unwrap_or(&text).to_owned())
    };
    let id = match content_hash(&source.path) {
        Ok(id) => id.to_string(),
        Err(error) => return Ok(refused(error)),
    };
    let examined = match examine(&source.path, config) {
        Ok(examined) => examined,
        Err(error) => return Ok(refused(error)),
    };
    for note in &examined.notes {
        complain(&format!("{}: {note}", source.path.display()));
    }
    let path = lock(store).waiting(&id);
    let (precision, half_range) = storage(&examined.panorama);
    let options = WriteOptions {
        half_range,
        overwrite: Overwrite::Replace,
        ..WriteOptions::new(WriteFormat::Exr(precision))
    };
    examined.panorama.write(&path, &options).map_err(with_remedy)?;
    Ok(Fate::Fit(Box::new(Facts::new(id, &examined, network))))
}

/// Half precision holds values from 6e-5 to 65,504 with full precision; panoramas in other units are scaled by a power of
/// two, which the file records and readers divide out. What is wider than half precision is written as floats.
fn storage(panorama: &Panorama) -> (Precision, HalfRange) {
    let factor = factor(panorama);
    let keeps = |factor: f32| half_error(panorama.pixels(), factor) <= HALF_ERROR;
    if keeps(factor) {
        return (Precision::Half, HalfRange::Factor(factor));
    }
    let brightest = (BRIGHTEST / brightest(panorama)).log2().floor().exp2();
    if keeps(brightest) {
        return (Precision::Half, HalfRange::Factor(brightest));
    }
    (Precision::Float, HalfRange::Refuse)
}

fn factor(panorama: &Panorama) -> f32 {
    let (top, mean) = (brightest(panorama), panorama.mean_log_luminance().exp());
    if top <= BRIGHTEST && mean >= DARKEST {
        return 1.0;
    }
    let wanted = if mean < DARKEST { -mean.log2() } else { f32::INFINITY };
    wanted.min((BRIGHTEST / top).log2()).floor().exp2()
}

fn brightest(panorama: &Panorama) -> f32 {
    panorama.pixels().as_flattened().iter().fold(0f32, |a, b| a.max(*b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn storage_keeps_both_ends() {
        let of = |values: [f32; 3]| storage(&Panorama::new(Equirect::new(2, 1), vec![[1.0; 3], values]));
        let half = |factor| (Precision::Half, HalfRange::Factor(factor));
        assert_eq!(of([0.5, 2.0, 50_000.0]), half(1.0));
        assert_eq!(of([0.5, 2.0, 100_000.0]), half(0.5));
        assert_eq!(of([0.5, 2.0, 1e-3]), half(1.0));
        // one dark value in six: there is headroom
        assert_eq!(of([0.5, 2.0, 1e-7]), half(16384.0));
        assert_eq!(of([0.5, 20_000.0, 1e-7]), (Precision::Float, HalfRange::Refuse));
    }
}

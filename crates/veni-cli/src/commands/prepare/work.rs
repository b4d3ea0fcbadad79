//! Examining files, several at a time, and keeping what was learnt of each as soon as it is known.

use std::sync::Mutex;

use anyhow::Result;
use rayon::prelude::*;
use veni_data::prepare::{Examined, PrepareConfig, content_hash, examine};
use veni_image::{HalfRange, Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::output::Overwrite;

use super::network::NetworkSettings;
use super::record::{Facts, Fate, Record};
use super::scan::Source;
use super::store::Store;
use crate::output::with_remedy;
use crate::progress::Bars;
use crate::report::{Report, complain};

/// Files of more bytes than this are examined one at a time: their pixels fill the memory.
const LARGE: u64 = 1 << 25;
/// The brightest value that is written without a factor, with room for rounding.
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
    let bars = Bars::new(report);
    bars.begin_after(skipped as u64, "", "file", Some(sources.len() as u64));
    let store = Mutex::new(store);
    let one = |source: &&Source| -> Result<()> {
        let fate = fate(&store, source, config, network)?;
        if let Fate::Refused(reason) = &fate {
            complain(&format!("{}: {reason}", source.path.display()));
        }
        lock(&store).add(Record::new(source, fate))?;
        bars.add(1);
        Ok(())
    };
    let (large, small): (Vec<_>, Vec<_>) = todo.into_iter().partition(|s| s.bytes > LARGE);
    small.par_iter().try_for_each(one)?;
    large.iter().try_for_each(one)?;
    bars.end();
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
        let text = error.with_source();
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
    let path = lock(store).waiting(&id);
    let options = WriteOptions {
        half_range: half_range(&examined),
        overwrite: Overwrite::Replace,
        ..WriteOptions::new(WriteFormat::Exr(Precision::Half))
    };
    examined.panorama.write(&path, &options).map_err(with_remedy)?;
    Ok(Fate::Fit(Box::new(Facts::new(id, &examined, network))))
}

/// Half precision holds values from 6e-5 to 65,504 with full precision; panoramas in other units are scaled by a power of
/// two, which the file records and readers divide out.
fn half_range(examined: &Examined) -> HalfRange {
    let brightest = |p: &Panorama| p.pixels().as_flattened().iter().fold(0f32, |a, b| a.max(*b));
    let (top, mean) = (brightest(&examined.panorama), examined.panorama.mean_log_luminance().exp());
    if top <= BRIGHTEST && mean >= DARKEST {
        return HalfRange::Refuse;
    }
    let wanted = if mean < DARKEST { -mean.log2() } else { f32::INFINITY };
    HalfRange::Factor(wanted.min((BRIGHTEST / top).log2()).floor().exp2())
}

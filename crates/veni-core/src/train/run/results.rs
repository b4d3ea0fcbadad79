//! What a run says of itself: validation, previews, the model file.

use std::borrow::Cow;
use std::ops::Range;

use super::*;
use crate::fit::{FitTarget, fit};
use crate::train::batch::Batches;
use crate::train::init::InitConfig;
use crate::train::latents::{self, LatentsConfig};
use crate::train::preview;
use crate::vae::veni::decode;
use crate::vae::{Decoder, LatentTable, Reni, Veni};
use veni_data::DataConfig;
use veni_data::Reconstruction;
use veni_data::coarsen::{averaged, coarse_grid};
use veni_image::metrics::Alignment;
use veni_light::latent::{Latent, Prior};
use veni_light::light::Lights;
use veni_light::model::{Model, ModelInfo, Training};
use veni_light::output::Overwrite;
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

/// Panoramas in a preview.
const PREVIEW_ROWS: usize = 8;
/// Most panoramas that a prior is fitted to, and as many copies: it has N(N+1)/2 numbers, and encoding a large set would
/// take longer than training on it.
const PRIOR_PANORAMAS: usize = 2048;
/// Panoramas that are encoded together for the prior; bounds the memory.
const CHUNK: usize = 64;

impl Trainer {
    /// The network that is validated and stored: averaged weights, no gradients.
    pub(super) fn averaged(&self) -> Result<Network> {
        let weights = if self.config.ema_decay > 0.0 {
            self.optimiser.averages()
        } else {
            self.optimiser.weights().clone()
        };
        Ok(weights::write(self.network().clone(), "", &weights)?.valid())
    }

    /// [`Error::Cancelled`], with nothing changed, if `stop` is raised meanwhile.
    pub(super) fn validate(
        &mut self,
        stop: &AtomicBool,
        log: &mut MetricsLog,
        progress: &dyn Progress,
    ) -> Result<()> {
        let network = self.averaged()?;
        let subset = |set: &Dataset, most: usize| match set.items().get(..most) {
            Some(first) => Dataset::new(set.grid(), first.to_vec()),
            None => set.clone(),
        };
        let val = match &self.config.latents {
            Some(latents) => subset(&self.splits.val, latents.validation_panoramas),
            None => self.splits.val.clone(),
        };
        let mean = |set: &Dataset, known: bool| -> Result<_> {
            let decode = |range| self.reconstructed(&network, set, range, known, stop);
            let scores = Reconstruction::by_parts(set, Alignment::LogFactor, decode)?.mean;
            Ok((!set.is_empty()).then_some(scores))
        };
        let train = subset(&self.splits.train, self.config.report.train_subset);
        let (val, train) = (mean(&val, false)?, mean(&train, true)?);
        let step = self.steps_done();
        // without validation panoramas the last weights are the best known
        let best = match (val, self.best) {
            (Some(now), Some(best)) => now.ldr_psnr > best.ldr_psnr,
            _ => true,
        };
        if best {
            self.store(&network, 0, step, stop, progress)?;
            self.best = val.map(|scores| BestValidation { step, ldr_psnr: scores.ldr_psnr });
        }
        let report = ValidationReport { step, val, train, best };
        log.append(&Record { step, validation: &report })?;
        progress.validation(&report);
        Ok(())
    }

    /// Log radiance decoded from the latents of panoramas `range` of a set: those that the encoder gives them, or, of an
    /// auto-decoder, their rows in its table (`known`) or fitted ones.
    fn reconstructed(
        &self,
        network: &Network,
        set: &Dataset,
        range: Range<usize>,
        known: bool,
        stop: &AtomicBool,
    ) -> Result<Vec<Vec<f32>>> {
        go_on(stop)?;
        let (grid, images) = (set.grid(), views(&set.items()[range.clone()]));
        let latents = match (network, &self.config.latents) {
            (Network::Veni(veni), _) => {
                veni.encode(grid, &images)?.into_iter().map(|e| Latent::new(e.vectors)).collect()
            }
            (Network::Reni(reni), _) if known => {
                let rows = table_rows(&reni.latents).into_iter();
                rows.skip(range.start).take(range.len()).map(|row| row.latent).collect()
            }
            (Network::Reni(reni), Some(config)) => fitted(&reni.decoder, grid, &images, config, stop)?,
            (Network::Reni(_), None) => unreachable!("checked with the configuration"),
        };
        let vectors: Vec<_> = latents.iter().map(|z| z.vectors.clone()).collect();
        let mut decoded = decode(network.decoder(), grid, &vectors);
        for (image, latent) in decoded.iter_mut().zip(&latents) {
            image.iter_mut().for_each(|v| *v += latent.log_exposure);
        }
        Ok(decoded)
    }

    /// Writes `model.safetensors`; the prior is fitted to the training panoramas and `copies` augmented copies. With
    /// an auto-decoder also `latents.safetensors`.
    fn store(
        &self,
        network: &Network,
        copies: usize,
        step: u64,
        stop: &AtomicBool,
        progress: &dyn Progress,
    ) -> Result<()> {
        let (prior, latents) = self.prior(network, copies, stop)?;
        let info = ModelInfo {
            training: Some(Training {
                data: self.describe_data(),
                panoramas: Some(self.splits.train.len().saturating_sub(self.config.data.synthetic)),
                steps: step,
                seed: self.config.seed,
                command: self.command.clone(),
                init: self.config.init.as_ref().map(InitConfig::describe),
                ..Training::default()
            }),
            prior: Some(format!("{latents} training latents")),
            ..ModelInfo::default()
        };
        let mut model = match network {
            Network::Veni(veni) => veni.to_model(&self.config.model, info)?,
            Network::Reni(reni) => reni.to_model(&self.config.model, info)?,
        };
        model.set_prior(&prior)?;
        let path = self.folder.join("model.safetensors");
        model.save(&path, self.config.report.stored.into(), Overwrite::Replace)?;
        progress.wrote(&path);
        if let Network::Reni(Reni { latents: table, .. }) = network {
            let path = self.folder.join("latents.safetensors");
            latents::save(&path, table, &self.splits.train, &model.hash())?;
            progress.wrote(&path);
        }
        Ok(())
    }

    /// The data in words: the panoramas of the run, then those of each stage that has its own.
    fn describe_data(&self) -> String {
        let described = |count: Option<usize>, data: &DataConfig| {
            let names = data.folders.iter().filter_map(|folder| folder.file_name());
            let names = names.map(|name| name.to_string_lossy().into_owned()).collect::<Vec<_>>().join(", ");
            let photographed = match count {
                Some(0) => None,
                Some(count) => Some(format!("{count} panoramas of {names}")),
                None => (!names.is_empty()).then_some(names),
            };
            let generated = (data.synthetic > 0).then(|| {
                let share =
                    data.synthetic_share.map(|share| format!(" ({:.0} % of the draws)", 100.0 * share));
                format!("{} generated scenes{}", data.synthetic, share.unwrap_or_default())
            });
            photographed.into_iter().chain(generated).collect::<Vec<_>>().join(" and ")
        };
        let data = &self.config.data;
        let own = described(Some(self.splits.train.len().saturating_sub(data.synthetic)), data);
        let stages = self.stages.iter().filter(|running| running.stage.own_data);
        let stages = stages.map(|Running { stage, .. }| {
            let name = stage.name.as_deref().unwrap_or_default();
            format!("; {name}: {}", described(None, &stage.config.data))
        });
        std::iter::once(own).chain(stages).collect()
    }

    /// The prior of the training panoramas, and the number of latents that it was fitted to.
    fn prior(&self, network: &Network, copies: usize, stop: &AtomicBool) -> Result<(Prior, usize)> {
        let Codes { codes, variances, own } = match network {
            Network::Veni(veni) => self.encoded(veni, copies, stop)?,
            Network::Reni(reni) => {
                let rows = table_rows(&reni.latents).into_iter().zip(self.splits.train.items());
                let (codes, variances): (Vec<_>, _) = rows
                    .map(|(row, item)| {
                        let log_exposure = row.latent.log_exposure + item.log_exposure;
                        (Latent { log_exposure, lights: item.lights.clone(), ..row.latent }, row.variances)
                    })
                    .unzip();
                Codes { own: codes.len(), codes, variances }
            }
        };
        let prior = match codes.len() {
            0 | 1 => Prior::standard(network.decoder().latent_vectors()),
            _ => {
                let prior = Prior::fit(&codes, (!variances.is_empty()).then_some(variances.as_slice()))?;
                if self.config.model.lights > 0 { prior.with_suns_of(&codes[..own]) } else { prior }
            }
        };
        Ok((prior, codes.len()))
    }

    /// Latents and variances of the training panoramas and `copies` augmented copies of each; of a large set of
    /// [`PRIOR_PANORAMAS`], evenly spread. Generated scenes count only where there is nothing else: a random sky must
    /// be like the photographed ones.
    fn encoded(&self, veni: &Veni, copies: usize, stop: &AtomicBool) -> Result<Codes> {
        let train = &self.splits.train;
        let batches = Batches::new(&self.config, veni.stripes()?, train);
        let photographed = train.items().iter().filter(|item| !item.generated).count();
        let from = if photographed == 0 { train.len() } else { photographed };
        let chosen = from.min(PRIOR_PANORAMAS);
        // photographs come first
        let chosen: Vec<_> = (0..chosen).map(|at| at * from / chosen).collect();
        let copies = if from > PRIOR_PANORAMAS { copies.min(1) } else { copies };
        let (mut codes, mut variances) = (Vec::new(), Vec::new());
        for copy in 0..=copies {
            for chosen in chosen.chunks(CHUNK) {
                go_on(stop)?;
                let image = |i: usize| match copy {
                    0 => Cow::Borrowed(train.items()[i].log_radiance.fetched()),
                    // slots beyond any batch: copies that no update has seen
                    _ => Cow::Owned(batches.augmented(i, u64::MAX, (copy * train.len() + i) as u64)),
                };
                let images: Vec<_> = chosen.iter().map(|i| image(*i)).collect();
                let views: Vec<_> = images.iter().map(Cow::as_ref).collect();
                for (encoded, i) in veni.encode(train.grid(), &views)?.into_iter().zip(chosen) {
                    let item = &train.items()[*i];
                    // augmentation leaves nothing that says where the sun would be
                    let lights = if copy == 0 { item.lights.clone() } else { Lights::default() };
                    let log_exposure = item.log_exposure;
                    codes.push(Latent { log_exposure, lights, ..Latent::new(encoded.vectors) });
                    variances.extend(encoded.variances);
                }
            }
        }
        Ok(Codes { codes, variances, own: chosen.len() })
    }

    pub(super) fn preview(&self, stop: &AtomicBool, progress: &dyn Progress) -> Result<()> {
        let network = self.averaged()?;
        let (prior, _) = self.prior(&network, 0, stop)?;
        let (val, train) = (self.splits.val.items(), self.splits.train.items());
        // validation panoramas first: they say more; an auto-decoder has latents of the others only
        let known = matches!(network, Network::Reni(_));
        let val = if known { &[] } else { val };
        let items: Vec<_> = val.iter().chain(train).take(PREVIEW_ROWS).cloned().collect();
        let set = Dataset::new(self.splits.train.grid(), items);
        let mut rng = stream(self.config.seed, Purpose::Preview, 0, 0);
        let samples: Vec<_> = set.items().iter().map(|_| Latent::sample(&prior, &mut rng).vectors).collect();
        let decoded = self.reconstructed(&network, &set, 0..set.len(), known, stop)?;
        let samples = decode(network.decoder(), set.grid(), &samples);
        let rows: Vec<_> = (set.items().iter().zip(decoded.into_iter().zip(samples)))
            .map(|(item, (reconstruction, sample))| vec![item.log_radiance.to_vec(), reconstruction, sample])
            .collect();
        let path = self.preview_path();
        preview::write(&path, set.grid(), &rows)?;
        progress.wrote(&path);
        Ok(())
    }

    /// The last validation and preview, then the best model again with the full prior.
    pub(super) fn finish(
        &mut self,
        stop: &AtomicBool,
        log: &mut MetricsLog,
        progress: &dyn Progress,
    ) -> Result<()> {
        self.validate(stop, log, progress)?;
        self.preview(stop, progress)?;
        if let Network::Reni(_) = self.network() {
            // its prior has no copies to wait for
            return Ok(());
        }
        let path = self.folder.join("model.safetensors");
        let model = Model::load(&path)?;
        let step = model.info().training.as_ref().map_or(self.steps_done(), |t| t.steps);
        // from here on the file is complete, and stays: the stored weights, not the last ones
        let veni = Veni::from_model(&model, &self.config.device.device()?)?;
        self.store(&Network::Veni(veni), self.config.report.prior_copies, step, stop, progress)
    }
}

/// What a prior is fitted to.
struct Codes {
    codes: Vec<Latent>,
    /// For each code the N posterior variances; may be empty.
    variances: Vec<Vec<f32>>,
    /// So many codes come first that are of the panoramas themselves, with their lights, and not of augmented copies.
    own: usize,
}

/// [`Error::Cancelled`] once `stop` is raised.
fn go_on(stop: &AtomicBool) -> Result<()> {
    if stop.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
}

fn views(items: &[veni_data::Item]) -> Vec<&[f32]> {
    items.iter().map(|item| item.log_radiance.fetched()).collect()
}

/// Latents optimised for panoramas that the table does not know, from zero.
fn fitted(
    decoder: &Decoder,
    grid: Equirect,
    images: &[&[f32]],
    config: &LatentsConfig,
    stop: &AtomicBool,
) -> Result<Vec<Latent>> {
    let (factor, n) = (config.validation_factor, decoder.latent_vectors());
    let coarse: Vec<_> = images.iter().map(|image| averaged(grid, image, factor)).collect();
    let coarse: Vec<_> = coarse.iter().map(Vec::as_slice).collect();
    let mut latents = Vec::with_capacity(images.len());
    // a few at a time: the graph of a fit holds every activation of its images
    for images in coarse.chunks(4) {
        go_on(stop)?;
        let target = FitTarget::panoramas(coarse_grid(grid, factor), images)?;
        let start = vec![Latent::new(vec![[0.0; 3]; n]); images.len()];
        latents.extend(fit(decoder, &target, &start, &config.validation)?.latents);
    }
    Ok(latents)
}

/// A panorama's row: its mean, with its scale as the log exposure, and the variance of each vector (the mean over its
/// coordinates).
struct TableRow {
    latent: Latent,
    variances: Vec<f32>,
}

fn table_rows(table: &LatentTable) -> Vec<TableRow> {
    let values = weights::read(table, "");
    let n = values["mean"].shape[1];
    let rows = values["mean"].data.chunks_exact(3 * n).zip(values["log_variance"].data.chunks_exact(3 * n));
    rows.enumerate()
        .map(|(i, (mean, log_variance))| {
            let latent = Latent::new(mean.as_chunks().0.to_vec());
            let log_exposure = values.get("scale").map_or(0.0, |scale| scale.data[i]);
            let variance = |l: &[f32; 3]| l.iter().map(|l| l.exp()).sum::<f32>() / 3.0;
            TableRow {
                latent: Latent { log_exposure, ..latent },
                variances: log_variance.as_chunks().0.iter().map(variance).collect(),
            }
        })
        .collect()
}

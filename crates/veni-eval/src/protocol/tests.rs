//! Protocols on tiny models and synthetic skies.

use std::path::PathBuf;
use std::sync::Mutex;

use burn::tensor::Device;

use super::*;
use crate::canonical::Canonical;
use crate::table::Cell;
use veni_core::train::presets::Preset;
use veni_core::vae::Veni;
use veni_data::{Dataset, Item};
use veni_image::metrics::{Alignment, log_error, scores, spearman, weighted_log_error};
use veni_light::model::{DecoderConfig, Model, ModelConfig, ModelInfo, ModelKind};
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

mod numbers;
mod unseen;

const GRID: Equirect = Equirect { width: 32, height: 16 };

fn model(seed: u64) -> Model {
    model_of(3, seed)
}

fn model_of(latent_vectors: usize, seed: u64) -> Model {
    let config = Preset::Tiny.config(latent_vectors).model;
    let veni = Veni::new(&config, &mut stream(seed, Purpose::Weights, 0, 0), &Device::flex()).unwrap();
    veni.to_model(&config, ModelInfo::default()).unwrap()
}

fn subject(name: &str, seed: u64) -> LoadedModel {
    LoadedModel::new(name, model(seed), &Device::flex()).unwrap()
}

/// Skies with a sun each, at exposures of their own.
fn skies(count: usize) -> Dataset {
    let item = |k: usize| {
        let sun = [(k as f32).cos(), (k as f32).sin(), 0.5];
        let sky = veni_image::Panorama::from_fn(GRID, |d| {
            let toward = d.iter().zip(sun).map(|(a, b)| a * b).sum::<f32>();
            let base = if d[2] > 0.0 { [0.4, 0.6, 1.0] } else { [0.12, 0.1, 0.08] };
            base.map(|v| (v + 5.0 * (6.0 * (toward - 1.0)).exp()) * (1.0 + k as f32))
        });
        Item::new(&PathBuf::from(format!("sky-{k}.exr")), &sky, GRID)
    };
    Dataset::new(GRID, (0..count).map(item).collect())
}

/// Remembers what began: (task, kept, total).
#[derive(Default)]
struct Log(Mutex<Vec<(String, usize, usize)>>, Mutex<usize>);

impl Observer for Log {
    fn begin(&self, _: &'static str, task: &str, done: usize, total: usize) {
        self.0.lock().unwrap().push((task.to_owned(), done, total));
    }

    fn advance(&self, units: usize) {
        *self.1.lock().unwrap() += units;
    }
}

/// Runs `protocol` in `folder`, and says how many units were computed.
fn evaluated<T>(
    folder: &Path,
    subjects: &[LoadedModel],
    data: &Dataset,
    settings: Settings,
    protocol: impl Fn(&Evaluation<'_>) -> T,
) -> (T, usize) {
    let (log, store, figures) = (Log::default(), ResultStore::new(folder), folder.join("figures"));
    let (subjects, observer) = (subjects, &log);
    let run = Evaluation {
        lobes: &[],
        subjects,
        others: &[&Exact],
        data,
        train: None,
        lpips: None,
        settings,
        store: &store,
        figures: &figures,
        observer,
    };
    let result = protocol(&run);
    let computed = *log.1.lock().unwrap();
    let announced: usize = log.0.lock().unwrap().iter().map(|(_, done, total)| total - done).sum();
    assert_eq!(computed, announced, "all that was announced was done, and no more");
    (result, computed)
}

fn quick() -> Settings {
    Settings { quick: true, pairs: Some(120), frames: 4, ..Settings::default() }
}

/// A codec that loses nothing.
struct Exact;

impl Codec for Exact {
    fn system(&self) -> &str {
        "exact"
    }
    fn pass(&self) -> &str {
        "copy"
    }
    fn dimension(&self) -> usize {
        3 * GRID.len()
    }
    fn key(&self) -> Canonical {
        Canonical::of("exact")
    }
    fn encode(&self, _: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        Ok(image.to_vec())
    }
    fn decode(&self, _: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        Ok(code.to_vec())
    }
}

fn number(table: &Table, row: &str, column: &str) -> f64 {
    table.cell(row, column).and_then(Cell::number).unwrap_or_else(|| panic!("{row}, {column} in {table:?}"))
}

#[test]
fn reconstruction_goes_on_where_it_was() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(5), [subject("tiny", 1)]);
    let run = || evaluated(folder.path(), &subjects, &data, quick(), |run| reconstruction::run(run).unwrap());
    let (first, computed) = run();
    assert_eq!(computed, 15, "five panoramas in three codecs");
    let (again, computed) = run();
    assert_eq!((computed, &again.tables), (0, &first.tables));
    let kept: Vec<_> = std::fs::read_dir(folder.path().join("results/reconstruction")).unwrap().collect();
    assert_eq!(kept.len(), 15);
    let one = kept.iter().map(|e| e.as_ref().unwrap().path());
    let one = one.filter(|p| p.to_string_lossy().contains("sky-3-tiny-optimised")).collect::<Vec<_>>();
    std::fs::remove_file(&one[0]).unwrap();
    let (again, computed) = run();
    assert_eq!((one.len(), computed, &again.details), (1, 1, &first.details));
    assert!(first.figures.iter().all(|f| image::open(f).is_ok()) && first.figures.len() == 3);

    // another model of the same name shares nothing
    let other = [subject("tiny", 2)];
    let (second, computed) =
        evaluated(folder.path(), &other, &data, quick(), |run| reconstruction::run(run).unwrap());
    assert_eq!(computed, 10);
    assert_ne!(second.tables, first.tables);
}

#[test]
fn reconstruction_scores_what_it_should() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(4), [subject("tiny", 1)]);
    let (report, _) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| reconstruction::run(run).unwrap());
    let [means] = &report.tables[..] else { panic!("one table") };
    assert_eq!(means.rows.len(), 3);
    assert_eq!(number(means, "exact", "LDR PSNR (ref.)"), f64::INFINITY);
    assert_eq!(number(means, "exact", "SSIM (exp.)"), 1.0);
    let column = |title: &str| means.columns.iter().position(|c| c.title == title).unwrap();
    let value = |row: usize, title: &str| means.rows[row][column(title)].number().unwrap();
    assert!(value(0, "LDR PSNR (exp.)").is_finite() && value(1, "HDR PSNR (exp.)").is_finite());
    // what is optimised is the log error
    let fit = FitSettings::thorough(GRID, true);
    for item in data.items() {
        let (subject, image) = (&subjects[0], item.log_radiance.as_slice());
        let start = subject.encode(GRID, &[image]).unwrap();
        let fitted = fit.fit(subject, GRID, &[image], &start).unwrap().latents;
        let [before, after] = [start, fitted].map(|latents| {
            weighted_log_error(&subject.decode(GRID, &latents).unwrap()[0], image, GRID.height)
        });
        assert!(after < before, "{before} became {after}");
    }
    let lpips = means.cell("tiny", "LPIPS (ref.)").unwrap();
    assert_eq!(*lpips, Cell::missing("no weights"));
    // means are means
    let each = &report.details[0];
    let rows = each.rows.iter().filter(|r| r[1] == Cell::text("tiny, autoencoder"));
    let at = each.columns.iter().position(|c| c.title == "SSIM (exp.)").unwrap();
    let mean = rows.map(|r| r[at].number().unwrap()).sum::<f64>() / 4.0;
    assert!((mean - value(0, "SSIM (exp.)")).abs() < 1e-12);
}

#[test]
fn decoders_alone_take_part_without_an_encoder() {
    let (folder, data) = (tempfile::tempdir().unwrap(), skies(3));
    let alone = LoadedModel::new("alone", model(1).without_encoder(), &Device::flex()).unwrap();
    let both = [subject("whole", 1), alone];
    assert_ne!(both[0].identity(), both[1].identity());
    let (report, _) =
        evaluated(folder.path(), &both, &data, quick(), |run| reconstruction::run(run).unwrap());
    let passes: Vec<_> = report.tables[0].rows.iter().map(|r| (r[0].clone(), r[1].clone())).collect();
    let text = Cell::text;
    assert_eq!(passes[2], (text("alone"), text("optimised")));
    assert_eq!(passes.len(), 4);
    let (report, _) = evaluated(folder.path(), &both, &data, quick(), |run| equivariance::run(run).unwrap());
    let table = &report.tables[0];
    assert!(number(table, "encoder, one stripe, worst", "whole") < 1e-4);
    assert!(number(table, "encoder, half a stripe, mean", "whole") > 1e-3);
    assert_eq!(table.cell("encoder, one stripe, worst", "alone"), Some(&Cell::missing("no encoder")));
    for name in ["whole", "alone"] {
        assert!(number(table, "decoder, rotated", name) < 1e-4, "{table:?}");
        assert!(number(table, "decoder, mirrored", name) < 1e-4);
    }
    assert!(number(table, "whole model, five stripes", "whole") < 1e-4);
    let (report, _) = evaluated(folder.path(), &both, &data, quick(), |run| interpolation::run(run).unwrap());
    let largest = number(&report.tables[0], "alone", "largest step / mean");
    assert!((1.0..3.0).contains(&largest) && report.details[0].rows.len() == 4);
}

#[test]
fn uniqueness_depends_on_its_seed_and_on_nothing_else() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(2), [subject("tiny", 1)]);
    let run = |data: &Dataset, seed| {
        let settings = Settings { seed, ..quick() };
        evaluated(folder.path(), &subjects, data, settings, |run| uniqueness::run(run).unwrap())
    };
    let (first, computed) = run(&data, 0);
    assert_eq!(computed, 2);
    // a panorama more: the others keep their starts
    assert_eq!(run(&skies(3), 0).1, 1);
    let (other, computed) = run(&data, 1);
    assert_eq!(computed, 2);
    assert_ne!(first.tables[0].rows, other.tables[0].rows);
    let table = &first.tables[0];
    let (mse, fits) =
        (number(table, "tiny", "MSE first to midpoint"), number(table, "tiny", "MSE of the fits"));
    assert!(mse >= 0.0 && fits > 0.0 && number(table, "tiny", "latent distance (RMS)") > 0.0);
}

#[test]
fn consistency_is_the_rank_correlation_of_its_definition() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(1), [subject("tiny", 1)]);
    let (report, blocks) =
        evaluated(folder.path(), &subjects, &data, quick(), |run| consistency::run(run).unwrap());
    assert_eq!(blocks, 3, "120 pairs in blocks of 50");
    let (mut latents, mut images) = (Vec::new(), Vec::new());
    for pair in 0..120 {
        let draw = |slot| {
            let mut rng = stream(0, Purpose::Evaluation, pair, slot);
            let vector = |_| [0; 3].map(|_| rng.normal() as f32);
            (0..3).map(vector).collect::<Vec<_>>()
        };
        let [a, b] = [draw(0), draw(1)];
        let decoded = veni_core::vae::veni::decode(subjects[0].network(), GRID, &[a.clone(), b.clone()]);
        latents.push(log_error(a.as_flattened(), b.as_flattened()));
        images.push(log_error(&decoded[0], &decoded[1]));
    }
    let expected = spearman(&latents, &images).unwrap();
    let ours = number(&report.tables[0], "tiny", "Spearman, N(0, 1)");
    assert!((ours - expected).abs() < 1e-3, "{ours} instead of {expected}");
    assert_eq!(report.tables[0].cell("tiny", "own prior"), Some(&Cell::missing("no prior")));
}

#[test]
fn training_set_sizes_come_from_the_files() {
    let (folder, data) = (tempfile::tempdir().unwrap(), skies(2));
    let sized = |name: &str, seed, said: &str| {
        let mut model = model(seed);
        let training = veni_light::model::Training { data: said.to_owned(), ..Default::default() };
        model.set_info(ModelInfo { training: Some(training), ..ModelInfo::default() });
        LoadedModel::new(name, model, &Device::flex()).unwrap()
    };
    let both = [sized("large", 2, "76 panoramas of hdri"), sized("small", 1, "8 panoramas of hdri")];
    let (report, _) = evaluated(folder.path(), &both, &data, quick(), |run| dataset_size::run(run).unwrap());
    let sizes: Vec<_> = report.tables[0].rows.iter().map(|r| r[1].number().unwrap()).collect();
    assert_eq!(sizes, [8.0, 8.0, 76.0, 76.0]);
    let silent = [sized("odd", 1, "some skies")];
    let (error, _) =
        evaluated(folder.path(), &silent, &data, quick(), |run| dataset_size::run(run).unwrap_err());
    assert!(error.to_string().contains("odd"), "{error}");
}

#[test]
fn the_paper_is_all_of_it() {
    let (folder, data) = (tempfile::tempdir().unwrap(), skies(2));
    let both = [subject("one", 1), subject("two", 2)];
    let published = Published::default();
    let (report, computed) =
        evaluated(folder.path(), &both, &data, quick(), |run| paper::run(run, &published).unwrap());
    assert!(computed > 0);
    let names: Vec<_> = report.tables.iter().map(|t| t.name.as_str()).collect();
    let expected = [
        "reconstruction",
        "uniqueness",
        "consistency",
        "interpolation",
        "equivariance",
        "ablations",
        "inverse-rendering",
    ];
    assert_eq!(names, expected);
    let cell = report.tables[0].cell("two", "LDR PSNR (ref.), published");
    assert_eq!(cell, Some(&Cell::missing("not available")));
    let ablation = &report.tables[5];
    assert_eq!(
        ablation.cell("one", "LDR PSNR, autoencoder (ref.)").and_then(Cell::number),
        report.tables[0].cell("one", "LDR PSNR (ref.)").and_then(Cell::number)
    );
    assert!(report.tables[0].notes.iter().any(|n| n.contains("No table of training set sizes")));
}

#[test]
fn the_article_stands_beside_models_of_its_sizes() {
    let sized = |n| LoadedModel::new(format!("N{n}"), model_of(n, 1), &Device::flex()).unwrap();
    let known: Published =
        serde_json::from_str(r#"{"reconstruction": {"N9, optimised": {"LDR PSNR (ref.)": 20.5}}}"#).unwrap();
    let expected: Published = serde_json::from_str(
        r#"{"reconstruction": {"N9, optimised": {"LDR PSNR (ref.)": 20.5}, "N9, autoencoder": {"LDR PSNR (ref.)": 18.78}}}"#,
    )
    .unwrap();
    assert_eq!(known.with_article(&[sized(9), sized(3)]), expected);
}

#[test]
fn identities_see_the_encoder_too() {
    let base = subject("a", 1);
    assert_eq!(base.identity(), subject("b", 1).identity());
    assert_ne!(base.identity(), subject("a", 2).identity());
    assert_eq!(
        base.parameters()[0],
        model(1)
            .tensors()
            .iter()
            .filter(|(n, _)| n.starts_with("encoder."))
            .map(|(_, t)| t.data.len())
            .sum::<usize>()
    );
    let config = ModelConfig {
        kind: ModelKind::Reni,
        decoder: DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() },
        ..ModelConfig::decode_only(3)
    };
    let reni = LoadedModel::new("reni", Model::filler(&config, 3).unwrap(), &Device::flex()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (report, _) =
        evaluated(folder.path(), &[reni], &skies(1), quick(), |run| uniqueness::run(run).unwrap());
    assert!(report.tables[0].rows[0][2].number().unwrap().is_finite());
}

#[test]
fn the_light_on_a_ball_is_found_from_the_picture_alone() {
    let (folder, subjects) = (tempfile::tempdir().unwrap(), [subject("tiny", 1)]);
    // skies of the model itself: an untrained decoder has few others
    let sky = |seed| {
        let latent = veni_light::latent::Latent::from_seed(&subjects[0].prior(), seed);
        let image = subjects[0].decode(GRID, &[latent]).unwrap().concat();
        let sky = veni_image::Panorama::from_log(GRID, image.as_chunks().0);
        Item::new(&PathBuf::from(format!("own-{seed}.exr")), &sky, GRID)
    };
    let data = Dataset::new(GRID, vec![sky(1), sky(2)]);
    let run =
        || evaluated(folder.path(), &subjects, &data, quick(), |run| inverse_rendering::run(run).unwrap());
    let (first, computed) = run();
    assert_eq!(computed, 6, "two panoramas at three K_s");
    let (again, computed) = run();
    assert_eq!((computed, &again.tables), (0, &first.tables));
    let rows = first.tables[0].rows.len();
    assert_eq!((rows, first.details[0].rows.len()), (3, 6));
    let elsewhere = tempfile::tempdir().unwrap();
    let (foreign, _) = evaluated(elsewhere.path(), &subjects, &skies(2), quick(), |run| {
        inverse_rendering::run(run).unwrap()
    });
    let loss = |report: &Report| -> f64 {
        let table = &report.tables[0];
        let at = table.columns.iter().position(|c| c.title == "loss of the picture").unwrap();
        table.rows.iter().map(|row| row[at].number().unwrap()).sum()
    };
    assert!(loss(&first) < 0.5 * loss(&foreign), "{} {}", loss(&first), loss(&foreign));
    assert_eq!(first.figures.len(), 2);
}

/// Steps so wide that they make things worse: the optimised latent is judged as the fit leaves it.
#[test]
fn the_optimised_pass_is_what_the_fit_ends_with() {
    let (subject, data) = (subject("a", 1), skies(6));
    let mut settings = FitSettings::thorough(GRID, true);
    settings.config.steps = 3;
    settings.config.learning_rate = veni_core::train::schedule::LearningRate::Constant { rate: 2.0 };
    let (first, second) = (Autoencoder::new(&subject).unwrap(), Optimised::new(&subject, settings));
    let mut below = 0;
    for item in data.items() {
        let image = &item.log_radiance;
        let start = subject.encode(GRID, &[image]).unwrap();
        let fitted = settings.fit(&subject, GRID, &[image], &start).unwrap().latents;
        let codes = [&first as &dyn Codec, &second].map(|codec| codec.encode(GRID, image).unwrap());
        assert_eq!(codes[1], fitted[0].vectors.concat());
        let [before, after] = codes.map(|code| {
            let decoded = first.decode(GRID, &code).unwrap();
            scores(&decoded, image, GRID.height, GRID.width, Alignment::Exposure).ldr_psnr
        });
        below += usize::from(after < before);
    }
    assert!(below > 0, "steps of 2 cost no panorama its score: nothing was tried");
}

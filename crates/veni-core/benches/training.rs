//! One training step: encode, sample, decode, losses, backward, clip, Adam. On the sample panoramas.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use std::path::PathBuf;

use criterion::{Criterion, criterion_group, criterion_main};
use veni_core::train::batch::Batches;
use veni_core::train::loss::Loss;
use veni_core::train::optimiser::{Group, Optimiser};
use veni_core::train::presets::Preset;
use veni_core::train::step::batch_loss;
use veni_core::vae::Veni;
use veni_data::Splits;
use veni_light::random::{Purpose, stream};

/// As the command line: glibc gives large blocks back to the system and fetches them page by page.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn training_step(criterion: &mut Criterion) {
    let mut bench = criterion.benchmark_group("training step");
    bench.sample_size(10);
    for (name, preset, n) in [
        ("small, N = 9", Preset::Small, 9),
        ("paper, N = 9", Preset::Paper, 9),
        ("paper, N = 100", Preset::Paper, 100),
    ] {
        let mut config = preset.config(n);
        config.data.folders =
            vec![PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/panoramas"))];
        let splits = Splits::open(&config.data, config.seed).expect("the sample panoramas");
        let device = config.device.device().expect("the flex device").autodiff();
        let weights = &mut stream(0, Purpose::Weights, 0, 0);
        let mut veni = Some(Veni::new(&config.model, weights, &device).expect("a valid size"));
        let groups = config.groups().into_iter();
        let groups = groups.map(|(prefix, group)| Group { prefix: prefix.into(), adam: group.adam });
        let model = veni.as_ref().expect("just made");
        let mut optimiser =
            Optimiser::new(model, groups.collect(), config.ema_decay).expect("groups of this model");
        let batches = Batches::new(&config, model.stripes().expect("a valid size"), &splits.train);
        let [height, width] =
            [config.data.height, config.data.width].map(|side| side / config.loss_grid.factor());
        let loss = Loss::new(&config.loss, height, width, &device);
        let batch = batches.prepare(1);
        bench.bench_function(format!("{name}, batch {}", config.batch), |b| {
            b.iter(|| {
                let model = veni.take().expect("put back below");
                let gradients = batch_loss(&model, &batch, &loss, &device).terms.total().backward();
                veni = Some(optimiser.step(model, &gradients, &[1e-4, 1e-4]).0);
            });
        });
    }
    bench.finish();
}

criterion_group!(benches, training_step);
criterion_main!(benches);

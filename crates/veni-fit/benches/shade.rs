//! One evaluation of a rendered image, loss and gradient, as a fit does it hundreds of times:
//! `cargo bench -p veni-fit --bench shade`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use veni_fit::shade::{
    Camera, Colour, DistantLights, Material, REFERENCE_FIELD_OF_VIEW, RenderedImage, RenderingLoss,
    ShadingForm, Surface, Transfer,
};
use veni_light::sphere::Equirect;

#[allow(clippy::unwrap_used, reason = "a bench has no caller to report to")]
fn shade(c: &mut Criterion) {
    let ball = ([0.0; 3], 1.0);
    let camera = Camera::framing(ball, [0.0; 2], REFERENCE_FIELD_OF_VIEW, [64, 64], 0.04).unwrap();
    let surface = Surface::sphere(&camera, ball, 64, 64).unwrap();
    let grey = Colour::Uniform([0.9; 3]);
    let coloured = Colour::Uniform([0.9, 0.7, 0.5]);
    let materials = [
        ("Lambert", Material::lambert(grey.clone())),
        ("grey Blinn-Phong", Material::blinn_phong(grey, 0.3, 500.0)),
        ("coloured Blinn-Phong", Material::blinn_phong(coloured, 0.3, 500.0)),
    ];
    for grid in [Equirect::new(64, 32), Equirect::new(128, 64)] {
        let mut group = c.benchmark_group(format!("64x64 sphere, {}x{} lights", grid.width, grid.height));
        group.sample_size(20);
        let light: Vec<_> = grid.directions().iter().map(|d| d.map(|v| 0.5 * v)).collect();
        for (name, material) in &materials {
            for (kept, memory) in [("stored", veni_fit::shade::DEFAULT_MEMORY), ("on the fly", 0)] {
                let lights = DistantLights::equirect(grid);
                let transfer =
                    Transfer::with_memory(&surface, material, lights, ShadingForm::Physical, memory).unwrap();
                let target = transfer.render(&vec![[1.0; 3]; grid.len()]);
                let image = RenderedImage::new(transfer, &target, RenderingLoss::default()).unwrap();
                group.bench_function(format!("{name}, {kept}"), |b| {
                    b.iter(|| image.evaluate(black_box(&light), 0.1));
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, shade);
criterion_main!(benches);

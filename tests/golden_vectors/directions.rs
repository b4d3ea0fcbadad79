//! Directions and sampling: the reference's frames, samplers and lookup.

use crate::{
    Outcome,
    case::{Case, Data},
};
use burn::tensor::Device;
use veni::sphere::{Equirect, reference};

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    match case.module() {
        "samplers" => Some(samplers(case)),
        "equirectangular ray directions, z-up world" => Some(decoder_directions(case)),
        "equirectangular_sampling" => Some(lookup(case, equirectangular)),
        "grid_sample" => Some(lookup(case, grid_sample)),
        _ => None,
    }
}

/// The outputs whose name starts with `prefix`, with the numbers that follow it (`line_64_32` → [64, 32]).
fn outputs<'a>(case: &'a Case, prefix: &'a str) -> impl Iterator<Item = (&'a str, Vec<usize>)> {
    case.tensors.keys().filter_map(move |name| {
        let sizes = name.strip_prefix("out.")?.strip_prefix(prefix)?;
        Some((name.as_str(), sizes.split(['_', 'x']).map(|n| n.parse().ok()).collect::<Option<_>>()?))
    })
}

fn flat<const N: usize>(case: &Case, name: &str, ours: &[[f32; N]]) {
    let shape = case.data(name).shape.clone();
    assert_eq!(shape.iter().product::<usize>(), ours.len() * N, "{name} has shape {shape:?}");
    case.compare(name, &Data::new(shape, ours.as_flattened().to_vec()));
}

fn samplers(case: &Case) -> Outcome {
    for (name, sizes) in outputs(case, "line_") {
        flat(case, name, &reference::line_directions(sizes[0], sizes[1]));
    }
    for (name, sizes) in outputs(case, "line_uv_") {
        let lines = reference::line_directions(sizes[0], sizes[1]);
        flat(case, name, &lines.into_iter().map(reference::image_uv).collect::<Vec<_>>());
    }
    for (name, sizes) in outputs(case, "sunflower_disk_") {
        flat(case, name, &reference::fibonacci_disk(sizes[0]));
    }
    for (name, sizes) in outputs(case, "sunflower_3d_") {
        flat(case, name, &reference::fibonacci_sphere(sizes[0]));
    }
    for (name, sizes) in outputs(case, "double_sunflower_") {
        let fov = case.number("fov_double_sunflower").expect("the field of view of the patches");
        flat(case, name, &reference::double_fibonacci(sizes[0], sizes[1], fov));
    }
    let rotation = "out.R_pitch_axis0_yaw_axis2";
    if case.expects(rotation) {
        let angles = case.data("in.pitch").values.iter().zip(&case.data("in.yaw").values);
        let rows: Vec<_> = angles.flat_map(|(&pitch, &yaw)| reference::pitch_yaw(pitch, yaw)).collect();
        flat(case, rotation, &rows);
    }
    Outcome::Compared
}

fn decoder_directions(case: &Case) -> Outcome {
    for (name, sizes) in outputs(case, "decoder_dirs_") {
        flat(case, name, &reference::decoder_directions(Equirect::new(sizes[1], sizes[0])));
    }
    Outcome::Compared
}

/// Both lookups know one mode only; any other is reported.
fn lookup(case: &Case, compute: fn(&Case, &[[f32; 3]], Equirect)) -> Outcome {
    let corners = case.config.get("align_corners").and_then(serde_json::Value::as_bool);
    let options = (case.text("mode"), case.text("padding"), corners);
    if options != (Some("bilinear"), Some("reflection"), Some(false)) {
        return Outcome::Skipped(format!("no lookup with {options:?}"));
    }
    let image = case.data("in.image");
    let [height, width, 3] = image.shape[..] else { panic!("an image of shape {:?}", image.shape) };
    compute(case, triples(image), Equirect::new(width, height));
    Outcome::Compared
}

fn triples(data: &Data) -> &[[f32; 3]] {
    data.values.as_chunks::<3>().0
}

fn equirectangular(case: &Case, image: &[[f32; 3]], grid: Equirect) {
    let seen = |directions: &[[f32; 3]]| -> Vec<[f32; 3]> {
        directions.iter().map(|&e| reference::grid_sample(image, grid, reference::image_uv(e))).collect()
    };
    flat(case, "out.colors", &seen(triples(case.data("in.directions"))));
    for (name, sizes) in outputs(case, "line_colors_") {
        flat(case, name, &seen(&reference::line_directions(sizes[0], sizes[1])));
    }
}

fn grid_sample(case: &Case, image: &[[f32; 3]], grid: Equirect) {
    let places = case.data("in.uv").values.as_chunks::<2>().0;
    let seen: Vec<_> = places.iter().map(|&uv| reference::grid_sample(image, grid, uv)).collect();
    flat(case, "out.colors", &seen);
}

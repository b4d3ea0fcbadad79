//! Whole encoders, through the crate's own entry points.
//!
//! The reference implementation's `mirror`: "early" negates the x of the directions, "late" negates the x of what comes
//! out, once in training and (by a bug of theirs) twice, that is not at all, in evaluation.

use std::collections::BTreeMap;

use veni_light::model::{Array, DecoderConfig, Model, ModelConfig, ModelInfo, decoder_schema};

use super::case::{Case, Data};
use super::official::{Official, line_directions};
use super::{Skipped, names, run, tensors};
use crate::{Encoded, Encoder};

/// A model of the case's encoder beside a small decoder of zeros.
fn model(case: &Case, official: &Official) -> Model {
    let Official { config, latent_vectors, bindings, .. } = official;
    let decoder = DecoderConfig { hidden: 8, layers: 1, heads: 1, ..DecoderConfig::default() };
    let config =
        ModelConfig { decoder, encoder: Some(config.clone()), ..ModelConfig::decode_only(*latent_vectors) };
    let zeros = |shape: Vec<usize>| Array { data: vec![0.0; shape.iter().product()], shape };
    let mut all: BTreeMap<_, _> =
        decoder_schema(&config).into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
    let shapes: BTreeMap<_, _> =
        crate::encoder::encoder_schema(&config).expect("a valid configuration").into_iter().collect();
    let weights = tensors(case, bindings, "encoder");
    assert!(weights.keys().eq(shapes.keys()), "names: {:?} {:?}", weights.keys(), shapes.keys());
    all.extend(weights.into_iter().map(|(name, w)| {
        let shape = shapes[&name].clone();
        (name, Array { shape, data: w.data })
    }));
    Model::new(config, all, ModelInfo::default()).unwrap_or_else(|e| panic!("{}: {e}", case.name))
}

/// `[.., T, P, 3]`, or `[.., T, 3]` without patches, as images of samples.
fn images(data: &Data, patches: bool) -> Vec<Vec<[f32; 3]>> {
    let axes = if patches { 3 } else { 2 };
    let each: usize = data.shape[data.shape.len() - axes..].iter().product();
    data.values.chunks_exact(each).map(|image| image.as_chunks().0.to_vec()).collect()
}

fn mirrored(vectors: &[[f32; 3]]) -> Vec<[f32; 3]> {
    vectors.iter().map(|[x, y, z]| [-x, *y, *z]).collect()
}

/// Encodes images with directions of their own, or one set for all.
fn encode(encoder: &Encoder, directions: &[Vec<[f32; 3]>], images: &[Vec<[f32; 3]>]) -> Vec<Encoded> {
    let one = |(i, image): (usize, &Vec<[f32; 3]>)| {
        let encoded = encoder.forward(&directions[i % directions.len()], &[image]);
        encoded.unwrap_or_else(|e| panic!("{e}")).remove(0)
    };
    images.iter().enumerate().map(one).collect()
}

fn means(encoded: &[Encoded]) -> Data {
    let values: Vec<f32> = encoded.iter().flat_map(|e| e.vectors.as_flattened()).copied().collect();
    Data::new([values.len()], values)
}

fn log_variances(encoded: &[Encoded]) -> Data {
    let of = |e: &Encoded| e.log_variances.clone().expect("a log variance");
    let values: Vec<f32> = encoded.iter().flat_map(of).collect();
    Data::new([values.len()], values)
}

pub(super) fn compute(case: &Case) -> Result<(), Skipped> {
    if case.module() != "VENIEncoder" || !case.expects("out.mu") {
        return Err("no encoder");
    }
    if case.config.get("invariant_axes").is_some_and(|axes| *axes != serde_json::json!([2])) {
        return Err("invariant_axes other than z");
    }
    let official = Official::new(case, &case.config, "");
    let encoder = |case: &Case| Encoder::new(&model(case, &official)).unwrap_or_else(|e| panic!("{e}"));
    let seen = |directions: Vec<Vec<[f32; 3]>>| match official.mirror.as_str() {
        "early" => directions.iter().map(|d| mirrored(d)).collect(),
        _ => directions,
    };
    let patches = official.config.samples.is_some();
    let colours = case.data("in.colors");
    if case.expects("in.clean_directions") {
        let mut rewritten = case.clone_without_results();
        for (name, data) in case.tensors.iter().filter(|(name, _)| name.starts_with("clean.")) {
            rewritten.tensors.insert(name.replacen("clean.", "param.", 1), data.clone());
        }
        let directions = |name: &str| images(case.data(name), true);
        for (encoder, directions) in [
            (encoder(case), seen(directions("in.official_directions"))),
            (encoder(&rewritten), directions("in.clean_directions")),
        ] {
            let encoded = encode(&encoder, &directions, &images(colours, true));
            case.compare("out.mu", &means(&encoded));
            case.compare("out.logvar", &log_variances(&encoded));
        }
        return Ok(());
    }
    let directions = match case.get("in.directions") {
        Some(directions) => images(directions, patches),
        None => {
            let [.., stripes, samples, _] = colours.shape[..] else { panic!("{:?}", colours.shape) };
            images(&line_directions(stripes, samples), true)
        }
    };
    let encoded = encode(&encoder(case), &seen(directions), &images(colours, patches));
    let mean = means(&encoded);
    for name in ["out.mu", "out.eval_latent"].into_iter().filter(|name| case.expects(name)) {
        case.compare(name, &mean);
    }
    if case.expects("out.logvar") {
        case.compare("out.logvar", &log_variances(&encoded));
    }
    let once = |values: Vec<f32>| match official.mirror.as_str() {
        "late" => mirrored(values.as_chunks().0).into_flattened(),
        _ => values,
    };
    if case.expects("out.train_mu") {
        case.compare("out.train_mu", &Data::new([mean.values.len()], once(mean.values.clone())));
    }
    if let (Some(noise), true) = (case.get("in.eps"), case.expects("out.train_latent")) {
        let variances = official.config.variational.then(|| log_variances(&encoded));
        let sample = mean.values.iter().zip(&noise.values).enumerate().map(|(i, (mean, noise))| {
            mean + variances.as_ref().map_or(0.0, |l| (l.values[i / 3] / 2.0).exp() * noise)
        });
        let sample = once(sample.collect());
        case.compare("out.train_latent", &Data::new([sample.len()], sample));
    }
    Ok(())
}

#[test]
fn encoders_of_the_reference() {
    let (passed, skipped) = run(&names(&["c03_", "c04_import_convention"]), compute);
    assert_eq!(passed.len(), 13, "{passed:#?} skipped: {skipped:#?}");
    assert!(skipped.is_empty(), "{skipped:#?}");
}

//! The latent that a file or a seed names, and the model that it belongs to.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use veni_light::Error;
use veni_light::field::{Decoder, MAX_COORDINATE};
use veni_light::latent::{Latent, Prior};
use veni_light::model::Model;
use veni_light::random::Stream;
use veni_light::skies::SkyRequest;
use veni_light::text::begins_object;

use super::model::{Loaded, model, name_of};
use super::remembered::is_of_its_pixels;
use crate::args::{Layer, ModelArgs};
use crate::asked::request_in_words;
use crate::output::{CUBE_FACES, LATENT, with_remedy};
use crate::report::Report;

/// Largest exposure of a latent either way: radiance times e to this power is a number with all its bits.
const MAX_EXPOSURE: f32 = 87.0;
/// How the images that are read begin: OpenEXR, Radiance, PNG, JPEG, WebP. No text begins so but the second, which is no JSON.
const IMAGES: [&[u8]; 5] = [b"\x76\x2f\x31\x01", b"#?", b"\x89PNG", b"\xff\xd8\xff", b"RIFF"];

/// The model of `--model`; where none is named, the one inside the program that the first latent in `files` belongs to.
pub(crate) fn model_of<'a>(args: &ModelArgs, files: impl IntoIterator<Item = &'a Path>) -> Result<Loaded> {
    if args.model.is_none() {
        // what cannot be read is reported when it is its turn
        for path in files {
            let Some(loaded) = stored(path).ok().flatten().and_then(|latent| inside(&latent)) else {
                continue;
            };
            // an edited image is encoded, by the present model if its own has no encoder
            if loaded.model.has_encoder() || !was_edited(path, &loaded.model).unwrap_or(false) {
                return Ok(loaded);
            }
        }
    }
    model(args)
}

/// Whether the image `path` has a latent of `model` inside that its pixels no longer come from.
fn was_edited(path: &Path, model: &Model) -> Result<bool> {
    match stored(path)? {
        Some(latent) if !is_latent(path)? => Ok(!is_of_its_pixels(path, &latent, model)?),
        _ => Ok(false),
    }
}

/// The latents that seeds name: drawn from the model's prior, as asked.
pub(crate) struct RandomSkies {
    prior: Prior,
    request: SkyRequest,
    /// Where something is asked.
    decoder: Option<Decoder>,
    model: String,
}

impl RandomSkies {
    pub(crate) fn new(loaded: &Loaded, request: SkyRequest) -> Result<Self> {
        let model = &loaded.model;
        let decoder = if request.is_empty() { None } else { Some(model.decoder()?) };
        Ok(Self { prior: model.prior(), request, decoder, model: model.hash() })
    }

    /// With nothing asked.
    pub(crate) fn any(loaded: &Loaded, report: Report) -> Self {
        loaded.note_random(report);
        let model = &loaded.model;
        Self { prior: model.prior(), request: SkyRequest::default(), decoder: None, model: model.hash() }
    }

    /// What is asked of every sky.
    pub(crate) fn request(&self) -> &SkyRequest {
        &self.request
    }

    /// The sky of a seed.
    pub(crate) fn sky(&self, seed: u64) -> Result<Latent> {
        let latent = match &self.decoder {
            None => Latent::from_seed(&self.prior, seed),
            Some(decoder) => {
                let latent = self.request.draw(decoder, &self.prior, &mut Stream::from_seed(seed))?;
                let source = format!("seed {seed}, {}", request_in_words(&self.request));
                Latent { source: Some(source), ..latent }
            }
        };
        Ok(Latent { model: Some(self.model.clone()), ..latent })
    }
}

/// The latent that a file names: its own, that of a baked image, or that of a panorama through the encoder. An image whose
/// pixels are no longer those of its latent is encoded.
pub(crate) fn from_file(path: &Path, layer: &Layer, loaded: &Loaded, report: Report) -> Result<Latent> {
    let model = &loaded.model;
    let mut latent = match stored(path)? {
        Some(latent) if is_edited_of_another(path, &latent, model)? => {
            encode(path, layer, loaded, "its pixels were changed after its latent was written", report)?
        }
        Some(latent) => {
            check(&latent, loaded).with_context(|| path.display().to_string())?;
            if is_latent(path)? || is_of_its_pixels(path, &latent, model)? {
                latent
            } else if is_cube_map(path)? {
                bail!(
                    "{}: a cube map whose pixels were changed after its latent was written, and cube maps cannot be \
                     encoded; name the original, or an equirectangular panorama",
                    path.display()
                );
            } else {
                let why = "its pixels were changed after its latent was written";
                encode(path, layer, loaded, why, report)?
            }
        }
        None => encode(path, layer, loaded, "no latent inside", report)?,
    };
    if latent.model.is_none() {
        report.note(format_args!(
            "{}: does not say which model it belongs to; taken for this one",
            path.display()
        ));
        latent.model = Some(model.hash());
    }
    Ok(latent)
}

/// The latent in a latent's file or in a baked image; None in a panorama without.
fn stored(path: &Path) -> Result<Option<Latent>> {
    if is_latent(path)? {
        return Ok(Some(Latent::load(path)?));
    }
    let attributes = veni_image::attributes(path).map_err(with_remedy)?;
    match attributes.get(LATENT) {
        Some(text) => Latent::from_json(text)
            .map(Some)
            .map_err(|e| anyhow!("{}: attribute {LATENT}: {e}", path.display())),
        None if attributes.contains_key(CUBE_FACES) => {
            bail!("{}: a cube map cannot be encoded; name an equirectangular panorama", path.display())
        }
        None => Ok(None),
    }
}

/// A latent means something only to the decoder that it was made for.
fn check(latent: &Latent, Loaded { model, name, .. }: &Loaded) -> Result<()> {
    let (n, expected) = (latent.vectors.len(), model.latent_vectors());
    if n != expected {
        bail!("a latent of {n} vectors, but {name} has {expected}: name {}", owner(latent));
    }
    match &latent.model {
        Some(hash) if *hash != model.hash() => {
            bail!("a latent of model {hash}, but {name} is {}: name {}", model.hash(), owner(latent))
        }
        _ => {}
    }
    // what the decoder refuses, or would cut off, without knowing of a file
    let large = |v: &[f32; 3]| v.iter().any(|c| c.abs() > MAX_COORDINATE);
    if let Some(i) = latent.vectors.iter().position(large) {
        bail!("latent vector {i} is {:?}, beyond {MAX_COORDINATE}: make the latent again", latent.vectors[i]);
    }
    let exposure = latent.log_exposure;
    if exposure.abs() > MAX_EXPOSURE {
        bail!(
            "the exposure is {exposure}, and radiance times e^{exposure} is beyond the range of floats: give the latent one \
             from -{MAX_EXPOSURE} to {MAX_EXPOSURE}"
        );
    }
    Ok(())
}

/// Whether an image was edited that has a latent of another model inside the program.
fn is_edited_of_another(path: &Path, latent: &Latent, model: &Model) -> Result<bool> {
    match inside(latent) {
        Some(own) if own.model.hash() != model.hash() && !is_cube_map(path)? => was_edited(path, &own.model),
        _ => Ok(false),
    }
}

/// The model that a latent belongs to, and how to name it.
fn owner(latent: &Latent) -> String {
    match inside(latent) {
        Some(own) if own.model.has_encoder() => {
            let name = name_of(own.model.latent_vectors());
            format!("its own model, which is inside this program, with --model {name}")
        }
        Some(_) => "no model: its own is inside this program, and taken where none is named".to_owned(),
        None => "the latent's own model with --model FILE".to_owned(),
    }
}

/// The model inside this program that a latent says it belongs to.
#[cfg(feature = "pretrained")]
fn inside(latent: &Latent) -> Option<Loaded> {
    let model = Model::pretrained_of_hash(latent.model.as_deref()?)?;
    let dimension = 3 * model.latent_vectors();
    let name = if model.has_encoder() {
        format!("the model of latent dimension {dimension} inside this program")
    } else {
        format!("the earlier model of latent dimension {dimension} inside this program")
    };
    Some(Loaded { model, name, lobes: 0 })
}

#[cfg(not(feature = "pretrained"))]
fn inside(_: &Latent) -> Option<Loaded> {
    None
}

fn is_cube_map(path: &Path) -> Result<bool> {
    Ok(veni_image::attributes(path).map_err(with_remedy)?.contains_key(CUBE_FACES))
}

fn encode(path: &Path, layer: &Layer, loaded: &Loaded, why: &str, report: Report) -> Result<Latent> {
    let encoded = super::encoding::Encoding::new(loaded, None, None)?.encode_file(path, layer, report)?;
    report.note(format_args!("{}: {why}; the panorama was encoded", path.display()));
    Ok(encoded.latent)
}

/// Whether a file is a latent, and not an image: JSON is a latent, and so is what is called so and does not begin as an image;
/// everything else is left to the image readers, which say what they do not read.
pub(crate) fn is_latent(path: &Path) -> Result<bool> {
    let mut start = Vec::new();
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    file.take(64).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
    let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let is_image = IMAGES.iter().any(|image| start.starts_with(image));
    Ok(named && !is_image || begins_object(&start))
}

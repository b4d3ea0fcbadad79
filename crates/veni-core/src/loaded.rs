//! A model file with its networks, ready to encode, decode and be fitted to.

use std::borrow::Cow;
use std::sync::Arc;

use burn::tensor::Device;

use crate::fit::FitDecoder;
use crate::vae::{Decoder, Veni, veni};
use crate::{Error, Result};
use veni_fit::lit_exposure;
use veni_light::field;
use veni_light::latent::{Latent, Prior};
use veni_light::light::{LightOptions, Lights};
use veni_light::model::{Model, ModelKind};
use veni_light::sphere::{Equirect, Stripes};

/// A model and everything that the protocols ask of it. A model without an encoder (RENI++, or a stripped file) takes part
/// wherever no encoder is needed.
#[derive(Clone, Debug)]
pub struct LoadedModel {
    name: String,
    identity: String,
    model: Arc<Model>,
    decoder: Arc<Decoding>,
    device: Device,
    lights: usize,
    lobes: usize,
}

/// What is left of an image without its compact lights.
#[derive(Clone, Debug)]
pub struct Rest<'a> {
    /// Log radiance at exposure 0, 3·W·H values.
    pub log_radiance: Cow<'a, [f32]>,
    /// A code without vectors: the lights, and the exposure that the rest lies above or below the image's.
    pub code: Latent,
}

/// How the decoder is evaluated. Both give the same values.
#[derive(Debug)]
enum Decoding {
    /// The auto-encoder, and its field folded per latent where the network folds.
    Whole { veni: Box<Veni>, field: Option<field::Decoder> },
    /// A decoder alone.
    Alone { network: Box<Decoder>, field: Option<field::Decoder> },
}

impl LoadedModel {
    /// A model under a name for tables, with its networks on `device` (without gradient tracking).
    ///
    /// # Errors
    /// [`Error::Invalid`] if the model's tensors are not those its configuration implies.
    pub fn new(name: impl Into<String>, model: Model, device: &Device) -> Result<Self> {
        // networks that do not fold are evaluated as graphs of tensors
        let field = match model.decoder() {
            Ok(field) => Some(field),
            Err(Error::Unsupported { .. }) => None,
            Err(error) => return Err(error),
        };
        let decoder = if model.has_encoder() {
            Decoding::Whole { veni: Box::new(Veni::from_model(&model, device)?), field }
        } else {
            Decoding::Alone { network: Box::new(Decoder::from_model(&model, device)?), field }
        };
        Ok(Self {
            name: name.into(),
            identity: model.digest().to_string(),
            lights: model.config().measured_lights(),
            lobes: 0,
            model: Arc::new(model),
            decoder: Arc::new(decoder),
            device: device.clone(),
        })
    }

    /// The same model with up to `lights` lights measured in each panorama.
    ///
    /// # Errors
    /// [`Error::Invalid`] above [`Lights::MOST`], or if the model was trained on panoramas with their lights: its field draws them.
    pub fn with_lights(self, lights: usize) -> Result<Self> {
        if lights > Lights::MOST {
            return Err(Error::invalid(format!("{lights} lights are more than {}", Lights::MOST)));
        }
        if lights > 0 && self.model.config().lights == 0 {
            let name = self.name;
            return Err(Error::invalid(format!(
                "{name}: this model was trained on panoramas with their lights, which its field draws; it has none beside them"
            )));
        }
        Ok(Self { lights, ..self })
    }

    /// The most lights that are measured in a panorama: [`ModelConfig::measured_lights`](veni_light::model::ModelConfig::measured_lights)
    /// unless [`LoadedModel::with_lights`] said otherwise.
    pub fn lights(&self) -> usize {
        self.lights
    }

    /// The same model with `lobes` lobes in each code.
    #[must_use]
    pub fn with_lobes(self, lobes: usize) -> Self {
        Self { lobes, ..self }
    }

    /// The lobes of a panorama's code beside vectors and lights: 0 unless [`LoadedModel::with_lobes`] said otherwise.
    pub fn lobes(&self) -> usize {
        self.lobes
    }

    /// What holds its networks.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// What to call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Identity of the whole model, encoder included: 16 hexadecimal digits.
    pub fn identity(&self) -> &str {
        &self.identity
    }

    /// The model file's content.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Auto-encoder or auto-decoder.
    pub fn kind(&self) -> ModelKind {
        self.model.config().kind
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.model.latent_vectors()
    }

    /// D = 3N, the paper's size of a code.
    pub fn dimension(&self) -> usize {
        3 * self.latent_vectors()
    }

    /// The distribution of its training latents; the standard normal if the file has none.
    pub fn prior(&self) -> Prior {
        self.model.prior()
    }

    /// The auto-encoder, if there is an encoder.
    pub fn veni(&self) -> Option<&Veni> {
        match &*self.decoder {
            Decoding::Whole { veni, .. } => Some(veni),
            Decoding::Alone { .. } => None,
        }
    }

    /// The decoder as a network of tensors.
    pub fn network(&self) -> &Decoder {
        match &*self.decoder {
            Decoding::Whole { veni, .. } => &veni.decoder,
            Decoding::Alone { network, .. } => network,
        }
    }

    /// The decoder folded per latent, if its network folds.
    pub fn field(&self) -> Option<&field::Decoder> {
        let (Decoding::Whole { field, .. } | Decoding::Alone { field, .. }) = &*self.decoder;
        field.as_ref()
    }

    /// The decoder as fits take it: folded where it folds.
    pub fn fit_decoder(&self) -> FitDecoder<'_> {
        self.field().map_or_else(|| FitDecoder::Graph(self.network()), FitDecoder::Folded)
    }

    /// Where the encoder looks, if there is one.
    ///
    /// # Errors
    /// As [`Veni::stripes`].
    pub fn stripes(&self) -> Result<Option<Stripes>> {
        self.veni().map(Veni::stripes).transpose()
    }

    /// The means of the encoder's posteriors for images of log radiance at exposure 0. Where the model's codes have lights, with those
    /// of each image, and at the exposure at which surfaces get its light ([`lit_exposure`]).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no encoder; otherwise as [`Veni::encode`].
    pub fn encode(&self, grid: Equirect, images: &[&[f32]]) -> Result<Vec<Latent>> {
        let rests =
            images.iter().map(|image| self.without_lights(grid, image)).collect::<Result<Vec<_>>>()?;
        let views: Vec<_> = rests.iter().map(|rest| &*rest.log_radiance).collect();
        let vectors = self.encode_rest(grid, &views)?;
        let whole = |(rest, vectors): (&Rest<'_>, Vec<[f32; 3]>)| {
            let mut plain = [Latent::new(vectors)];
            self.expose(grid, rest, &mut plain)?;
            let [plain] = plain;
            let lights = rest.code.lights.scaled((-plain.log_exposure).exp());
            let log_exposure = rest.code.log_exposure + plain.log_exposure;
            Ok(Latent { lights, log_exposure, ..plain })
        };
        rests.iter().zip(vectors).map(whole).collect()
    }

    /// Moves the exposures of latents of an image without its lights to where surfaces get the image's light, [`lit_exposure`]; of a model
    /// whose codes have no lights not at all.
    ///
    /// # Errors
    /// As [`LoadedModel::decode`].
    pub fn expose(&self, grid: Equirect, rest: &Rest<'_>, latents: &mut [Latent]) -> Result<()> {
        if self.lights == 0 {
            return Ok(());
        }
        for (decoded, latent) in self.decode(grid, latents)?.iter().zip(latents) {
            latent.log_exposure += lit_exposure(grid, &rest.log_radiance, decoded, &rest.code.lights);
        }
        Ok(())
    }

    /// The vectors of the encoder's posteriors' means for images whose lights are out ([`LoadedModel::without_lights`]).
    ///
    /// # Errors
    /// As [`LoadedModel::encode`].
    pub fn encode_rest(&self, grid: Equirect, images: &[&[f32]]) -> Result<Vec<Vec<[f32; 3]>>> {
        let veni =
            self.veni().ok_or_else(|| Error::invalid("this model has no encoder").in_file(&self.name))?;
        Ok(veni.encode(grid, images)?.into_iter().map(|e| e.vectors).collect())
    }

    /// An image of log radiance as what the model's vectors describe of it, and what they do not.
    ///
    /// # Errors
    /// As [`Item::split`](veni_data::Item::split).
    pub fn without_lights<'a>(&self, grid: Equirect, image: &'a [f32]) -> Result<Rest<'a>> {
        self.without_lights_up_to(grid, image, std::f32::consts::PI)
    }

    /// [`LoadedModel::without_lights`] with no light of an angular radius above `widest`, radians.
    ///
    /// # Errors
    /// As there.
    pub fn without_lights_up_to<'a>(
        &self,
        grid: Equirect,
        image: &'a [f32],
        widest: f32,
    ) -> Result<Rest<'a>> {
        let lights = self.lights;
        if lights == 0 {
            return Ok(Rest { log_radiance: image.into(), code: Latent::default() });
        }
        let options = LightOptions { lights, widest, ..LightOptions::default() };
        let item = veni_data::Item::split_log(grid, image, options)?;
        let code = Latent { lights: item.lights, log_exposure: item.log_exposure, ..Latent::default() };
        Ok(Rest { log_radiance: item.log_radiance.to_vec().into(), code })
    }

    /// Log radiance at the latents' exposures on every pixel, lights included, 3·W·H values each.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the model if a latent does not belong to it or is too large to decode.
    pub fn decode(&self, grid: Equirect, latents: &[Latent]) -> Result<Vec<Vec<f32>>> {
        let Some(field) = self.field() else {
            let vectors: Vec<_> = latents.iter().map(|z| z.vectors.clone()).collect();
            let mut images = veni::decode(self.network(), grid, &vectors);
            for (image, z) in images.iter_mut().zip(latents) {
                image.iter_mut().for_each(|v| *v += z.log_exposure);
            }
            return Ok(images);
        };
        let directions = grid.directions();
        let one = |z: &Latent| {
            let field = field.condition(z).map_err(|e| Error::invalid(format!("{}: {e}", self.name)))?;
            if !z.lights.is_empty() {
                return Ok(field.bake(grid).into_flattened().into_iter().map(f32::ln).collect());
            }
            let mut image = vec![[0.0; 3]; directions.len()];
            field.log_radiance_batch(&directions, &mut image);
            Ok(image.into_flattened())
        };
        latents.iter().map(one).collect()
    }

    /// Trainable parameters of (encoder, decoder).
    pub fn parameters(&self) -> [usize; 2] {
        let count = |prefix: &str| {
            let own = self.model.tensors().iter().filter(|(name, _)| name.starts_with(prefix));
            own.map(|(_, t)| t.data.len()).sum()
        };
        [count("encoder."), count("decoder.")]
    }

    /// How many panoramas it was trained on, if its file says so; files from before that entry say it in words ("76 panoramas
    /// of …").
    pub fn training_panoramas(&self) -> Option<usize> {
        let training = self.model.info().training.as_ref()?;
        let in_words = || {
            let (count, rest) = training.data.split_once(' ')?;
            count.parse().ok().filter(|_| rest.starts_with("panorama"))
        };
        training.panoramas.or_else(in_words)
    }
}

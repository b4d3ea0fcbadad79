//! VENI, a learned prior of natural outdoor illumination (arXiv 2601.14079), as a renderer embeds it: no tensors, no
//! training, no image files.
//!
//! | here | what |
//! |---|---|
//! | [`sphere`] | directions, frames, pixel grids, perspective views |
//! | [`latent`] | the code: N vectors in R³, and their prior |
//! | [`model`] | the weight file, and the models inside this crate |
//! | [`field`] | the decoder folded for one latent: radiance in any direction |
//! | [`light`] | what renderers need of an environment map |
//! | [`vector`] | sums and products of three numbers |
//! | [`skies`] | random skies on request: where the sun is, how overcast, how warm |
//! | [`random`] | streams of random numbers that are the same on every machine |
//! | [`cholesky`] | small dense systems of equations |
//! | [`digest`] | content as one short name |
//! | [`progress`] | the observer of long work, to which progress is reported |
//! | [`limits`] | how large a file may be, and what it may ask for |
//! | [`output`] | files that are written beside their target and renamed |
//!
//! # Glossary
//!
//! | term | meaning | symbol, unit |
//! |---|---|---|
//! | latent | what stands for a panorama: N vectors in R³ that rotate with the scene, and a log exposure | Z ∈ R^{N×3} |
//! | code | latent with the compact lights and lobes that were measured beside its vectors | D = 3N + 7M + 7K numbers |
//! | latent dimension | number of coordinates of the vectors; names a model (`--model 27`) | D = 3N |
//! | conditioning | what the decoder is given of the latent besides its products with the direction: rotation invariants of its vectors (condition features) | a |
//! | field | the decoder conditioned on one latent: direction to radiance | f(d; Z) |
//! | radiance | light per projected area and solid angle along a direction; linear Rec. 709 R, G, B, up to a factor | L, W m⁻² sr⁻¹; generated scenes: kcd/m² |
//! | compact light | sun, moon or lamp apart from the rest: a disc, or a wider smooth glow, of given irradiance ([`light::CompactLight`]) | direction, irradiance per channel, angular radius |
//! | lobe | smooth bump of log radiance about a direction that is added to the decoder's ([`latent::Lobe`]) | |
//! | residual | what is left of a panorama without its compact lights ([`light::Light::residual`]) | L |
//! | share (of a light) | its part of the light on a surface that faces it ([`light::Light::shares`]) | 0 to 1 |
//! | prefiltered map | radiance convolved with a lobe of reflection, a level per roughness ([`light::Prefilter`]) | |
//! | energy weight | part of a fit's weight that goes by the light of a pixel instead of its solid angle | λ, 0 to 1 |
//! | exposure | factor between the decoder's output and radiance; a panorama's is the solid-angle-weighted mean of ln luminance | s, natural log |
//! | irradiance | radiance times cosine, integrated over the hemisphere above a surface | E, W m⁻² |
//! | solid angle | a pixel's part of the unit sphere, the weight in means over a panorama | ω, sr; 4π in all |
//! | equirectangular | image of the sphere with azimuth along the columns and polar angle along the rows, twice as wide as high | W × H = 2H × H |
//! | native frame | right-handed axes with z up, the middle of a panorama at +x ([`sphere`]) | d = (x, y, z) |
//! | yaw | rotation about z, counter-clockwise seen from above; the group SO(2) | α, rad |
//! | prior | Gaussian density of latents before anything is seen, invariant to yaw: random skies, a fit's penalty | p(Z) |
//! | posterior | density of latents given a panorama: the encoder's mean and variance | q(Z given I) = N(μ, σ²) |
//! | encoder, decoder | networks from a panorama to the posterior, and from latent and direction to log radiance | |
//! | stripe | vertical strip of a panorama, all heights at a few meridians; one token of the encoder ([`sphere::Stripes`]) | T stripes of P samples |
//! | fold | to compute once per latent what does not depend on the direction; the result is the field. (Elsewhere: a part of a cross-validation) | |
//! | Vector Neuron | layer on lists of 3-vectors that commutes with rotations: linear maps mix vectors, never coordinates | VN |
//! | SO(2) layer | layer that commutes with yaw: x and y as a Vector Neuron's, z as an invariant number | |
//! | Gauss–Newton weight | non-negative number in place of a loss's second derivative with respect to log radiance | ℓ″, [`field::LocalQuadratic`] |

#![cfg_attr(not(feature = "training"), forbid(unsafe_code))]

pub mod cholesky;
mod compact;
pub mod digest;
pub mod error;
pub mod field;
pub mod latent;
pub mod light;
pub mod limits;
mod luminance;
pub mod model;
pub mod output;
pub mod progress;
pub mod random;
#[cfg(feature = "gradients")]
pub mod skies;
pub mod sphere;
mod tasks;
pub mod text;
pub mod vector;

pub use error::{Error, Result};

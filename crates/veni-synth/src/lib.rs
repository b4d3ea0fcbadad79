//! Skies that nobody photographed: outdoor scenes from physical models, as panoramas to learn from.
//!
//! A [`Scene`] is a few dozen numbers, drawn from a documented distribution by seed and index ([`Scene::draw`]);
//! [`render`] turns it into radiance in kcd/m². Both are pure functions: scene k of seed s is the same on any number of
//! threads, at any size, whatever else is generated.
//!
//! | what | model |
//! |---|---|
//! | clear sky, sunlight, dusk | single scattering in eight bands of wavelength through molecules, aerosol and ozone of a spherical earth, light scattered more often in closed form ([`Scene::turbidity`], [`Scene::ozone`]) |
//! | sun and moon | limb-darkened discs of true solid angle and radiance, integrated over pixels |
//! | clouds | [`CloudLayer`]s of fractal density, ray-marched (cumulus) or thin (stratus), lit by sun, sky and ground |
//! | hills, mountains, woods, towns | [`Ridge`]s, behind air |
//! | trees, houses, rocks, walls, cars, lamps | solids around the viewer with shadows, by [`Setting`] |
//! | ground | [`GroundMaterial`]s in a [`Pattern`]; water with waves, Fresnel reflection and glitter |
//! | night | moonlight, stars, airglow, street lamps, windows, the glow of towns |
//!
//! ```
//! use veni_light::sphere::Equirect;
//! use veni_synth::{Overrides, Scene, SkyKind, render};
//!
//! let overrides = Overrides { sky: Some(SkyKind::Clear), sun_elevation: Some(30.0), ..Overrides::default() };
//! let scene = Scene::draw(7, 0, &overrides);
//! let panorama = render(&scene, Equirect::new(32, 16));
//! assert_eq!(panorama, render(&scene, Equirect::new(32, 16)));
//! ```

#![forbid(unsafe_code)]

mod ambient;
mod atmosphere;
mod cloud;
mod cloud_layer;
mod disc;
mod dome;
mod draw;
mod generate;
mod ground;
mod layout;
mod material;
mod noise;
mod random;
mod render;
mod scene;
mod scene_view;
mod sky;
mod solid;
mod spectrum;
mod surface;
mod terrain;
mod view;

#[cfg(test)]
mod sun_tests;
#[cfg(test)]
mod tests;

pub use veni_light::{Error, Result};

pub use cloud_layer::{CloudKind, CloudLayer};
pub use draw::Overrides;
pub use generate::generate;
pub use render::render;
pub use scene::{Moon, Ridge, RidgeKind, Scene, Setting, SkyKind};
pub use surface::{Ground, GroundMaterial, Pattern};

//! Whole scenes: seeds, energy, the sun's place, the order of brightness by hour and weather.

use super::*;
use veni_image::{Panorama, luminance};
use veni_light::sphere::Equirect;

const SMALL: Equirect = Equirect { width: 32, height: 16 };

/// A clear noon on a plain with nothing on it.
fn clear(elevation: f32) -> Scene {
    let overrides = Overrides {
        sky: Some(SkyKind::Clear),
        setting: Some(Setting::Plain),
        sun_elevation: Some(elevation),
        sun_azimuth: Some(40.0),
        turbidity: Some(2.5),
        cloud_cover: Some(0.0),
        ..Overrides::default()
    };
    Scene { ridges: Vec::new(), fullness: 0.0, white: [1.0; 3], ..Scene::draw(3, 1, &overrides) }
}

/// ∫ Y max(⟨n, d⟩, 0) dω, in klx.
fn illuminance(panorama: &Panorama, normal: [f32; 3]) -> f64 {
    let grid = panorama.grid();
    let mut sum = 0.0;
    for (k, (pixel, d)) in panorama.pixels().iter().zip(grid.directions()).enumerate() {
        let cosine: f32 = d.iter().zip(normal).map(|(a, b)| a * b).sum();
        sum += f64::from(luminance(*pixel) * cosine.max(0.0)) * grid.solid_angle(k / grid.width);
    }
    sum
}

#[test]
fn a_scene_is_a_function_of_seed_and_index_whatever_the_threads() {
    let overrides = Overrides::default();
    let in_pool = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&Scene::draw(5, 11, &overrides), SMALL))
    };
    let first = in_pool(1);
    assert_eq!(first, in_pool(3));
    for (seed, index) in [(5, 12), (6, 11)] {
        assert_ne!(first, render(&Scene::draw(seed, index, &overrides), SMALL));
    }
    for setting in Setting::ALL {
        assert_eq!(serde_json::to_value(setting).unwrap(), setting.name());
    }
    for sky in SkyKind::ALL {
        assert_eq!(serde_json::to_value(sky).unwrap(), sky.name());
    }
    // and the parameters say it all
    let scene = Scene::draw(5, 11, &overrides);
    let text = serde_json::to_string(&scene).unwrap();
    assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), scene);
    // what is fixed is kept, and the rest stays as it was
    let overrides = Overrides { sun_azimuth: Some(12.0), turbidity: Some(4.0), ..overrides };
    let other = Scene::draw(5, 11, &overrides);
    assert_eq!((other.sun_azimuth, other.turbidity), (12.0, 4.0));
    assert_eq!(other, Scene { sun_azimuth: 12.0, turbidity: 4.0, ..scene });
}

#[test]
fn every_kind_of_scene_is_positive_and_finite() {
    let count = Setting::ALL.len() * SkyKind::ALL.len();
    let mut ranges = Vec::new();
    for k in 0..count {
        let overrides = Overrides {
            sky: Some(SkyKind::ALL[k % SkyKind::ALL.len()]),
            setting: Some(Setting::ALL[k / SkyKind::ALL.len()]),
            ..Overrides::default()
        };
        let panorama = render(&Scene::draw(1, k as u64, &overrides), SMALL);
        let values = panorama.pixels().as_flattened();
        assert!(values.iter().all(|v| v.is_finite() && *v > 0.0), "{overrides:?}");
        let (low, high) = values.iter().fold((f32::MAX, 0f32), |(a, b), v| (a.min(*v), b.max(*v)));
        ranges.push((high / low).ln());
    }
    ranges.sort_unstable_by(f32::total_cmp);
    // stops of an outdoor scene: dark corners to sky, or to the sun
    assert!(ranges[0] > 1.0 && (4.0..14.0).contains(&ranges[count / 2]), "{ranges:?}");
}

/// Scenes of one weather on an empty plain, with the camera's white balance off.
fn under(sky: SkyKind, count: u64) -> impl Iterator<Item = Scene> {
    let overrides = Overrides { sky: Some(sky), setting: Some(Setting::Plain), ..Overrides::default() };
    (0..count).map(move |index| {
        let scene = Scene::draw(31, index, &overrides);
        Scene { ridges: Vec::new(), fullness: 0.0, white: [1.0; 3], lit: false, ..scene }
    })
}

/// Horizontal illuminance of daylight over the sine of the sun's elevation: 128 klx reach the atmosphere, and of them
/// some 100 to 120 the ground under a clear sky, a tenth to a half under a closed one (CIE 110, 1994).
#[test]
fn the_light_of_every_weather_is_that_of_light_meters() {
    for sky in SkyKind::ALL {
        let all: Vec<_> = under(sky, 24)
            .map(|scene| {
                let panorama = render(&scene, SMALL);
                let half = &panorama.pixels()[..SMALL.len() / 2];
                let brightest = half.iter().map(|p| luminance(*p)).fold(0f32, f32::max);
                (illuminance(&panorama, [0.0, 0.0, 1.0]), scene.sun_elevation, brightest)
            })
            .collect();
        let each =
            |low: f64, high: f64| assert!(all.iter().all(|a| (low..high).contains(&a.0)), "{sky:?}: {all:?}");
        let mut ratios: Vec<_> =
            all.iter().map(|(klx, e, _)| klx / f64::from(e.to_radians().sin())).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        // 20 klx and more from the sun in one pixel of 11° (0.038 sr) are 500 kcd/m²; no cloud is as bright
        let suns = all.iter().filter(|(_, _, brightest)| *brightest > 500.0).count();
        match sky {
            SkyKind::Clear => {
                each(10.0, 128.0);
                assert!((95.0..120.0).contains(&ratios[12]) && suns >= 18, "{ratios:?}, {suns}");
            }
            SkyKind::Cloudy => {
                each(5.0, 128.0);
                assert!((70.0..122.0).contains(&ratios[12]) && (8..24).contains(&suns), "{ratios:?}, {suns}");
            }
            SkyKind::Overcast => {
                each(1.0, 90.0);
                assert!((20.0..65.0).contains(&ratios[12]) && suns == 0, "{ratios:?}, {suns}");
            }
            SkyKind::Sunset => each(0.05, 15.0),
            // starlight to full moon and the end of dusk
            SkyKind::Night => each(1e-7, 1e-3),
        }
    }
}

#[test]
fn every_place_shows_as_much_sky_as_its_name_says() {
    // the mean share of the upper half space that is open, and the least of 24 scenes
    let expected = |setting| match setting {
        Setting::PureSky => (1.0..1.01, 1.0),
        Setting::Plain | Setting::Coast => (0.85..0.97, 0.4),
        Setting::Hills => (0.68..0.85, 0.4),
        Setting::Lake => (0.75..0.92, 0.4),
        Setting::Park | Setting::Village | Setting::Rocks => (0.62..0.85, 0.2),
        Setting::Square => (0.45..0.68, 0.15),
        Setting::Street => (0.33..0.55, 0.05),
        Setting::Courtyard => (0.25..0.5, 0.02),
        Setting::Shelter => (0.1..0.35, 0.0),
        Setting::Forest => (0.0..0.1, 0.0),
    };
    for setting in Setting::ALL {
        let overrides =
            Overrides { sky: Some(SkyKind::Cloudy), setting: Some(setting), ..Overrides::default() };
        let shares: [f32; 24] = std::array::from_fn(|index| {
            let scene = Scene::draw(32, index as u64, &overrides);
            let view = scene_view::SceneView::new(&scene);
            let open = sky::spiral(400).filter(|d| view.is_clear(*d, f32::INFINITY)).count();
            open as f32 / 400.0
        });
        let (mean, least) = (shares.iter().sum::<f32>() / 24.0, shares.iter().fold(1f32, |a, b| a.min(*b)));
        let (range, low) = expected(setting);
        assert!(range.contains(&mean) && least >= low, "{setting:?}: {mean}, {least} at least");
    }
}

#[test]
fn the_sun_is_drawn_where_any_scene_says_it_is() {
    let grid = Equirect::new(64, 32);
    for k in 0..48 {
        // every third of a turn and 7° more: no two at one place of a pixel
        let (azimuth, elevation) = (127.0 * k as f32 % 360.0, 3.0 + 83.0 * k as f32 / 47.0);
        let overrides = Overrides {
            sky: Some(SkyKind::Clear),
            setting: Some(Setting::PureSky),
            sun_elevation: Some(elevation),
            sun_azimuth: Some(azimuth),
            cloud_cover: Some(0.0),
            ..Overrides::default()
        };
        let scene = Scene::draw(33, k, &overrides);
        let panorama = render(&scene, grid);
        let brightness = |(_, p): &(usize, &[f32; 3])| luminance(**p);
        let all = panorama.pixels().iter().enumerate();
        let (at, _) = all.max_by(|a, b| brightness(a).total_cmp(&brightness(b))).unwrap();
        // written out here, so that a wrong sense of azimuth anywhere is seen
        let [column, row] =
            [(180.0 - azimuth).rem_euclid(360.0) / 360.0 * 64.0, (90.0 - elevation) / 180.0 * 32.0];
        let across = (at % 64) as f32 + 0.5 - column;
        let across = (across + 32.0).rem_euclid(64.0) - 32.0;
        let down = (at / 64) as f32 + 0.5 - row;
        // half a pixel, and what of the disc of 0.27° lies beyond its border
        let slack = 0.27 / 5.625 / elevation.to_radians().cos();
        assert!(
            across.abs() <= 0.5 + slack && down.abs() <= 0.55,
            "{azimuth}°, {elevation}°: {across} {down}"
        );
        // the disc's energy in the pixels is that of the source
        let view = scene_view::SceneView::new(&scene);
        let mut pixels = vec![glam::Vec3::ZERO; grid.len()];
        disc::add_discs(&view, grid, &mut pixels);
        let energy = pixels
            .iter()
            .enumerate()
            .map(|(k, p)| f64::from(luminance(p.to_array())) * grid.solid_angle(k / 64));
        let (energy, source) =
            (energy.sum::<f64>(), f64::from(luminance(view.sky.sources[0].clear.to_array())));
        assert!(
            (energy - source).abs() < 1e-3 * source,
            "{azimuth}°, {elevation}°: {energy} of {source} klx"
        );
    }
}

#[test]
fn the_sun_is_where_it_was_asked_for_with_its_energy_at_any_size() {
    let scene = clear(35.0);
    let towards = scene.sun();
    let near_sun = |grid: Equirect, scene: &Scene| {
        let panorama = render(scene, grid);
        let (mut sum, mut brightest) = (0.0, (0f32, [0.0; 3]));
        for (k, (pixel, d)) in panorama.pixels().iter().zip(grid.directions()).enumerate() {
            let cosine: f32 = d.iter().zip(towards).map(|(a, b)| a * b).sum();
            let y = luminance(*pixel);
            if cosine > 0.98 {
                sum += f64::from(y) * grid.solid_angle(k / grid.width);
            }
            if y > brightest.0 {
                brightest = (y, d);
            }
        }
        (sum, brightest.1)
    };
    let sizes = [64, 160, 320].map(|w| near_sun(Equirect::new(w, w / 2), &scene));
    for (energy, direction) in &sizes {
        // 60 to 90 klx of direct light, and a few of the aureole within 11°
        assert!((60.0..100.0).contains(energy), "{energy} klx");
        assert!((energy - sizes[2].0).abs() < 0.02 * sizes[2].0, "{energy} against {}", sizes[2].0);
        let cosine: f32 = direction.iter().zip(towards).map(|(a, b)| a * b).sum();
        assert!(cosine > 0.997, "{direction:?} for {towards:?}");
    }
    // the disc resolved has the radiance that a sun of 6.8e-5 sr must have
    let (view, fine) = (scene_view::SceneView::new(&scene), Equirect::new(4096, 2048));
    let mut pixels = vec![glam::Vec3::ZERO; fine.len()];
    disc::add_discs(&view, fine, &mut pixels);
    let (mut solid, mut energy, mut middle) = (0.0, 0.0, 0.0f64);
    for (k, pixel) in pixels.iter().enumerate().filter(|(_, p)| p.y > 0.0) {
        let (y, angle) = (f64::from(luminance(pixel.to_array())), fine.solid_angle(k / fine.width));
        (solid, energy, middle) = (solid + angle, energy + y * angle, middle.max(y));
    }
    // pixels on the border are lit in part; the mean of a limb-darkened disc is 0.8 of its middle
    assert!((6.8e-5..1.05e-4).contains(&solid), "{solid} sr");
    assert!((middle * 0.8 * 6.8e-5 - energy).abs() < 0.15 * energy, "{middle} kcd/m² for {energy} klx");
    let source = f64::from(luminance(view.sky.sources[0].clear.to_array()));
    assert!((energy - source).abs() < 1e-3 * source, "{energy} of {source} klx");
    // cloud takes it away
    let overcast = Scene::draw(
        3,
        1,
        &Overrides { sky: Some(SkyKind::Overcast), sun_elevation: Some(35.0), ..Overrides::default() },
    );
    let overcast =
        Scene { sun_azimuth: 40.0, ridges: Vec::new(), fullness: 0.0, setting: Setting::Plain, ..overcast };
    assert!(near_sun(Equirect::new(64, 32), &overcast).0 < 0.1 * sizes[0].0);
}

#[test]
fn a_hidden_sun_is_moved_to_where_it_is_in_view() {
    let clear =
        Overrides { setting: Some(Setting::Square), sky: Some(SkyKind::Clear), ..Overrides::default() };
    let in_view = |s: &Scene| scene_view::SceneView::new(s).is_clear(s.sun_direction(), f32::INFINITY);
    let mut moved = 0;
    for index in 0..40 {
        let up = Scene::draw(4, index, &Overrides { sun_elevation: Some(18.0), ..clear });
        // below the horizon nobody looks for it, and the azimuth drawn is the same
        let down = Scene::draw(4, index, &Overrides { sun_elevation: Some(-1.0), ..clear });
        let first = Scene { sun_azimuth: down.sun_azimuth, ..up.clone() };
        if first != up {
            moved += 1;
            assert!(in_view(&up) && !in_view(&first), "scene {index}");
        }
    }
    assert!((4..30).contains(&moved), "{moved} of 40");
}

#[test]
fn illuminance_follows_hour_and_weather() {
    let grid = Equirect::new(96, 48);
    let up = |scene: &Scene| illuminance(&render(scene, grid), [0.0, 0.0, 1.0]);
    // textbooks: 100 klx from sun and sky at 60°, 20 to 40 klx at 20°, 400 lx at sunset, 3 lx at −6°
    for (elevation, low, high) in
        [(60.0, 80.0, 125.0), (20.0, 20.0, 42.0), (0.0, 0.15, 1.2), (-6.0, 5e-4, 1e-2)]
    {
        let scene = clear(elevation);
        let klx = up(&scene);
        assert!((low..high).contains(&klx), "{elevation}°: {klx} klx");
        // light from below is the ground's albedo times that
        if elevation > 10.0 {
            let below = illuminance(&render(&scene, grid), [0.0, 0.0, -1.0]);
            let albedo = luminance(scene.ground.albedo());
            assert!(
                (0.6..1.6).contains(&(below / klx / f64::from(albedo))),
                "{below} of {klx} with {albedo}"
            );
        }
    }
    let night = Scene { moon: None, glow: [0.0; 3], lit: false, ..clear(-30.0) };
    // starlight: 0.2 to 2 mlx
    assert!((1e-7..3e-6).contains(&up(&night)), "{} klx", up(&night));
    let moon = Moon { elevation: 45.0, azimuth: 0.0, phase: 0.0 };
    let moonlit = up(&Scene { moon: Some(moon), ..night });
    assert!((5e-5..3e-4).contains(&moonlit), "{moonlit} klx");
}

#[test]
fn fixed_values_out_of_range_are_refused_by_name() {
    for (overrides, name) in [
        (Overrides { turbidity: Some(0.5), ..Overrides::default() }, "turbidity 0.5"),
        (Overrides { cloud_cover: Some(1.5), ..Overrides::default() }, "cloud cover 1.5"),
        (Overrides { sun_elevation: Some(f32::NAN), ..Overrides::default() }, "sun elevation"),
    ] {
        let message = overrides.check().unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
    assert!(Overrides::default().check().is_ok());
}

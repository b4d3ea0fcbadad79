//! Shading: shaders, renderings under an environment map, illumination directions, and ten steps of inverse
//! rendering.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared, Outcome::Elsewhere, Outcome::Skipped, double, field};
use burn::tensor::{Device, Tensor};
use veni::shade::{
    Camera, Colour, DistantLights, ExposureForm, Material, RenderedImage, RenderingLoss, ShadingForm,
    Specular, Surface, Transfer,
};
use veni::sphere::{Equirect, reference};

/// See [`Family`](crate::Family). Only inverse rendering uses tensors: elsewhere the device plays no part.
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    match case.module() {
        "LambertianShader,BlinnPhongShader" => shaders(case),
        "RENIField" if case.expects("out.gt_render") => {
            if let Some(why) = field::unsupported(case) {
                return Some(Skipped(why));
            }
            if !double::active() {
                return Some(Elsewhere(double::elsewhere(case, device)));
            }
            inverse(case, device);
        }
        module if module.starts_with("render an [S,S] normal map") => renderings(case),
        module if module.starts_with("IcosahedronSampler") => samplers(case),
        _ => return None,
    }
    Some(Compared)
}

fn triples(case: &Case, name: &str) -> Vec<[f32; 3]> {
    case.data(name).values.as_chunks::<3>().0.to_vec()
}

fn compare(case: &Case, name: &str, ours: &[[f32; 3]]) {
    case.compare(name, &Data::new([ours.len(), 3], ours.as_flattened().to_vec()));
}

fn exp(log: &[[f32; 3]]) -> Vec<[f32; 3]> {
    log.iter().map(|p| p.map(f32::exp)).collect()
}

fn grid(case: &Case, name: &str) -> Equirect {
    let [height, width, 3] = case.data(name).shape[..] else { panic!("{name} is not an image") };
    Equirect::new(width, height)
}

fn samplers(case: &Case) {
    for name in case.tensors.keys().filter(|n| n.starts_with("out.ico_")) {
        let (count, upper) = match name["out.ico_".len()..].split_once('_') {
            Some((count, "upper")) => (count, true),
            _ => (&name["out.ico_".len()..], false),
        };
        let lights = DistantLights::icosahedron(count.parse().expect("out.ico_<count>"), upper);
        compare(case, name, lights.directions());
    }
    let width = case.size("equirect_width").expect("the width of the equirectangular sampler");
    compare(case, "out.equirect", DistantLights::reference(Equirect::new(width, width / 2)).directions());
}

/// Each of the points has lights of its own, so each is an image of one pixel.
fn shaders(case: &Case) {
    let [normals, views, albedo, specular] =
        ["in.normals", "in.view_directions", "in.albedo", "in.specular"].map(|n| triples(case, n));
    let (points, count) = (normals.len(), case.data("in.light_directions").shape[1]);
    let (directions, colours) = (triples(case, "in.light_directions"), triples(case, "in.light_colors"));
    let outputs = ["lambert_sum", "lambert_shaded", "blinn_phong"];
    let probes = outputs.map(|n| triples(case, &format!("probe.{n}")));
    let mut images = [(); 3].map(|()| Vec::new());
    let mut gradients = [(); 3].map(|()| Vec::new());
    for i in 0..points {
        let surface = Surface::new([1, 1], &normals[i..=i], &views[i..=i], None).expect("a point");
        let (directions, colours) = (&directions[i * count..][..count], &colours[i * count..][..count]);
        // only the Lambertian shader takes the length of a light's direction for a weight
        let lengths: Vec<f32> = directions
            .iter()
            .map(|d| d.map(f64::from).iter().map(|c| c * c).sum::<f64>().sqrt() as f32)
            .collect();
        let shade = |weights: &[f32], material: Material| {
            let lights = DistantLights::new(directions, weights).expect("lights");
            Transfer::new(&surface, &material, lights, ShadingForm::Reference).expect("a transfer")
        };
        let (ones, white) = (vec![1.0; count], Colour::Uniform([1.0; 3]));
        let lobe = |colour| Some(Specular { colour, shininess: case.data("in.shininess").values[i] });
        let transfers = [
            shade(&lengths, Material::lambert(white.clone())),
            shade(&lengths, Material::lambert(Colour::Uniform(albedo[i]))),
            shade(&ones, Material { diffuse: Colour::Uniform(albedo[i]), specular: lobe(specular[i]) }),
        ];
        let mut by_light = vec![[0.0; 3]; count];
        for ((transfer, image), probe) in transfers.iter().zip(&mut images).zip(&probes) {
            image.extend(transfer.render(colours));
            for (sum, part) in by_light.iter_mut().zip(transfer.pull_back(colours, &probe[i..=i])) {
                (0..3).for_each(|c| sum[c] += part[c]);
            }
        }
        gradients[2].extend(by_light);
        // colours are factors of what the lobes reflect alone; a lobe is shown brighter, away from the floor
        let diffuse =
            [&lengths, &ones].map(|w| shade(w, Material::lambert(white.clone())).render(colours)[0]);
        let alone = Material { diffuse: Colour::Uniform([0.0; 3]), specular: lobe([1.0; 3]) };
        let bright: Vec<_> = colours.iter().map(|p| p.map(|v| v * 2f32.powi(40))).collect();
        let glossy = shade(&ones, alone).render(&bright)[0].map(|v| v / 2f32.powi(40));
        gradients[0]
            .push([0, 1, 2].map(|c| probes[1][i][c] * diffuse[0][c] + probes[2][i][c] * diffuse[1][c]));
        gradients[1].push([0, 1, 2].map(|c| probes[2][i][c] * glossy[c]));
    }
    for (name, image) in outputs.iter().zip(images) {
        compare(case, &format!("out.{name}"), &image);
    }
    for (name, gradient) in ["albedo", "specular", "light_colors"].iter().zip(gradients) {
        compare(case, &format!("grad.in.{name}"), &gradient);
    }
}

/// The surface of a case, from its normals, its mask and these rays.
fn surface(case: &Case, rays: &str) -> Surface {
    let size = case.size("S").expect("the size S of the image");
    // the camera of the reference implementation gives these rays
    compare(case, rays, &Camera::reference().rays(size, size));
    let mask: Vec<bool> = case.data("in.mask").values.iter().map(|v| *v != 0.0).collect();
    let normals = triples(case, "in.normals");
    Surface::new([size, size], &normals, &triples(case, rays), Some(&mask)).expect("a surface")
}

/// One light per pixel, along the recorded directions, which are those of [`DistantLights::reference`].
fn lights(case: &Case) -> DistantLights {
    compare(case, "in.light_directions", DistantLights::reference(grid(case, "in.env_log")).directions());
    let directions = triples(case, "in.light_directions");
    DistantLights::new(&directions, &vec![1.0; directions.len()]).expect("lights")
}

fn renderings(case: &Case) {
    let (surface, lights) = (surface(case, "out.view_directions"), lights(case));
    let log = triples(case, "in.env_log");
    for name in case.tensors.keys().filter_map(|n| n.strip_prefix("out.render.")) {
        let (ks, shininess) = name[2..].split_once("_n").expect("ks<K_s>_n<shininess>");
        let (ks, shininess) = (ks.parse().expect("K_s"), shininess.parse().expect("a shininess"));
        let material = Material::blinn_phong(Colour::Uniform([1.0; 3]), ks, shininess);
        let transfer =
            Transfer::new(&surface, &material, lights.clone(), ShadingForm::Reference).expect("a transfer");
        let image = transfer.render(&exp(&log));
        compare(case, &format!("out.render.{name}"), &image);
        let target: Vec<_> = image.iter().map(|p| p.map(|v| 1.3 * v)).collect();
        let rendered = RenderedImage::new(transfer, &target, RenderingLoss::ReferenceLog).expect("a target");
        let (loss, gradient, exposure) = rendered.evaluate(&log, 0.0);
        // here the background, which no light reaches, is compared with 1.3 times itself too
        let hidden = surface.valid().iter().filter(|v| !**v).count() as f64 / image.len() as f64;
        case.compare_scalar(&format!("out.loss.{name}"), loss + 100.0 * hidden * 1.3f64.ln());
        compare(case, &format!("grad.env_log.{name}"), &gradient);
        let total: f64 = gradient.iter().flatten().map(|v| f64::from(*v)).sum();
        assert!(
            (total - exposure).abs() < 1e-4 * total.abs(),
            "exposure moves all lights: {exposure}, {total}"
        );
    }
}

/// Adam on latent and log exposure from 0, as the reference's figure does it.
fn inverse(case: &Case, device: &Device) {
    let number = |key: &str| case.number(key).unwrap_or_else(|| panic!("no number `{key}`"));
    let material =
        Material::blinn_phong(Colour::Uniform([1.0; 3]), number("ks") as f32, number("shininess") as f32);
    let (surface, lights, grid) =
        (surface(case, "in.view_directions"), lights(case), grid(case, "in.env_log"));
    let transfer = Transfer::new(&surface, &material, lights, ShadingForm::Reference).expect("a transfer");
    let target = transfer.render(&exp(&triples(case, "in.env_log")));
    compare(case, "out.gt_render", &target);
    let image = |loss| {
        let image = RenderedImage::new(transfer.clone(), &target, loss).expect("a target");
        image.with_exposure(ExposureForm::Reference)
    };
    let (figure, demo) = (image(RenderingLoss::ReferenceLog), image(RenderingLoss::demo()));
    let decoder = field::build(case, "", device);
    let directions = field::map_directions(&case.data("in.env_log").shape, device);
    assert_eq!(reference::decoder_directions(grid).len(), directions.dims()[0]);

    let n = decoder.latent_vectors();
    let mut variables = vec![0.0f64; 3 * n + 1];
    let mut moments = vec![[0.0f64; 2]; variables.len()];
    let (mut losses, mut terms) = (Vec::new(), Vec::new());
    let steps = number("steps") as i32;
    for step in 1..=steps {
        let (s, z) = variables.split_last().expect("an exposure");
        let latent = Tensor::<1>::from_floats(&z.iter().map(|v| *v as f32).collect::<Vec<_>>()[..], device);
        let latent = latent.reshape([1, n, 3]).require_grad();
        let prediction = decoder.forward(latent.clone(), directions.clone());
        let log = Data::of(&prediction).values.as_chunks::<3>().0.to_vec();
        let (loss, by_output, exposure) = figure.evaluate(&log, *s as f32);
        losses.push(loss as f32);
        let [mse, cosine] = demo.display_terms(&log, *s as f32).expect("the demo's terms");
        let square = z.iter().map(|v| v * v).sum::<f64>() / z.len() as f64;
        terms.extend([mse, cosine, square].map(|v| v as f32));

        let by_output = Data::new([1, by_output.len(), 3], by_output.into_flattened());
        let by_output: Tensor<3> = by_output.tensor([1, by_output.values.len() / 3, 3], device);
        let gradients = (prediction * by_output).sum().backward();
        let gradient = Data::of(&latent.grad(&gradients).expect("a gradient of the latent"));
        let mut gradient: Vec<f64> = gradient.values.iter().map(|v| f64::from(*v)).collect();
        gradient.push(exposure);
        if step == 1 {
            let latent = Data::new([n, 3], gradient[..3 * n].iter().map(|v| *v as f32).collect());
            case.compare("out.grad0.latent", &latent);
            case.compare("out.grad0.scale", &Data::new([1], vec![exposure as f32]));
            // At latent 0 the light is the same all around z, and so is the rendering seen along z: the x and y of this
            // gradient are 0 but for the reference's rounding, of which Adam makes full steps. So it is taken from them.
            let recorded = case.data("out.grad0.latent").values.iter();
            gradient.iter_mut().zip(recorded).for_each(|(g, r)| *g = f64::from(*r));
        }
        let (bias1, bias2) = (1.0 - 0.9f64.powi(step), 1.0 - 0.999f64.powi(step));
        for ((x, [m, v]), g) in variables.iter_mut().zip(&mut moments).zip(gradient) {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            *x -= number("lr") * (*m / bias1) / ((*v / bias2).sqrt() + 1e-8);
        }
    }
    case.compare("out.losses", &Data::new([losses.len()], losses));
    case.compare("out.demo_terms", &Data::new([terms.len() / 3, 3], terms));
    let final_values: Vec<f32> = variables.iter().map(|v| *v as f32).collect();
    case.compare("out.latent10", &Data::new([n, 3], final_values[..3 * n].to_vec()));
    case.compare("out.scale10", &Data::new([1], final_values[3 * n..].to_vec()));
}

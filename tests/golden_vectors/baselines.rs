//! The reference implementation's baselines: spherical harmonics and spherical Gaussians, as fields, of images, and ten
//! steps of a fit.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared};
use burn::tensor::Device;
use veni::eval::baseline::Adam;
use veni::eval::baseline::gaussians::reference::LobeGrid;
use veni::eval::baseline::harmonics::{Basis, reference};
use veni::sphere::Equirect;
use veni::sphere::reference::decoder_directions;

/// See [`Family`](crate::Family). No tensors: the device plays no part.
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    match case.module() {
        "SphericalHarmonicIlluminationField" => harmonics_field(case),
        "getCoefficientsFromImage/shReconstructSignal" => harmonics_image(case),
        "SphericalGaussianField" => gaussians_field(case),
        "SH field fitted to a log image" => {
            let order = case.size("order").expect("an order");
            fit(
                case,
                |d, x| reference::field(d, x.as_chunks::<3>().0, order),
                |d, _, probe| reference::field_gradient(d, probe, order).into_flattened(),
            );
        }
        "SG field fitted to a log image" => {
            let grid = gaussian_grid(case);
            starts_as_the_reference(case, &grid.start());
            fit(case, |d, x| grid.log_radiance(d, x), |d, x, probe| grid.gradient(d, x, probe));
        }
        _ => return None,
    }
    Some(Compared)
}

fn wide(data: &Data) -> Vec<f64> {
    data.values.iter().map(|&v| f64::from(v)).collect()
}

fn triples(data: &Data) -> Vec<[f64; 3]> {
    data.values.as_chunks::<3>().0.iter().map(|v| v.map(f64::from)).collect()
}

fn compare(case: &Case, name: &str, ours: &[f64]) {
    let values = ours.iter().map(|v| *v as f32).collect();
    case.compare(name, &Data::new(case.data(name).shape.clone(), values));
}

fn harmonics_field(case: &Case) {
    let order = case.size("order").expect("an order");
    let directions = case.data("in.directions").values.as_chunks::<3>().0;
    let field = reference::field(directions, &triples(case.data("in.coeffs")), order);
    compare(case, "out.radiance", field.as_flattened());
    let gradient = reference::field_gradient(directions, &triples(case.data("probe.radiance")), order);
    compare(case, "grad.in.coeffs", gradient.as_flattened());
}

fn harmonics_image(case: &Case) {
    let image = case.data("in.image");
    let grid = Equirect::new(image.shape[1], image.shape[0]);
    let pixels = image.values.as_chunks::<3>().0;
    let orders = case.tensors.keys().filter_map(|name| name.strip_prefix("out.sh_coeffs_l"));
    for order in orders.map(|order| order.parse().expect("out.sh_coeffs_l<order>")) {
        let coefficients = reference::project(grid, pixels, order);
        compare(case, &format!("out.sh_coeffs_l{order}"), coefficients.as_flattened());
        let image = reference::reconstruct(grid, &coefficients, order);
        compare(case, &format!("out.sh_recon_l{order}"), image.as_flattened());
    }
    let rows: Vec<_> = (0..grid.height).map(|row| grid.solid_angle(row)).collect();
    compare(case, "out.solid_angle", &rows);
    let name = "out.basis_l2_or_3";
    let [height, width, functions] = case.data(name).shape[..] else { panic!("a basis image") };
    let basis = Basis::new(functions.isqrt() - 1);
    compare(case, name, &basis.matrix(&reference::corner_directions(Equirect::new(width, height))));
}

/// The files give rows and columns by what they are, not by the reference's option.
fn gaussian_grid(case: &Case) -> LobeGrid {
    let [columns, rows] = ["cols", "rows"].map(|n| case.size(n).expect("a size of the grid"));
    LobeGrid::from_row_col_gaussian_dims([columns, rows])
}

/// The recorded start is the one that the reference form documents.
fn starts_as_the_reference(case: &Case, start: &[f64]) {
    let recorded = wide(case.data("in.params0"));
    assert_eq!(recorded.len(), start.len(), "numbers to start from");
    assert!(recorded.iter().zip(start).all(|(a, b)| (a - b).abs() < 1e-7), "{recorded:?} and {start:?}");
}

/// Several images at once: every direction has the index of its image.
fn gaussians_field(case: &Case) {
    let grid = gaussian_grid(case);
    let parameters = case.data("in.params");
    let [images, numbers] = parameters.shape[..] else { panic!("parameters of images") };
    let directions = case.data("in.directions").values.as_chunks::<3>().0;
    let probe = triples(case.data("probe.log_radiance"));
    let index = &case.data("in.camera_index").values;
    let mut out = vec![[0.0; 3]; directions.len()];
    let mut gradient = Vec::with_capacity(images * numbers);
    for image in 0..images {
        let own: Vec<_> = (0..directions.len()).filter(|k| index[*k] as usize == image).collect();
        let d: Vec<_> = own.iter().map(|k| directions[*k]).collect();
        let p: Vec<_> = own.iter().map(|k| probe[*k]).collect();
        let x = &wide(parameters)[image * numbers..][..numbers];
        for (k, value) in own.iter().zip(grid.log_radiance(&d, x)) {
            out[*k] = value;
        }
        gradient.extend(grid.gradient(&d, x, &p));
    }
    compare(case, "out.log_radiance", out.as_flattened());
    compare(case, "grad.in.params", &gradient);
}

/// Adam at a constant rate on the mean squared error of log radiance.
fn fit(
    case: &Case,
    field: impl Fn(&[[f32; 3]], &[f64]) -> Vec<[f64; 3]>,
    gradient: impl Fn(&[[f32; 3]], &[f64], &[[f64; 3]]) -> Vec<f64>,
) {
    let image = case.data("in.image");
    let (target, directions) =
        (triples(image), decoder_directions(Equirect::new(image.shape[1], image.shape[0])));
    let number = |key: &str| case.number(key).unwrap_or_else(|| panic!("the configuration has no `{key}`"));
    let mut x = wide(case.data("in.params0"));
    let mut adam = Adam::new(x.len(), number("adam_eps"));
    let (steps, mut losses) = (case.size("steps").expect("a number of steps"), Vec::new());
    for step in 0..=steps {
        let render = field(&directions, &x);
        if step == 0 || step == steps {
            compare(case, &format!("out.render{step}"), render.as_flattened());
        }
        if step == steps {
            break;
        }
        let residual: Vec<_> =
            render.iter().zip(&target).map(|(r, t)| [0, 1, 2].map(|c| r[c] - t[c])).collect();
        let count = (3 * target.len()) as f64;
        losses.push(residual.as_flattened().iter().map(|r| r * r).sum::<f64>() / count);
        let probe: Vec<_> = residual.into_iter().map(|r| r.map(|r| 2.0 * r / count)).collect();
        let by_output = gradient(&directions, &x, &probe);
        if step == 0 {
            compare(case, "out.grad0", &by_output);
        }
        x.iter_mut().zip(adam.step(&by_output, number("lr"))).for_each(|(x, by)| *x += by);
    }
    compare(case, "out.losses", &losses);
    compare(case, &format!("out.params{steps}"), &x);
}

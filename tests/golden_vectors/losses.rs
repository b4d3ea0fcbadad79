//! Losses: the reference's forms against their numbers.

use crate::case::Case;
use crate::{Outcome, Outcome::Compared};
use burn::tensor::{Device, Tensor};
use veni::train::loss::mage::{self, Operator};
use veni::train::loss::stencil::{Coarsen, Edge, Filter, REFERENCE_VERTICAL, SCHARR_HORIZONTAL, StencilGrid};
use veni::train::loss::{Loss, LossConfig, LossForm, cosine, kld, mse, rows, scale_invariant};
use veni::train::schedule::WeightSchedule;

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    match case.module() {
        "VENIModel.get_loss_dict" => weighted(case, device),
        "MultiScaleDeriLoss" => mage_pieces(case, device),
        module if module.contains("KLD3") => pieces(case, device),
        _ => return None,
    }
    Some(Compared)
}

/// The reference implementation's names of the terms, of their weights in the file, and ours.
const TERMS: [(&str, &str, &str); 7] = [
    ("cosine_similarity_loss", "cosine", "cosine"),
    ("scale_inv_loss", "scale_inv", "scale_invariant"),
    ("multi_scale_derivative_loss", "mage", "mage"),
    ("kld_loss", "kld", "kld"),
    ("log_mse_loss", "log_mse", "log_mse"),
    ("hdr_mse_loss", "hdr_mse", "hdr_mse"),
    ("ldr_mse_loss", "ldr_mse", "ldr_mse"),
];

/// The whole loss with its weights.
fn weighted(case: &Case, device: &Device) {
    let weight = |key: &str| {
        let weights = case.config.get("weights").expect("a map of weights in the configuration");
        WeightSchedule::Constant(weights.get(key).and_then(serde_json::Value::as_f64).unwrap_or(0.0))
    };
    let config = LossConfig {
        form: LossForm::Reference,
        mage_scales: case.size("scales").unwrap_or(2),
        mage: weight("mage"),
        scale_invariant: weight("scale_inv"),
        exposure: WeightSchedule::Constant(0.0),
        cosine: weight("cosine"),
        kld: weight("kld"),
        log_mse: weight("log_mse"),
        hdr_mse: weight("hdr_mse"),
        ldr_mse: weight("ldr_mse"),
        irradiance: WeightSchedule::Constant(0.0),
    };
    let [_, height, width, _] = case.data("in.pred").shape[..] else {
        panic!("in.pred is not a batch of images")
    };
    let loss = Loss::new(&config, height, width, device);
    let input = |name: &str| case.get(name).map(|_| ());
    let prediction = case.tensor::<4>("in.pred", device).require_grad();
    let posterior = input("in.mu").map(|()| {
        let [mean, log_variance] = ["in.mu", "in.logvar"].map(|n| case.tensor::<3>(n, device).require_grad());
        (mean, log_variance)
    });
    let target = case.tensor::<4>("in.target", device);
    let terms = loss.terms(0, prediction.clone(), target, posterior.clone());

    // Their total has the paper's four terms only.
    let mut total: Option<Tensor<1>> = None;
    for (theirs, _, ours) in TERMS {
        let Some(value) = terms.get(ours) else { continue };
        if !ours.ends_with("mse") {
            total = Some(total.map_or(value.clone(), |t| t + value.clone()));
        }
        let output = format!("out.weighted.{theirs}");
        if case.expects(&output) {
            case.compare_tensor(&output, value);
        }
        let name = |input: &str| format!("grad.{theirs}.{input}");
        let leaves = ["pred", "mu", "logvar"].map(name);
        if leaves.iter().all(|n| !case.expects(n)) {
            continue;
        }
        let gradients = value.backward();
        if case.expects(&leaves[0]) {
            case.compare_tensor(
                &leaves[0],
                &prediction.grad(&gradients).expect("a gradient of the prediction"),
            );
        }
        for (leaf, tensor) in leaves[1..].iter().zip(posterior.iter().flat_map(|(m, l)| [m, l])) {
            if case.expects(leaf) {
                case.compare_tensor(leaf, &tensor.grad(&gradients).expect("a gradient of the posterior"));
            }
        }
    }
    if case.expects("out.total") {
        case.compare_tensor("out.total", &total.expect("at least one term"));
    }
}

/// `out.<operator>_<scales>_<plain|ssi>` and the raw filters, on [B, C, H, W].
fn mage_pieces(case: &Case, device: &Device) {
    let [batch, channels, height, width] = case.data("in.pred").shape[..] else {
        panic!("in.pred is not a batch")
    };
    let planes = |x: Tensor<4>| x.reshape([batch * channels, height, width]);
    let target = planes(case.tensor::<4>("in.target", device));
    for name in case.tensors.keys().filter_map(|n| n.strip_prefix("out.")) {
        let prediction = case.tensor::<4>("in.pred", device).require_grad();
        let grid = StencilGrid {
            size: [height, width],
            channels: 1,
            factor: 1,
            coarsen: Coarsen::Stride,
            horizontal_edge: Edge::Valid,
        };
        let stencil = match name {
            "scharr_x" => Some(SCHARR_HORIZONTAL),
            "scharr_y" => Some(REFERENCE_VERTICAL),
            _ => None,
        };
        if let Some(stencil) = stencil {
            let ours = Filter::new(stencil, grid, device).apply(planes(prediction));
            case.compare_tensor(&format!("out.{name}"), &ours);
            continue;
        }
        let [operator, scales, kind] = name.split('_').collect::<Vec<_>>()[..] else { continue };
        let operator = match operator {
            "scharr" => Operator::Scharr,
            "laplace" => Operator::Laplace,
            _ => continue,
        };
        let (Ok(scales), true) = (scales.parse(), ["plain", "ssi"].contains(&kind)) else { continue };
        let value = mage::reference_planes(
            planes(prediction.clone()),
            target.clone(),
            operator,
            scales,
            kind == "ssi",
        );
        case.compare_tensor(&format!("out.{name}"), &value);
        let leaf = format!("grad.{name}");
        if case.expects(&leaf) {
            let gradients = value.backward();
            case.compare_tensor(&leaf, &prediction.grad(&gradients).expect("a gradient of the prediction"));
        }
    }
}

/// Single losses without weights.
fn pieces(case: &Case, device: &Device) {
    let image = |name: &str| case.tensor::<4>(name, device);
    let (a, b) = (image("in.a"), image("in.b"));
    let posterior = |name: &str| case.tensor::<3>(name, device);
    let no_mask = || rows::reference(a.dims()[1], device).ones_like();
    let fraction = case.module().split("topx=").nth(1).and_then(|t| t.split(')').next()?.parse::<f64>().ok());
    let check = |name: &str, value: &dyn Fn() -> crate::case::Data| {
        if case.expects(name) {
            case.compare(name, &value());
        }
    };
    use crate::case::Data;
    check("out.kld3", &|| Data::of(&kld::isotropic(posterior("in.mu"), posterior("in.logvar"))));
    check("out.reni_kld", &|| Data::of(&kld::per_coordinate(posterior("in.mu"), posterior("in.logvar3"))));
    check("out.reni_cosine", &|| Data::of(&cosine::rays(a.clone(), b.clone())));
    check("out.reni_scale_inv", &|| Data::of(&scale_invariant::rays(a.clone(), b.clone())));
    let per_channel = || scale_invariant::reference(a.clone(), b.clone(), no_mask());
    check("out.veni_scale_inv_none", &|| Data::of(&per_channel()));
    check("out.veni_scale_inv_mean", &|| Data::of(&per_channel().mean()));
    check("out.masked_top10_mse", &|| {
        let fraction = fraction.expect("the fraction topx in the module's name");
        Data::of(&mse::brightest(LossForm::Reference, fraction, a.clone(), b.clone()))
    });
}

//! Image metrics and rank correlation.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared};
use burn::tensor::Device;
use veni::panorama::metrics::{Alignment, log_factor, pearson, psnr, scores, spearman, ssim};
use veni::panorama::tonemap::{quantile, srgb, srgb_q98};

/// See [`Family`](crate::Family). No gradients and no tensors: the device plays no part.
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    if case.module().starts_with("Spearman rank correlation") {
        correlation(case);
    } else if case.module() == "metrics" {
        images(case);
    } else {
        return None;
    }
    Some(Compared)
}

/// `out.<kind>_<ab>`: the inputs are named by one letter each.
fn correlation(case: &Case) {
    for name in case.tensors.keys().filter(|n| n.starts_with("out.")) {
        let (kind, pair) = name["out.".len()..].rsplit_once('_').expect("a name like spearman_ab");
        let [a, b] = [&pair[..1], &pair[1..]].map(|n| wide(case.data(&format!("in.{n}"))));
        let ours = match kind {
            "spearman" => spearman(&a, &b),
            "pearson" => pearson(&a, &b),
            _ => continue,
        };
        case.compare_scalar(name, ours.expect("a defined correlation"));
    }
}

fn wide(data: &Data) -> Vec<f64> {
    data.values.iter().map(|&v| f64::from(v)).collect()
}

/// [1, C, H, W] to [H, W, C].
fn channels_last(data: &Data) -> (Vec<f64>, [usize; 3]) {
    let [1, channels, height, width] = data.shape[..] else {
        panic!("{:?} is not one planar image", data.shape)
    };
    let plane = height * width;
    let values = (0..plane).flat_map(|k| (0..channels).map(move |c| f64::from(data.values[c * plane + k])));
    (values.collect(), [height, width, channels])
}

fn images(case: &Case) {
    let scalar = |name: &str, value: &dyn Fn() -> f64| {
        if case.expects(name) {
            case.compare_scalar(name, value());
        }
    };
    let image = |name: &str, value: &dyn Fn() -> Vec<f32>| {
        if let Some(golden) = case.get(name) {
            case.compare(name, &Data::new(golden.shape.clone(), value()));
        }
    };
    let (prediction, target) = (case.data("in.pred_log"), case.data("in.gt_log"));
    let [height, width, 3] = target.shape[..] else { panic!("in.gt_log is not an image") };
    let radiance = |log: &[f64]| log.iter().map(|v| v.exp()).collect::<Vec<_>>();
    let gt = radiance(&wide(target));
    let aligned = radiance(&Alignment::LogFactor.apply(&prediction.values, &target.values, height));

    scalar("out.scale", &|| log_factor(&prediction.values, &target.values));
    scalar("out.train_psnr", &|| psnr(&aligned, &gt));
    let [narrow_aligned, narrow_gt] =
        [&aligned, &gt].map(|x| x.iter().map(|v| *v as f32).collect::<Vec<_>>());
    scalar("out.pred_q98", &|| f64::from(quantile(&narrow_aligned, 0.98)));
    scalar("out.gt_q98", &|| f64::from(quantile(&narrow_gt, 0.98)));
    image("out.pred_srgb", &|| srgb_q98(&narrow_aligned).0);
    image("out.gt_srgb", &|| srgb_q98(&narrow_gt).0);
    image("out.srgb_noq", &|| narrow_gt.iter().map(|v| srgb(*v).clamp(0.0, 1.0)).collect());
    image("out.srgb_q2_noclamp", &|| narrow_gt.iter().map(|v| srgb(v / 2.0)).collect());
    for (prefix, alignment) in [("scaled", Alignment::LogFactor), ("unscaled", Alignment::None)] {
        let s = scores(&prediction.values, &target.values, height, width, alignment);
        scalar(&format!("out.{prefix}.psnr_hdr"), &|| s.hdr_psnr);
        scalar(&format!("out.{prefix}.psnr_ldr"), &|| s.ldr_psnr);
        scalar(&format!("out.{prefix}.ssim_hdr"), &|| s.hdr_ssim);
        scalar(&format!("out.{prefix}.ssim_ldr"), &|| s.ssim);
    }
    scalar("out.ldr_psnr", &|| {
        psnr(&channels_last(case.data("in.ldr_b")).0, &channels_last(case.data("in.ldr_target_for_psnr")).0)
    });
    scalar("out.ldr_ssim", &|| {
        let (b, shape) = channels_last(case.data("in.ldr_b"));
        ssim(&b, &channels_last(case.data("in.ldr_a")).0, shape)
    });
    scalar("out.neg_psnr", &|| {
        let target = wide(case.data("in.neg_target"));
        psnr(&target.iter().map(|v| 0.5 * v).collect::<Vec<_>>(), &target)
    });
}

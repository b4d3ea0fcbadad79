//! The harness itself: the filler's published values, the tolerance rule, and that it can fail.

use crate::case::{Case, Data};
use crate::compare::{Tolerance, check};
use crate::filler;
use crate::report::{Verdict, case_files, run_case};
use burn::tensor::Device;

#[test]
fn filler_gives_the_published_values() {
    let first: Vec<f64> = filler::uniform("abc", 5).take(3).collect();
    assert_eq!(first, [0.284_056_507_657_906_9, -0.871_570_389_645_170_5, 0.788_673_614_510_120_7]);
}

#[test]
fn deviations_beyond_the_tolerance_are_counted() {
    let golden = Data::new([2, 2], vec![1.0, 2.0, 3.0, 4.0]);
    let tolerance = Tolerance::UNKNOWN;
    assert!(check(&golden, &golden, tolerance).is_ok());
    let within = Data::new([2, 2], vec![1.0, 2.0, 3.0, 4.00003]);
    assert!(check(&within, &golden, tolerance).is_ok());
    let beyond = Data::new([2, 2], vec![1.0, 2.1, 3.0, 4.5]);
    let message = check(&beyond, &golden, tolerance).unwrap_err();
    assert!(message.starts_with("2 of 4 elements fail; worst at [1, 1]"), "{message}");
    for bad in [f32::NAN, f32::INFINITY] {
        let broken = Data::new([2, 2], vec![1.0, 2.0, bad, 4.0]);
        assert!(check(&broken, &golden, tolerance).unwrap_err().starts_with("1 of 4"));
    }
    assert!(check(&Data::new([3], vec![1.0; 3]), &golden, tolerance).is_err());
}

#[test]
fn a_case_of_an_unknown_kind_fails() {
    let path = crate::folder().join("c02_vn_linear_0.safetensors");
    // a folder of other cases may lack it
    let Some(mut case) = path.is_file().then(|| Case::load(&path).expect("a readable case")) else { return };
    case.config["module"] = "VNCircular".into();
    match run_case(&case, &Device::flex().autodiff()) {
        Verdict::Failed(messages) => assert!(messages[0].contains("VNCircular"), "{messages:?}"),
        other => panic!("{other:?}"),
    }
}

/// A weight of every small case is moved, and the harness must see it.
#[test]
fn a_perturbed_weight_is_noticed() {
    let device = Device::flex().autodiff();
    let folder = crate::folder();
    let mut perturbed = 0;
    for path in case_files(&folder) {
        let small = std::fs::metadata(&path).is_ok_and(|m| m.len() < 100_000);
        let Some(case) = small.then(|| Case::load(&path).ok()).flatten() else { continue };
        // The element on which the outputs depend most, by the file's own gradients.
        let gradients = case.tensors.iter().filter_map(|(name, g)| Some((name.strip_prefix("grad.")?, g)));
        let parameters = gradients.filter(|(name, _)| name.starts_with("param.") && case.expects(name));
        let elements =
            parameters.flat_map(|(name, g)| g.values.iter().enumerate().map(move |(i, v)| (name, i, *v)));
        let Some((name, index, _)) = elements.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs())) else {
            continue;
        };
        let name = name.to_owned();
        if !matches!(run_case(&case, &device), Verdict::Passed(_)) {
            continue;
        }
        let mut wrong = Case::load(&path).expect("it was read before");
        let weights = &mut wrong.tensors.get_mut(&name).expect("it was found above").values;
        let largest = weights.iter().fold(0.1f32, |m, w| m.max(w.abs()));
        weights[index] += 0.05 * largest;
        match run_case(&wrong, &device) {
            Verdict::Failed(messages) => {
                assert!(messages.iter().any(|m| m.contains("elements fail")), "{}: {messages:?}", case.name);
            }
            other => panic!("{}: {name}[{index}] was moved, and the verdict is {other:?}", case.name),
        }
        perturbed += 1;
    }
    // A folder of other cases may hold none with weights; ours does.
    let ours = std::env::var_os("VENI_GOLDEN_DIR").is_none();
    assert!(perturbed >= 8 || !ours, "only {perturbed} cases with weights");
}

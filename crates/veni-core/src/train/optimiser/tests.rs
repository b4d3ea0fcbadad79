use super::*;
use burn::module::Param;
use burn::tensor::{Device, Tensor};

#[derive(Module, Debug)]
struct Part {
    x: Param<Tensor<1>>,
}

#[derive(Module, Debug)]
struct Toy {
    a: Part,
    b: Part,
}

fn toy() -> Toy {
    let device = Device::flex().autodiff();
    let part = |values: [f32; 2]| Part { x: Param::from_tensor(Tensor::from_floats(values, &device)) };
    Toy { a: part([1.0, -2.0]), b: part([3.0, 0.5]) }
}

fn groups() -> Vec<Group> {
    let adam = AdamConfig { clip: Some(0.5), ..AdamConfig::default() };
    let decayed = AdamConfig { clip: None, weight_decay: 0.1, ..adam };
    vec![Group { prefix: "a".into(), adam }, Group { prefix: "b".into(), adam: decayed }]
}

/// loss = Σ a² + Σ b³
fn gradients(toy: &Toy) -> Gradients {
    let (a, b) = (toy.a.x.val(), toy.b.x.val());
    ((a.clone() * a).sum() + (b.clone() * b.clone() * b).sum()).backward()
}

#[test]
fn two_steps_match_the_formula_in_double_precision() {
    let mut toy = toy();
    let mut optimiser = Optimiser::new(&toy, groups(), 0.9).unwrap();
    let rates = [0.1, 0.01];
    let (mut a, mut b) = ([1.0_f64, -2.0], [3.0_f64, 0.5]);
    let (mut m, mut v) = ([0.0_f64; 4], [0.0_f64; 4]);
    for t in 1..=2 {
        let ga = a.map(|x| 2.0 * x);
        let norm = (ga[0] * ga[0] + ga[1] * ga[1]).sqrt();
        let clip = (0.5 / (norm + 1e-6)).min(1.0);
        let g = [ga[0] * clip, ga[1] * clip, 3.0 * b[0] * b[0], 3.0 * b[1] * b[1]];
        for i in 0..4 {
            m[i] = 0.9 * m[i] + 0.1 * g[i];
            v[i] = 0.999 * v[i] + 0.001 * g[i] * g[i];
            let hat = (m[i] / (1.0 - 0.9_f64.powi(t))) / ((v[i] / (1.0 - 0.999_f64.powi(t))).sqrt() + 1e-8);
            if i < 2 {
                a[i] -= rates[0] * hat;
            } else {
                b[i - 2] -= rates[1] * 0.1 * b[i - 2];
                b[i - 2] -= rates[1] * hat;
            }
        }
        let report;
        let grads = gradients(&toy);
        (toy, report) = optimiser.step(toy, &grads, &rates);
        assert!((report[0].gradient_norm - norm).abs() < 1e-5);
    }
    let close = |ours: &Param<Tensor<1>>, want: [f64; 2]| {
        let ours: Vec<f32> = ours.val().into_data().try_into_vec().unwrap();
        assert!(ours.iter().zip(want).all(|(o, w)| (f64::from(*o) - w).abs() < 1e-6), "{ours:?} {want:?}");
    };
    close(&toy.a.x, a);
    close(&toy.b.x, b);
    assert_eq!(optimiser.updates(), 2);
}

#[test]
fn restored_state_continues_to_the_bit() {
    let run = |toy: Toy, optimiser: &mut Optimiser, steps| {
        (0..steps).fold(toy, |toy, _| {
            let grads = gradients(&toy);
            optimiser.step(toy, &grads, &[0.1, 0.01]).0
        })
    };
    let mut straight = Optimiser::new(&toy(), groups(), 0.9).unwrap();
    run(toy(), &mut straight, 4);
    let mut first = Optimiser::new(&toy(), groups(), 0.9).unwrap();
    run(toy(), &mut first, 2);
    let mut second = Optimiser::new(&toy(), groups(), 0.9).unwrap();
    second.restore(first.state(), first.updates()).unwrap();
    let module = weights::write(toy(), "", second.weights()).unwrap();
    run(module, &mut second, 2);
    assert_eq!(straight, second);
    // and the average is neither the start nor the end
    let averages = straight.averages();
    assert_ne!(averages, *straight.weights());
}

#[test]
fn damaged_state_is_refused_by_name() {
    let mut optimiser = Optimiser::new(&toy(), groups(), 0.9).unwrap();
    let mut state = optimiser.state();
    state.remove("first.a.x");
    let message = optimiser.restore(state, 1).unwrap_err().to_string();
    assert!(message.contains("first.a.x"), "{message}");
    let mut state = optimiser.state();
    state.insert("weight.c".into(), Array { shape: vec![1], data: vec![0.0] });
    assert!(optimiser.restore(state, 1).unwrap_err().to_string().contains("weight.c"));
    let orphan = Optimiser::new(&toy(), groups()[..1].to_vec(), 0.9).unwrap_err().to_string();
    assert!(orphan.contains("b.x"), "{orphan}");
}

//! An evaluator that is warm allocates nothing per direction.

#![allow(
    unsafe_code,
    reason = "an allocator that counts is an unsafe trait; it hands every call on to the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use veni_light::latent::{Latent, Prior};
use veni_light::model::{Model, ModelConfig};

/// The system's allocator, which counts the calls of each thread.
struct Counting;

thread_local! {
    static CALLS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator with the arguments that came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.with(|calls| calls.set(calls.get() + 1));
        // SAFETY: the caller's promises about `layout` are handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: `block` came from the system's allocator with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_warm_evaluator_allocates_nothing() {
    let model = Model::filler(&ModelConfig::decode_only(9), 1).unwrap();
    let field = model.decoder().unwrap().condition(&Latent::from_seed(&Prior::standard(9), 7)).unwrap();
    let mut evaluator = field.evaluator();
    let direction = |k: usize| {
        let (sin, cos) = (k as f32 * 0.1).sin_cos();
        [0.6 * cos, 0.6 * sin, 0.8]
    };
    let directions: Vec<_> = (0..500).map(direction).collect();
    let mut out = vec![[0.0; 3]; directions.len()];
    let mut pass = |evaluator: &mut veni_light::field::Evaluator| {
        let before = CALLS.with(Cell::get);
        let sum: f32 =
            directions.iter().map(|d| evaluator.radiance(*d)[0] + evaluator.log_radiance(*d)[1]).sum();
        evaluator.radiance_batch(&directions, &mut out);
        (CALLS.with(Cell::get) - before, sum)
    };
    let (first, sum) = pass(&mut evaluator);
    assert!(first > 0, "the counter counts");
    assert_eq!(pass(&mut evaluator), (0, sum));
    // the field's own function, which has no workspace to keep, gives the same bits
    for (d, found) in directions.iter().zip(&out) {
        assert_eq!(field.radiance(*d), *found);
    }
}

//! The harness itself: the filler's published values, the tolerance rule, and that it can fail.

use crate::case::Data;
use crate::compare::{Tolerance, check};
use crate::filler;

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

//! No kernels: this processor's have not been written, or nothing is trained in this build.

use super::{Bfloat16, PANEL, Pairs, Row, Wide, WidePairs};

pub(super) fn detected() -> bool {
    false
}

pub(super) fn product<const ADD: bool, const RELU: bool>(
    matrix: &Pairs,
    _bias: &[[f32; PANEL]],
    _x: &[Row],
    _y: &mut [[Row; PANEL]],
) {
    never(matrix.token)
}

pub(super) fn transpose(token: Bfloat16, _rows: &[Row], _out: &mut [WidePairs]) {
    never(token)
}

pub(super) fn add(token: Bfloat16, _x: &[Row], _gradient: &[WidePairs], _sums: &mut [Wide]) {
    never(token)
}

fn never(token: Bfloat16) -> ! {
    unreachable!("{token:?} exists where it was detected")
}

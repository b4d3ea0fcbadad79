//! The widest vectors that the processor has.

use pulp::WithSimd;

/// Does `work` with them.
pub(super) fn dispatch<W: WithSimd>(work: W) -> W::Output {
    #[cfg(test)]
    match narrow::CHOSEN.load(std::sync::atomic::Ordering::Relaxed) {
        narrow::SCALAR => return pulp::Simd::vectorize(pulp::Scalar::new(), work),
        #[cfg(target_arch = "x86_64")]
        narrow::V3 => {
            if let Some(simd) = pulp::x86::V3::try_new() {
                return pulp::Simd::vectorize(simd, work);
            }
        }
        _ => {}
    }
    pulp::Arch::new().dispatch(work)
}

/// Narrower vectors than this processor's, for tests of what other processors would compute. Tests beside use them
/// too while they are chosen: all results are right up to rounding.
#[cfg(test)]
pub(super) mod narrow {
    use std::sync::atomic::AtomicU8;

    /// The widest.
    pub(crate) const NONE: u8 = 0;
    /// One number.
    pub(crate) const SCALAR: u8 = 1;
    /// AVX2: 8 numbers in 16 registers.
    pub(crate) const V3: u8 = 3;
    /// The choice.
    pub(crate) static CHOSEN: AtomicU8 = AtomicU8::new(NONE);
}

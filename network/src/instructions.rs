//! Which vector instructions the kernels use on this machine: chosen once, when the program runs.

use std::sync::LazyLock;

static ARCH: LazyLock<pulp::Arch> = LazyLock::new(pulp::Arch::new);

/// Runs `pass` compiled for the widest vector instructions of this machine. `pass` must inline, or it is compiled for any machine.
#[inline(always)]
pub fn vectorised<R>(pass: impl FnOnce() -> R) -> R {
    ARCH.dispatch(pass)
}

/// The instructions of the passes over rows (activations, softmax, grids): what the `pulp` crate finds.
pub fn pass_instructions() -> &'static str {
    match *ARCH {
        #[cfg(target_arch = "x86_64")]
        pulp::Arch::V4(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        pulp::Arch::V3(_) => "AVX2 with FMA",
        #[cfg(target_arch = "aarch64")]
        pulp::Arch::Neon(_) => "NEON",
        _ => "none",
    }
}

/// The instructions of the matrix products: what the `gemm` crate chooses.
pub fn product_instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx512f") {
        return "AVX-512";
    } else if std::arch::is_x86_feature_detected!("fma") {
        return "AVX2 with FMA";
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        return "NEON";
    }
    "none"
}

#[cfg(test)]
mod tests {
    use super::*;

    // Both choose the widest that there is; a machine with AVX-512F alone would be the exception.
    #[test]
    fn passes_and_products_use_the_same_instructions() {
        assert_eq!(pass_instructions(), product_instructions());
    }
}

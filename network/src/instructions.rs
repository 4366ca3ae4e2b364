//! Which vector instructions the matrix products use on this machine.

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
    use xavatar_vector::pass_instructions;

    use super::*;

    // Both choose the widest that there is; a machine with AVX-512F alone would be the exception.
    #[test]
    fn passes_and_products_use_the_same_instructions() {
        assert_eq!(pass_instructions(), product_instructions());
    }
}

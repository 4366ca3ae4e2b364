//! Which vector instructions the kernels use on this machine: chosen once, when the program runs.

use std::sync::LazyLock;

static ARCH: LazyLock<pulp::Arch> = LazyLock::new(pulp::Arch::new);

/// Runs `pass` compiled for the widest vector instructions of this machine. `pass` must inline, or it is compiled for any machine.
#[inline(always)]
pub fn vectorised<R>(pass: impl FnOnce() -> R) -> R {
    ARCH.dispatch(pass)
}

/// The instructions that [`vectorised`] passes are compiled for: what the `pulp` crate finds.
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

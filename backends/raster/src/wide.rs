//! Are there wide registers? Kernels are compiled for both answers and give the same bytes.

/// Tells whether kernels compiled for AVX2 can be called.
#[cfg(target_arch = "x86_64")]
pub(crate) fn has_avx2() -> bool {
    #[cfg(test)]
    if PLAIN.load(std::sync::atomic::Ordering::Relaxed) {
        return false;
    }
    std::arch::is_x86_feature_detected!("avx2")
}

/// Keeps all tests to plain registers, whose bytes are the same.
#[cfg(test)]
pub(crate) static PLAIN: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);

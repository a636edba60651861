//! One body of code, compiled for several instruction sets; the best one this machine has is run.
//!
//! A [`Task`] is plain safe Rust over integers, inlined into a function per instruction set, so the
//! compiler vectorises it with that set's registers. Integer arithmetic has one right answer, and
//! the few floats here are never reassociated, so all versions give the same bits by construction
//! (and by the test of `response`). On aarch64 NEON is part of the base set: `Portable` is NEON.
//!
//! The only unsafe code of this room. It is needed since a function that uses instructions the
//! machine may lack can only be called so; `cargo bench -p workers` prints what it buys.
#![allow(unsafe_code)]

/// Which instructions a task may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Simd {
    /// What every machine of this architecture has: SSE2 on x86-64, NEON on aarch64.
    Portable,
    /// 256 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512 bits, with 8- and 16-bit integers.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// Something to be computed.
pub trait Task {
    /// Computes it. Mark it, and what it calls in inner loops, `#[inline(always)]`.
    fn run(self);
}

impl Simd {
    /// Those this machine has, slowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = [
            Self::Portable,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512,
        ];
        all.into_iter().filter(|simd| simd.is_there()).collect()
    }

    /// Whether this machine has all that the functions below are compiled with.
    fn is_there(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512vl")
            }
        }
    }

    /// The fastest this machine has.
    #[must_use]
    pub fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }

    /// What it is called.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "AVX-512",
        }
    }

    /// Runs a task.
    ///
    /// # Panics
    /// When this machine has no such instructions.
    #[inline]
    pub fn run(self, task: impl Task) {
        assert!(self.is_there(), "a machine with {}", self.name());
        match self {
            Self::Portable => task.run(),
            // SAFETY: the instructions were found on this machine just now.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { run_avx2(task) },
            // SAFETY: the instructions were found on this machine just now.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { run_avx512(task) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(task: impl Task) {
    task.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512bw,avx512vl")]
fn run_avx512(task: impl Task) {
    task.run();
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Sum<'a>(&'a [u8], &'a mut u32);

    impl Task for Sum<'_> {
        #[inline(always)]
        fn run(self) {
            *self.1 = self.0.iter().map(|byte| u32::from(*byte)).sum();
        }
    }

    // Small enough for Miri: `RUSTFLAGS="-C target-feature=+avx2" cargo +nightly miri test -p
    // workers --lib dispatch` looks into the unsafe calls.
    #[test]
    fn every_version_that_is_there_computes_the_same() {
        let bytes: Vec<u8> = (0..=255).cycle().take(1000).collect();
        let expected = bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>();
        let available = Simd::available();
        assert_eq!(available[0], Simd::Portable);
        for simd in available {
            let mut sum = 0;
            simd.run(Sum(&bytes, &mut sum));
            assert_eq!(sum, expected, "{}", simd.name());
        }
    }
}

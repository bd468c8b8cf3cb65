//! The choice of the instruction set at run time.

/// An instruction set that the kernels are compiled for. NEON is part of the base of its targets: there, `Portable` uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simd {
    /// What the target guarantees.
    Portable,
    /// AVX2: eight lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, BW, DQ and VL: sixteen lanes, masks and twice the registers.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Simd {
    /// Every instruction set of this machine, the widest last.
    pub(super) fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "only x86-64 has more than one")]
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                sets.push(Self::Avx2);
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                {
                    sets.push(Self::Avx512);
                }
            }
        }
        sets
    }

    /// The widest instruction set of this machine.
    pub(super) fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }
}

/// Defines a function that takes a [`Simd`] first and runs `$body`, an `#[inline(always)]` function, compiled for that instruction set.
///
/// No set brings a fused multiply-add into the code: the compiler never contracts `a * b + c` by itself. So all give the same bits.
macro_rules! dispatched {
    ($(#[$meta:meta])* $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? = $body:expr) => {
        $(#[$meta])*
        #[allow(clippy::too_many_arguments, reason = "a kernel takes plain slices")]
        pub(super) fn $name(simd: $crate::sift::simd::Simd, $($arg: $ty),*) $(-> $ret)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[allow(clippy::too_many_arguments, reason = "a kernel takes plain slices")]
            fn avx2($($arg: $ty),*) $(-> $ret)? {
                $body($($arg),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,avx512f,avx512bw,avx512dq,avx512vl")]
            #[allow(clippy::too_many_arguments, reason = "a kernel takes plain slices")]
            fn avx512($($arg: $ty),*) $(-> $ret)? {
                $body($($arg),*)
            }
            match simd {
                $crate::sift::simd::Simd::Portable => $body($($arg),*),
                // SAFETY: these variants are only made by `Simd::available` where the machine has the instructions.
                #[cfg(target_arch = "x86_64")]
                $crate::sift::simd::Simd::Avx2 => unsafe { avx2($($arg),*) },
                #[cfg(target_arch = "x86_64")]
                $crate::sift::simd::Simd::Avx512 => unsafe { avx512($($arg),*) },
            }
        }
    };
}
pub(super) use dispatched;

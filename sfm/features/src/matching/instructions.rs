//! The choice of the instruction set at run time.

use super::portable::Portable;
use super::scan::{Neighbours, scan};
use scene::Descriptor;

#[cfg(target_arch = "aarch64")]
use super::arm;
#[cfg(target_arch = "x86_64")]
use super::x86;

/// An instruction set that the scan is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instructions {
    /// What the target guarantees.
    Portable,
    /// AVX2: 16 products of 16 bits an instruction.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-VNNI: 32 products of 8 bits.
    #[cfg(target_arch = "x86_64")]
    AvxVnni,
    /// AVX-512 BW: 32 products of 16 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512Bw,
    /// AVX-512 VNNI: 64 products of 8 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512Vnni,
    /// Neon.
    #[cfg(target_arch = "aarch64")]
    Neon,
    /// Neon with dot products: 16 products of 8 bits.
    #[cfg(target_arch = "aarch64")]
    NeonDot,
}

impl Instructions {
    /// Those that this machine has, the quickest last.
    pub(super) fn available() -> Vec<Self> {
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            sets.push(Self::Avx2);
            if is_x86_feature_detected!("avxvnni") {
                sets.push(Self::AvxVnni);
            }
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") {
                sets.push(Self::Avx512Bw);
                if is_x86_feature_detected!("avx512vnni") {
                    sets.push(Self::Avx512Vnni);
                }
            }
        }
        #[cfg(target_arch = "aarch64")]
        {
            sets.push(Self::Neon);
            if std::arch::is_aarch64_feature_detected!("dotprod") {
                sets.push(Self::NeonDot);
            }
        }
        sets
    }

    /// The quickest that this machine has.
    pub(super) fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }

    /// Neighbours between two lists, neither empty.
    pub(super) fn scan(self, rows: &[Descriptor], columns: &[Descriptor]) -> Neighbours {
        // SAFETY: the variants are only made by `available`, where the machine has the instructions.
        unsafe {
            match self {
                Self::Portable => scan::<Portable, 4, 1>(rows, columns),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2 => avx2(rows, columns),
                #[cfg(target_arch = "x86_64")]
                Self::AvxVnni => avx_vnni(rows, columns),
                #[cfg(target_arch = "x86_64")]
                Self::Avx512Bw => avx512_bw(rows, columns),
                #[cfg(target_arch = "x86_64")]
                Self::Avx512Vnni => avx512_vnni(rows, columns),
                #[cfg(target_arch = "aarch64")]
                Self::Neon => scan::<arm::Neon, 4, 4>(rows, columns),
                #[cfg(target_arch = "aarch64")]
                Self::NeonDot => scan::<arm::NeonDot, 4, 4>(rows, columns),
            }
        }
    }
}

/// A function that compiles the scan for an instruction set, in tiles that fill its registers.
macro_rules! compiled {
    ($name:ident, $features:literal, $lanes:ty, $rows:literal, $vectors:literal) => {
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = $features)]
        fn $name(rows: &[Descriptor], columns: &[Descriptor]) -> Neighbours {
            // SAFETY: the instructions are enabled for this function.
            unsafe { scan::<$lanes, $rows, $vectors>(rows, columns) }
        }
    };
}

// 16 registers.
compiled!(avx2, "avx2", x86::Avx2, 4, 2);
compiled!(avx_vnni, "avx2,avxvnni", x86::AvxVnni, 4, 2);
// 32 registers.
compiled!(avx512_bw, "avx2,avx512f,avx512bw", x86::Avx512Bw, 4, 4);
compiled!(avx512_vnni, "avx2,avx512f,avx512bw,avx512vnni", x86::Avx512Vnni, 4, 4);

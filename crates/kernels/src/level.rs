//! Which vector instructions the processor has.

use std::sync::atomic::{AtomicU8, Ordering};

/// A set of vector instructions, narrower ones first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// What every processor of this architecture has.
    Plain = 1,
    /// x86-64-v3: AVX2.
    Avx2 = 2,
    /// x86-64-v4: AVX-512.
    Avx512 = 3,
}

/// What kernels use; 0: not determined yet.
static LEVEL: AtomicU8 = AtomicU8::new(0);

/// The widest level of this processor.
#[cfg(target_arch = "x86_64")]
fn widest() -> Level {
    macro_rules! has {
        ($($feature:tt)*) => { $(std::arch::is_x86_feature_detected!($feature))&&* };
    }
    if !has!("avx2" "bmi1" "bmi2" "f16c" "fma" "lzcnt" "movbe" "popcnt") {
        Level::Plain
    } else if has!("avx512f" "avx512bw" "avx512cd" "avx512dq" "avx512vl") {
        Level::Avx512
    } else {
        Level::Avx2
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn widest() -> Level {
    Level::Plain
}

/// What kernels use.
#[inline]
pub fn level() -> Level {
    match LEVEL.load(Ordering::Relaxed) {
        1 => Level::Plain,
        2 => Level::Avx2,
        3 => Level::Avx512,
        _ => limit_level(Level::Avx512),
    }
}

/// Limits kernels to levels no wider than `most`, in the whole process; returns what they use. Tests compare levels.
#[cold]
pub fn limit_level(most: Level) -> Level {
    let level = widest().min(most);
    LEVEL.store(level as u8, Ordering::Relaxed);
    level
}

/// Compiles functions for every level; callers get the widest available. Within them `N` is how many lanes at a time
/// keep a few numbers each in registers.
macro_rules! kernels {
    ($($(#[$meta:meta])* pub fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block)*) => {$(
        $(#[$meta])*
        #[allow(clippy::too_many_arguments, unsafe_code)]
        pub fn $name($($arg: $type),*) $(-> $out)? {
            #[inline(always)]
            fn at_any_level<const N: usize>($($arg: $type),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,bmi1,bmi2,f16c,fma,lzcnt,movbe,popcnt")]
                fn with_avx2($($arg: $type),*) $(-> $out)? { at_any_level::<16>($($arg),*) }
                #[target_feature(enable = "avx2,bmi1,bmi2,f16c,fma,lzcnt,movbe,popcnt")]
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
                fn with_avx512($($arg: $type),*) $(-> $out)? { at_any_level::<32>($($arg),*) }
                match $crate::level() {
                    // SAFETY: the level says that the processor has what these need.
                    $crate::Level::Avx512 => unsafe { with_avx512($($arg),*) },
                    // SAFETY: as above.
                    $crate::Level::Avx2 => unsafe { with_avx2($($arg),*) },
                    $crate::Level::Plain => at_any_level::<16>($($arg),*),
                }
            }
            #[cfg(not(target_arch = "x86_64"))]
            at_any_level::<16>($($arg),*)
        }
    )*};
}
pub(crate) use kernels;

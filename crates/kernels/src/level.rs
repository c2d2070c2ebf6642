//! Which vector instructions are used: the widest that the processor has, or those that the user chose.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};
use std::{env, fmt};

/// The environment variable that selects a level; read once. Unset or empty: the widest that the processor has.
pub const VARIABLE: &str = "ECHOCAST_SIMD";

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

impl Level {
    const ALL: [Level; 3] = [Level::Avx512, Level::Avx2, Level::Plain];

    /// Its name in [`VARIABLE`].
    pub fn name(self) -> &'static str {
        match self {
            Level::Plain => "plain",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }

    /// The levels that this processor has, wider ones first.
    pub fn here() -> impl Iterator<Item = Level> {
        let widest = widest();
        Level::ALL.into_iter().filter(move |&level| level <= widest)
    }
}

/// Why [`VARIABLE`] selects no level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoLevel {
    /// Its value.
    pub found: String,
    /// Values that are allowed on this processor.
    pub allowed: String,
}

impl fmt::Display for NoLevel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{VARIABLE} is {}; allowed: {}", self.found, self.allowed)
    }
}

impl std::error::Error for NoLevel {}

/// The level that kernels use; 0: not determined yet.
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

/// The level that `text` names.
fn named(text: &str) -> Result<Level, NoLevel> {
    Level::here().find(|level| level.name() == text).ok_or_else(|| {
        let names: Vec<_> = Level::here().map(Level::name).collect();
        NoLevel { found: text.to_owned(), allowed: format!("{} on this processor", names.join(", ")) }
    })
}

/// The level that [`VARIABLE`] selects, if any.
///
/// # Errors
/// It names no level that this processor has. Kernels then use the widest.
pub fn chosen_level() -> Result<Option<Level>, NoLevel> {
    static CHOSEN: OnceLock<Result<Option<Level>, NoLevel>> = OnceLock::new();
    let read = || match env::var_os(VARIABLE) {
        Some(text) if !text.is_empty() => named(&text.to_string_lossy()).map(Some),
        _ => Ok(None),
    };
    CHOSEN.get_or_init(read).clone()
}

/// The level that kernels use.
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
    let level = chosen_level().ok().flatten().unwrap_or_else(widest).min(most);
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
                    // SAFETY: the level guarantees that the processor has what these need.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_this_processor_have_names() {
        assert_eq!(Level::here().last(), Some(Level::Plain));
        for level in Level::here() {
            assert_eq!(named(level.name()), Ok(level));
        }
        for text in ["avx", "AVX2", " plain", "sse"] {
            let error = named(text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("ECHOCAST_SIMD is {text}; allowed: ")), "{error}");
            assert!(error.ends_with("plain on this processor"), "{error}");
        }
    }
}

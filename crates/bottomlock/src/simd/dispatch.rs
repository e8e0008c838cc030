//! Which vectors the machine has, found at run time, and code compiled for each kind of them.

use std::sync::OnceLock;

use fearless_simd::Level;

#[cfg(target_arch = "x86_64")]
use super::WIDEST;

/// The vectors that code is made for: what lies between SSE2 and AVX2 is not worth a copy of everything.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Vectors {
    #[cfg(target_arch = "x86_64")]
    Avx512(fearless_simd::x86::Avx512),
    #[cfg(target_arch = "x86_64")]
    Avx2(fearless_simd::x86::Avx2),
    #[cfg(target_arch = "x86_64")]
    Sse2(fearless_simd::x86::Sse2),
    #[cfg(not(target_arch = "x86_64"))]
    Others(Level),
}

/// The vectors of this machine, found once.
pub(crate) fn vectors() -> Vectors {
    #[cfg(test)]
    if let Some(chosen) = CHOSEN.get() {
        return chosen;
    }
    static VECTORS: OnceLock<Vectors> = OnceLock::new();
    *VECTORS.get_or_init(|| of_level(Level::new()))
}

#[cfg(target_arch = "x86_64")]
fn of_level(level: Level) -> Vectors {
    match (level, level.as_sse2()) {
        (Level::Avx512(token), _) => Vectors::Avx512(token),
        (Level::Avx2(token), _) => Vectors::Avx2(token),
        (_, Some(token)) => Vectors::Sse2(token),
        (_, None) => unreachable!("every x86-64 has SSE2"),
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn of_level(level: Level) -> Vectors {
    Vectors::Others(level)
}

/// Evaluates an expression, compiled for the vectors of this machine, with the token that stands for them.
macro_rules! with_vectors {
    ($simd:ident => $work:expr) => {
        match $crate::simd::vectors() {
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Avx512($simd) => $crate::simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $work,
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Avx2($simd) => $crate::simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $work,
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Sse2($simd) => $crate::simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $work,
            ),
            #[cfg(not(target_arch = "x86_64"))]
            $crate::simd::Vectors::Others(level) => fearless_simd::dispatch!(level, $simd => $work),
        }
    };
}
pub(crate) use with_vectors;

/// Calls a function over the widest lanes of this machine, compiled for its vectors: `f::<S, T>(simd, …)`, or with a size
/// `f::<S, T, N>(simd, …)`; or evaluates `else` where [`widest_lanes`] is 1.
macro_rules! with_lanes {
    ($function:ident $(<$size:ident>)?, $argument:expr, else $alone:expr) => {
        match $crate::simd::vectors() {
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Avx512(simd) => $crate::simd::Simd::vectorize(
                simd,
                #[inline(always)]
                || $function::<_, $crate::simd::f64x8<_> $(, $size)?>(simd, $argument),
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Avx2(simd) => $crate::simd::Simd::vectorize(
                simd,
                #[inline(always)]
                || $function::<_, $crate::simd::f64x4<_> $(, $size)?>(simd, $argument),
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Vectors::Sse2(_) => $alone,
            #[cfg(not(target_arch = "x86_64"))]
            $crate::simd::Vectors::Others(level) => {
                fearless_simd::dispatch!(level, simd => $function::<_, $crate::simd::f64x4<_> $(, $size)?>(simd, $argument))
            }
        }
    };
}
pub(crate) use with_lanes;

#[cfg(test)]
thread_local! {
    static CHOSEN: std::cell::Cell<Option<Vectors>> = const { std::cell::Cell::new(None) };
}

/// Does `work` with every kind of vector that this machine has, through the code of [`with_vectors`] and [`with_lanes`]: copies
/// made for a test alone would take minutes to compile.
#[cfg(test)]
pub(crate) fn on_every_level(mut work: impl FnMut()) {
    let level = Level::new();
    #[cfg(target_arch = "x86_64")]
    let kinds = [
        level.as_sse2().map(Vectors::Sse2),
        level.as_avx2().map(Vectors::Avx2),
        level.as_avx512().map(Vectors::Avx512),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let kinds = [Some(Vectors::Others(level))];
    for kind in kinds.into_iter().flatten() {
        CHOSEN.set(Some(kind));
        work();
    }
    CHOSEN.set(None);
}

/// Evaluates an expression with one kind of vectors, AVX2 on x86-64: for laws of the code that hold whatever the vectors are.
#[cfg(test)]
macro_rules! on_one_level {
    ($simd:ident => $check:expr) => {{
        #[cfg(target_arch = "x86_64")]
        if let Some($simd) = fearless_simd::Level::new().as_avx2() {
            $check;
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(fearless_simd::Level::new(), $simd => $check);
    }};
}
#[cfg(test)]
pub(crate) use on_one_level;

/// How many lanes the widest vectors of this machine have; 1 with SSE2, which does not fuse: in software, lanes gain nothing, and
/// their code would be the largest of all.
pub(crate) fn widest_lanes() -> usize {
    match vectors() {
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx512(_) => WIDEST,
        #[cfg(target_arch = "x86_64")]
        Vectors::Sse2(_) => 1,
        _ => 4,
    }
}

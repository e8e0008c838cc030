//! Neighbours in the rows of a matrix, taken several at a time.
//!
//! Where the elements of a matrix are numbers of one filter, neighbours fill a vector. Where they are vectors already, each of them is
//! taken by itself.

use fearless_simd::prelude::*;

use super::{Lane, Lanes, Simd, WIDEST, f64x4, f64x8};
use crate::layout::{DIM, DVL_BIAS, DYNAMIC};

/// Neighbours with the same factor, an element of type `T`.
pub trait Lift<T>: Lane {
    /// The element once for each neighbour; which numbers `self` holds does not matter.
    #[must_use]
    fn lift(self, element: T) -> Self;
}

/// Neighbours in a row of elements of type `T`.
pub trait Strip<S: Simd, T>: Lift<T> {
    /// How many there are.
    const WIDTH: usize;
    /// The first elements of a slice.
    fn take(simd: S, from: &[T]) -> Self;
    /// The same way back.
    fn put(&self, into: &mut [T]);
    /// With an element added to the neighbour at a place.
    #[must_use]
    fn plus_at(self, place: usize, element: T) -> Self;
    /// Elements (i, l), (i + 1, l), … of a matrix that [`Strips::turn_matrix`] has turned.
    fn turned(simd: S, p: &[[T; DIM]; DIM], i: usize, l: usize) -> Self;
}

/// An element, and the strips by which rows of it are taken.
pub trait Strips<S: Simd>: Strip<S, Self> {
    /// As many neighbours as there are in a vector; the dynamic states after the first fill whole ones.
    type Wide: Strip<S, Self>;
    /// For what whole vectors leave of a row of [`DIM`].
    type Rest: Strip<S, Self>;
    /// Turns the dynamic rows into columns, as far as a transition reads them and [`Strip::turned`] needs it.
    #[inline(always)]
    fn turn_matrix(_simd: S, _p: &mut [[Self; DIM]; DIM]) {}
}

impl<T: Lane> Lift<T> for T {
    #[inline(always)]
    fn lift(self, element: T) -> T {
        element
    }
}

impl<S: Simd, T: Lane> Strip<S, T> for T {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn take(_simd: S, from: &[T]) -> T {
        from[0]
    }
    #[inline(always)]
    fn put(&self, into: &mut [T]) {
        into[0] = *self;
    }
    #[inline(always)]
    fn plus_at(self, _place: usize, element: T) -> T {
        self + element
    }
    #[inline(always)]
    fn turned(_simd: S, p: &[[T; DIM]; DIM], i: usize, l: usize) -> T {
        p[i][l]
    }
}

impl<S: Simd> Strips<S> for f64 {
    type Wide = f64x8<S>;
    type Rest = f64x4<S>;
    #[inline(always)]
    fn turn_matrix(simd: S, p: &mut [[f64; DIM]; DIM]) {
        // Both squares are read before either is written.
        let mut squares = [[f64x8::simd_from(simd, 0.0); WIDEST]; 2];
        for (square, from) in squares.iter_mut().zip([0, WIDEST]) {
            for k in 0..WIDEST {
                square[k] = Lanes::load(simd, &p[1 + k][from..from + WIDEST]);
            }
            Lanes::turn(square);
        }
        for l in 0..DVL_BIAS {
            Lanes::store(&squares[l / WIDEST][l % WIDEST], &mut p[l][1..DYNAMIC]);
        }
        for l in DYNAMIC..DVL_BIAS {
            p[l][0] = p[0][l];
        }
    }
}

macro_rules! strip {
    ($vector:ident, $count:literal) => {
        impl<S: Simd> Lift<f64> for $vector<S> {
            #[inline(always)]
            fn lift(self, element: f64) -> Self {
                self.splat(element)
            }
        }

        impl<S: Simd> Strip<S, f64> for $vector<S> {
            const WIDTH: usize = $count;
            #[inline(always)]
            fn take(simd: S, from: &[f64]) -> Self {
                Lanes::load(simd, &from[..$count])
            }
            #[inline(always)]
            fn put(&self, into: &mut [f64]) {
                Lanes::store(self, &mut into[..$count]);
            }
            #[inline(always)]
            fn plus_at(self, place: usize, element: f64) -> Self {
                let place = Lane::each(self, |k| f64::from(u8::from(k == place)));
                place.simd_eq(1.0).select(self + element, self)
            }
            #[inline(always)]
            fn turned(simd: S, p: &[[f64; DIM]; DIM], i: usize, l: usize) -> Self {
                Lanes::load(simd, &p[l][i..i + $count])
            }
        }

        impl<S: Simd> Strips<S> for $vector<S> {
            type Wide = Self;
            type Rest = Self;
        }
    };
}

strip!(f64x4, 4);
strip!(f64x8, 8);

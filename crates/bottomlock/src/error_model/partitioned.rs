//! A covariance by what the transition does to its parts, and P ← Φ P Φᵀ on it.

use super::noise::HalfNoise;
use super::transition::{Parts, Transition};
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DYNAMIC, POSITION, VELOCITY};
use crate::simd::{Lane, V3, add, three};

/// Accelerometer and gyro biases, which the dynamic states read.
const READ: usize = DVL_BIAS - ACCEL_BIAS;
/// States without dynamics.
const STEADY: usize = DIM - DYNAMIC;

/// A symmetric covariance in parts, of one filter or of several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Partitioned<T> {
    /// Of the dynamic states.
    pub(super) dynamic: [[T; DYNAMIC]; DYNAMIC],
    /// Row j: of steady state j with the dynamic states.
    pub(super) across: [[T; DYNAMIC]; STEADY],
    /// Row j: of steady state j with the inertial biases.
    pub(super) bias: [[T; READ]; STEADY],
    /// Of the states of the log.
    pub(super) dvl: [[T; DIM - DVL_BIAS]; DIM - DVL_BIAS],
    /// Room for the dynamic columns of Φ P.
    image: [[T; DYNAMIC]; DYNAMIC],
}

impl<T: Lane> Partitioned<T> {
    /// From elements (i, j) on and below the diagonal.
    #[inline(always)]
    pub fn from_fn(like: T, element: impl Fn(usize, usize) -> T) -> Self {
        let zero = like.splat(0.0);
        let mut p = Self {
            dynamic: [[zero; DYNAMIC]; DYNAMIC],
            across: [[zero; DYNAMIC]; STEADY],
            bias: [[zero; READ]; STEADY],
            dvl: [[zero; DIM - DVL_BIAS]; DIM - DVL_BIAS],
            image: [[zero; DYNAMIC]; DYNAMIC],
        };
        for i in 0..DIM {
            for j in 0..=i {
                let value = element(i, j);
                if i < DYNAMIC {
                    p.dynamic[i][j] = value;
                    p.dynamic[j][i] = value;
                } else if j < DYNAMIC {
                    p.across[i - DYNAMIC][j] = value;
                } else if j < DVL_BIAS {
                    p.bias[i - DYNAMIC][j - DYNAMIC] = value;
                    if i < DVL_BIAS {
                        p.bias[j - DYNAMIC][i - DYNAMIC] = value;
                    }
                } else {
                    p.dvl[i - DVL_BIAS][j - DVL_BIAS] = value;
                }
            }
        }
        p
    }

    /// Element (i, j) on or below the diagonal.
    #[inline(always)]
    #[must_use]
    pub fn lower(&self, i: usize, j: usize) -> &T {
        if i < DYNAMIC {
            &self.dynamic[i][j]
        } else if j < DYNAMIC {
            &self.across[i - DYNAMIC][j]
        } else if j < DVL_BIAS {
            &self.bias[i - DYNAMIC][j - DYNAMIC]
        } else {
            &self.dvl[i - DVL_BIAS][j - DVL_BIAS]
        }
    }

    /// What the transition reads of the column of dynamic state j.
    #[inline(always)]
    fn dynamic_column(&self, j: usize) -> Parts<T> {
        let own = &self.dynamic[j];
        let with = |k: usize| self.across[k][j];
        Parts {
            r: three(own, POSITION),
            rho: three(own, ATTITUDE),
            v: three(own, VELOCITY),
            ba: [with(0), with(1), with(2)],
            bg: [with(3), with(4), with(5)],
        }
    }

    /// What the transition reads of the column of steady state j.
    #[inline(always)]
    fn steady_column(&self, j: usize) -> Parts<T> {
        let own = &self.across[j];
        Parts {
            r: three(own, POSITION),
            rho: three(own, ATTITUDE),
            v: three(own, VELOCITY),
            ba: three(&self.bias[j], 0),
            bg: three(&self.bias[j], 3),
        }
    }

    /// P ← Φ P Φᵀ + Q T/2, result exactly symmetric.
    ///
    /// By blocks of three rows, whose coefficients stay in registers over all columns. Where a column is worked on in place,
    /// velocity and position go before what they read: position reads old misalignment and velocity, velocity reads old
    /// misalignment.
    #[inline(always)]
    pub fn sandwich(&mut self, phi: &impl Transition<T>, noise: &HalfNoise<T>) {
        // Columns of Φ P: of the dynamic states beside P, since all of them read it; of the others in place.
        for j in 0..DYNAMIC {
            let own = phi.position(&self.dynamic_column(j));
            put(&mut self.image[j], POSITION, own);
        }
        for j in 0..DYNAMIC {
            let own = phi.velocity(&self.dynamic_column(j));
            put(&mut self.image[j], VELOCITY, own);
        }
        for j in 0..DYNAMIC {
            let own = phi.attitude(&self.dynamic_column(j));
            put(&mut self.image[j], ATTITUDE, own);
        }
        for j in 0..STEADY {
            let own = phi.position(&self.steady_column(j));
            put(&mut self.across[j], POSITION, own);
        }
        for j in 0..STEADY {
            let own = phi.velocity(&self.steady_column(j));
            put(&mut self.across[j], VELOCITY, own);
        }
        for j in 0..STEADY {
            let own = phi.attitude(&self.steady_column(j));
            put(&mut self.across[j], ATTITUDE, own);
        }
        // (Φ P) Φᵀ, row by row, on and below the diagonal; what noise there is joins on the way.
        for i in POSITION..DYNAMIC {
            self.mirror(i, POSITION, phi.position(&self.row(i)));
        }
        for i in VELOCITY..DYNAMIC {
            let image = phi.velocity(&self.row(i));
            self.mirror(i, VELOCITY, add(image, noise.velocity[i - VELOCITY]));
        }
        for i in ATTITUDE..VELOCITY {
            let mut image = phi.attitude(&self.row(i));
            image[i - ATTITUDE] += noise.attitude;
            self.mirror(i, ATTITUDE, image);
        }
        for i in VELOCITY..DYNAMIC {
            let image = phi.attitude(&self.row(i));
            self.mirror(i, ATTITUDE, add(image, noise.across[i - VELOCITY]));
        }
        noise.add_to_steady(self);
    }

    /// What the transition reads of row i of Φ P: its dynamic columns and, in place already, its steady ones.
    #[inline(always)]
    fn row(&self, i: usize) -> Parts<T> {
        let image = &self.image;
        let of = |from: usize| [image[from][i], image[from + 1][i], image[from + 2][i]];
        let with = |k: usize| self.across[k][i];
        Parts {
            r: of(POSITION),
            rho: of(ATTITUDE),
            v: of(VELOCITY),
            ba: [with(0), with(1), with(2)],
            bg: [with(3), with(4), with(5)],
        }
    }

    /// Writes three elements of row i, as far as the diagonal, and their mirror images.
    #[inline(always)]
    fn mirror(&mut self, i: usize, from: usize, image: V3<T>) {
        for k in 0..3 {
            if from + k <= i {
                self.dynamic[i][from + k] = image[k];
                self.dynamic[from + k][i] = image[k];
            }
        }
    }
}

#[inline(always)]
fn put<T: Lane>(column: &mut [T; DYNAMIC], from: usize, image: V3<T>) {
    column[from] = image[0];
    column[from + 1] = image[1];
    column[from + 2] = image[2];
}

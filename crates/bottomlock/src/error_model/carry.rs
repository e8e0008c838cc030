//! Carries the covariance of the state with further states through an interval.

use super::{FirstOrder, Interval, SecondOrder, Transition};
use crate::imu::EarthTerms;
use crate::lane::Lane;
use crate::layout::{DIM, DYNAMIC};

impl<T: Lane> Interval<T> {
    /// Multiplies columns by the interval's Φ; the interval stays as it is, so this comes before [`Interval::propagate`].
    pub fn carry<const N: usize>(&self, columns: &mut [[T; DIM]; N], earth: &EarthTerms, second_order: bool) {
        if self.duration_s <= 0.0 {
            return;
        }
        if second_order {
            apply(&SecondOrder::new(&self.sum, self.duration_s, earth), columns);
        } else {
            apply(&FirstOrder::new(&self.sum, self.duration_s, earth), columns);
        }
    }
}

fn apply<T: Lane, const N: usize>(phi: &impl Transition<T>, columns: &mut [[T; DIM]; N]) {
    for column in columns {
        let image = phi.apply(column);
        column[..DYNAMIC].copy_from_slice(&image);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Coefficients, Interval};
    use super::*;
    use crate::earth::Environment;
    use crate::imu::{Inertial, Kinematics};

    /// Columns carried through an interval of a diving turn are Φ times the columns, Φ as a dense matrix.
    #[test]
    fn carried_columns_are_dense_products() {
        let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
        let kinematics = Kinematics::new([0.0; 3], [0.9, 0.1, -0.3, 0.2], [2.0, 0.1, -0.2]);
        let inertial = Inertial {
            rate_p_radps: [0.1, -0.2, 0.3],
            force_p_mps2: [0.3, 0.2, -9.7],
        };
        let mut interval = Interval::default();
        interval.extend(Coefficients::at(&kinematics, &inertial, &earth), 0.1);
        let start: [[f64; DIM]; 2] = std::array::from_fn(|c| std::array::from_fn(|k| ((c * 7 + k) as f64).sin()));
        for second_order in [false, true] {
            let mut columns = start;
            interval.carry(&mut columns, &earth, second_order);
            let phi = interval.dense_transition(&earth, second_order);
            for c in 0..2 {
                for i in 0..DIM {
                    let expected: f64 = (0..DIM).map(|j| phi[i][j] * start[c][j]).sum();
                    assert!((columns[c][i] - expected).abs() < 1e-14);
                }
            }
        }
    }
}

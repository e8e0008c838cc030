//! A level turn that the tests of the further states have in common.

use nalgebra::DMatrix;

use super::Eskf;
use crate::earth::Environment;
use crate::frames::Vec3;
use crate::mechanisation::ImuSample;

/// Propagates a filter by `steps` steps of 10 ms in the turn.
pub(super) fn advance(filter: &mut Eskf, steps: i64) {
    let gravity = Environment::normal(32.8_f64.to_radians(), 0.0).gravity_mps2;
    for _ in 0..steps {
        let sample = |k: i64| ImuSample {
            time_ns: k * 10_000_000,
            rate_p_radps: Vec3::new(0.0, 0.01, 0.1),
            force_p_mps2: Vec3::new(0.0, 0.2, -gravity),
        };
        let now = filter.state().time_ns / 10_000_000;
        filter.predict(&sample(now), &sample(now + 1)).unwrap();
    }
}

/// Asserts that two covariances agree to a fraction of the standard deviations of their states.
pub(super) fn assert_close(got: &DMatrix<f64>, expected: &DMatrix<f64>, fraction: f64, place: &str) {
    for i in 0..expected.nrows() {
        for j in 0..expected.ncols() {
            let size = (expected[(i, i)] * expected[(j, j)]).sqrt();
            let difference = (got[(i, j)] - expected[(i, j)]).abs();
            assert!(
                difference <= fraction * size,
                "{place}, ({i}, {j}): {difference} of {size}"
            );
        }
    }
}

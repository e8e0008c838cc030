//! The vectorised update against nalgebra's dense matrices, term by term.

use super::*;
use crate::simd::{on_every_level, on_one_level};

type Rows<const M: usize> = SMatrix<f64, M, DIM>;
type Square<const M: usize> = SMatrix<f64, M, M>;
type Tall<const M: usize> = SMatrix<f64, DIM, M>;

fn sample(seed: usize) -> Covariance {
    let spread = Covariance::from_fn(|i, j| ((i * 7 + j * 3 + seed) as f64).sin() * 0.3_f64.powi((i % 5) as i32));
    let matrix = spread * spread.transpose() + Covariance::identity() * 0.01;
    (matrix + matrix.transpose()) * 0.5
}

/// Rows without some of the states, with noise that is correlated among the rows and optionally with the states.
fn innovation(rows: usize, seed: usize, is_correlated: bool) -> Innovation {
    let value = |i: usize, j: usize| ((i * 5 + j * 11 + seed) as f64 * 0.9).cos();
    let mut innovation = Innovation {
        rows,
        degrees: rows,
        ..Innovation::empty()
    };
    for m in 0..rows {
        innovation.residual[m] = value(m, 3);
        for k in (0..DIM).filter(|k| k % 4 != 1) {
            innovation.jacobian[(m, k)] = if (m + k) % 3 == 0 { 0.0 } else { value(m, k) };
        }
        for n in 0..rows {
            innovation.noise[(m, n)] = if m == n { 0.5 } else { 0.02 * value(m * n, m + n) };
        }
    }
    innovation.cross = is_correlated.then(|| {
        Box::new(SMatrix::from_fn(
            |i, m| if m < rows { 0.003 * value(i, m) } else { 0.0 },
        ))
    });
    innovation
}

/// H, R and C with room for M rows; one that is not there has a variance of one.
fn parts<const M: usize>(innovation: &Innovation) -> (Rows<M>, Square<M>, Tall<M>) {
    let cross = innovation.cross.as_deref().copied().unwrap_or_else(SMatrix::zeros);
    let mut r = innovation.noise.fixed_view::<M, M>(0, 0).into_owned();
    (innovation.rows..M).for_each(|m| r[(m, m)] = 1.0);
    (
        innovation.jacobian.fixed_rows::<M>(0).into_owned(),
        r,
        cross.fixed_columns::<M>(0).into_owned(),
    )
}

fn dense_joseph<const M: usize>(p: &Covariance, innovation: &Innovation, gain: &Tall<M>) -> Covariance {
    let (h, r, c) = parts::<M>(innovation);
    let left = Covariance::identity() - gain * h;
    let shared = left * c * gain.transpose();
    left * p * left.transpose() + gain * r * gain.transpose() - shared - shared.transpose()
}

fn joseph<S: Simd, const M: usize>(simd: S, p: &Covariance, innovation: &Innovation, gain: &Tall<M>) -> Covariance {
    let predicted = PredictedInnovation::<M>::within(simd, p, innovation).unwrap();
    let mut columns = [Column::zero(simd); M];
    for m in 0..M {
        columns[m] = Column::load(simd, &gain.data.0[m]);
    }
    let mut corrected = *p;
    predicted.joseph(simd, &mut corrected.data.0, innovation, &columns);
    make_symmetric(simd, &mut corrected.data.0);
    corrected
}

/// The corrected covariance and the correction.
fn corrected<const M: usize>(
    predicted: &PredictedInnovation<M>,
    p: &Covariance,
    innovation: &Innovation,
) -> Result<(Covariance, Correction<M>), Indefinite> {
    let mut covariance = *p;
    let correction = predicted.correct(&mut covariance, innovation)?;
    Ok((covariance, correction))
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

fn check<const M: usize>(rows: usize) {
    for seed in 0..6 {
        for is_correlated in [false, true] {
            let (p, innovation) = (sample(seed), innovation(rows, seed, is_correlated));
            let (h, r, c) = parts::<M>(&innovation);
            let predicted = PredictedInnovation::<M>::of(&p, &innovation).unwrap();
            let cross_covariance = p * h.transpose() + c;
            let half = h * c;
            let s = h * p * h.transpose() + half + half.transpose() + r;
            assert!((predicted.cross_covariance - cross_covariance).amax() < 1e-13);
            assert!((predicted.s - s).amax() < 1e-13 && predicted.s == predicted.s.transpose());
            let z = innovation.residual.fixed_rows::<M>(0);
            let factor = s.cholesky().unwrap();
            assert!((predicted.nis / z.dot(&factor.solve(&z)) - 1.0).abs() < 1e-12);
            assert!((predicted.cholesky().l() - factor.l()).amax() < 1e-13);

            let (updated, correction) = corrected(&predicted, &p, &innovation).ok().unwrap();
            assert!((correction.gain * s - cross_covariance).amax() < 1e-12);
            assert!((correction.error - correction.gain * z).amax() < 1e-14);
            assert!((updated - dense_joseph(&p, &innovation, &correction.gain)).amax() < 1e-13);
            assert_eq!(updated, updated.transpose());
            // Joseph's form holds for any gain, not only for the optimal one.
            let other = Tall::<M>::from_fn(|i, m| 0.3 * correction.gain[(i, m)] + 0.05 * ((i + m) as f64).sin());
            let dense = dense_joseph(&p, &innovation, &other);

            on_every_level(|| {
                let own = PredictedInnovation::<M>::of(&p, &innovation).unwrap();
                let (own_updated, own_correction) = corrected(&own, &p, &innovation).ok().unwrap();
                assert_eq!(bits(own.s.as_slice()), bits(predicted.s.as_slice()));
                assert_eq!(own.nis.to_bits(), predicted.nis.to_bits());
                assert_eq!(bits(own_correction.gain.as_slice()), bits(correction.gain.as_slice()));
                assert_eq!(bits(own_correction.error.as_slice()), bits(correction.error.as_slice()));
                assert_eq!(bits(own_updated.as_slice()), bits(updated.as_slice()));
            });
            on_one_level!(simd => assert!((joseph(simd, &p, &innovation, &other) - dense).amax() < 1e-12));
        }
    }
}

/// An update equals the dense update for every number of rows, with the same bits for all vector widths.
#[test]
fn an_update_is_the_dense_update() {
    check::<1>(1);
    (2..=4).for_each(check::<4>);
    (5..=MAX_ROWS).for_each(check::<MAX_ROWS>);
}

/// (H P⁺ Hᵀ − (R − R S⁻¹ R)) / R of four rows whose noise is `ratio` times smaller than H P Hᵀ.
fn lost(p: &Covariance, mut rows: Innovation, ratio: f64) -> f64 {
    rows.noise *= 1.0 / ratio;
    let (h, r, _) = parts::<4>(&rows);
    let predicted = PredictedInnovation::<4>::of(p, &rows).unwrap();
    let (updated, _) = corrected(&predicted, p, &rows).ok().unwrap();
    let expected = r - r * predicted.s.try_inverse().unwrap() * r;
    (h * updated * h.transpose() - expected).amax() / r.amax()
}

/// After a precise measurement of single states their variance has all digits of the measurement variance. The forms
/// P − X S⁻¹ Xᵀ and P − K Xᵀ − X Kᵀ + K S Kᵀ would lose them all where R is 2e-16 P.
#[test]
fn a_precise_measurement_leaves_its_variance() {
    for seed in 0..20 {
        for ratio in [1e4, 1e8, 1e12, 1e16] {
            let mut rows = innovation(4, seed, false);
            rows.jacobian.fill(0.0);
            for m in 0..4 {
                rows.jacobian[(m, (5 * m + seed) % DIM)] = 1.0;
            }
            let lost = lost(&sample(seed), rows, ratio);
            assert!(lost < 1e-9, "seed {seed}, ratio {ratio:e}: {lost:e}");
        }
    }
}

/// For sums of states the precision is bounded by the elements of P⁺, which are rounded to 2e-16 of P.
#[test]
fn precise_sums_of_states_have_the_precision_of_storage() {
    for seed in 0..20 {
        for ratio in [1e4, 1e8, 1e12, 1e14] {
            let lost = lost(&sample(seed), innovation(4, seed, false), ratio);
            assert!(lost < 1e-15 * ratio + 1e-9, "seed {seed}, ratio {ratio:e}: {lost:e}");
        }
    }
}

/// Frozen states stay frozen, bit for bit.
#[test]
fn frozen_states_stay_frozen() {
    let mut p = sample(4);
    for k in 15..DIM {
        p.row_mut(k).fill(0.0);
        p.column_mut(k).fill(0.0);
    }
    let innovation = innovation(4, 4, false);
    let predicted = PredictedInnovation::<4>::of(&p, &innovation).unwrap();
    let (p, correction) = corrected(&predicted, &p, &innovation).ok().unwrap();
    assert!(p.fixed_columns::<5>(15).iter().all(|element| *element == 0.0));
    assert!(p.fixed_rows::<5>(15).iter().all(|element| *element == 0.0));
    assert!(
        correction
            .error
            .fixed_rows::<5>(15)
            .iter()
            .all(|element| *element == 0.0)
    );
}

/// By hand: P = 1 and a noise variance of −1/2 give K = 2 and P⁺ = (1 − 2)² − 4/2 = −1, which is rejected and leaves P
/// as it was; a noise variance of −2 makes S negative.
#[test]
fn an_indefinite_covariance_is_rejected() {
    let p = Covariance::identity();
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        ..Innovation::empty()
    };
    innovation.jacobian[(0, 7)] = 1.0;
    innovation.noise[(0, 0)] = -0.5;
    let predicted = PredictedInnovation::<1>::of(&p, &innovation).unwrap();
    let mut covariance = p;
    let indefinite = predicted.correct(&mut covariance, &innovation).err().unwrap();
    assert_eq!(indefinite.negative, Some(7));
    assert_eq!(covariance, p);
    innovation.noise[(0, 0)] = -2.0;
    assert!(PredictedInnovation::<1>::of(&p, &innovation).is_none());
}

//! Least squares by hand, and against the normal equations in the row space.

use nalgebra::DMatrix;
use proptest::prelude::*;

use super::*;

fn rows(directions: &[[f64; 3]], variance: f64) -> Rows {
    let mut rows = Rows::empty();
    for (slot, &direction) in directions.iter().enumerate() {
        rows.put(slot, Vector3::from(direction), variance);
    }
    rows
}

/// By hand: two rows along x are averaged, one row along y stands alone, z is unobserved.
#[test]
fn parallel_rows_are_averaged() {
    let solution = least_squares(&rows(&[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0.04)).unwrap();
    assert_eq!(solution.rank, 2);
    assert!((solution.covariance[(0, 0)] - 0.02).abs() < 1e-16);
    assert!((solution.covariance[(1, 1)] - 0.04).abs() < 1e-16);
    assert!(solution.covariance[(2, 2)].abs() < 1e-16);
    assert!(solution.observes(&Vector3::x()) && solution.observes(&Vector3::y()) && !solution.observes(&Vector3::z()));
    assert!((solution.gain[(0, 0)] - 0.5).abs() < 1e-15);
}

/// Principal axes diagonalise the observed part of the covariance.
#[test]
fn principal_axes_diagonalise() {
    let s = 0.5_f64.sqrt();
    let solution = least_squares(&rows(&[[1.0, 0.0, 0.0], [s, s, 0.0]], 0.04)).unwrap();
    let (axes, variances) = solution.principal_axes();
    let rebuilt = axes * Matrix3::from_diagonal(&variances) * axes.transpose();
    assert!((rebuilt - solution.covariance).amax() < 1e-15);
    assert!(axes.column(2).norm() < 1e-15);
}

/// Without rows the rank is zero, which is no error.
#[test]
fn no_rows_have_rank_zero() {
    let solution = least_squares(&Rows::empty()).unwrap();
    assert_eq!((solution.rank, solution.gain), (0, Gain::zeros()));
    assert_eq!(solution.null, Matrix3::identity());
}

/// A zero variance is rejected.
#[test]
fn zero_variance_is_an_error() {
    assert!(least_squares(&rows(&[[1.0, 0.0, 0.0]], 0.0)).is_err());
}

/// The Cholesky factor of ((4, 2), (2, 5)) is ((2, 0), (1, 2)), and its inverse ((1/2, 0), (−1/4, 1/2)).
#[test]
fn whitening_by_hand() {
    let mut noise = SlotNoise::identity();
    for (i, row) in [[4.0, 2.0], [2.0, 5.0]].iter().enumerate() {
        for (j, &value) in row.iter().enumerate() {
            noise[(i, j)] = value;
        }
    }
    let mut expected = SlotNoise::identity();
    (expected[(0, 0)], expected[(1, 0)], expected[(1, 1)]) = (0.5, -0.25, 0.5);
    assert!((whitening(noise, 2).unwrap() - expected).amax() < 1e-15);
    noise[(1, 1)] = 1.0;
    assert_eq!(whitening(noise, 2), None, "4 times 1 is 2 squared");
}

/// The axes of a null space complete those of the rows, also where the rows lie along a coordinate axis.
#[test]
fn complements_are_orthonormal() {
    let directions = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.6, 0.8, 0.0],
        [0.36, 0.48, 0.8],
    ];
    for direction in directions.map(Vector3::from) {
        let null = complement(&[direction]);
        let whole = Matrix3::from_columns(&[direction, null.column(0).into(), null.column(1).into()]);
        assert!(
            (whole.transpose() * whole - Matrix3::identity()).amax() < 1e-15,
            "{direction}"
        );
    }
    assert_eq!(
        complement(&[Vector3::x(), Vector3::y(), Vector3::z()]),
        Matrix3::zeros()
    );
}

/// Two rows that differ by a ten-millionth are two directions, and by a hundredth of that one.
#[test]
fn nearly_parallel_rows() {
    let ranks = [1e-6, 1e-9].map(|gap| rows(&[[1.0, 0.0, 0.0], [1.0, gap, 0.0]], 1.0).null_space().0);
    assert_eq!(ranks, [2, 1]);
}

/// Variances as large as those of a prior that knows nothing are told from what no row observes.
#[test]
fn large_variances_are_observed() {
    let (axes, variances) = least_squares(&rows(&[[0.0, 1.0, 0.0]], 1e8)).unwrap().principal_axes();
    assert!((axes.column(0).y.abs() - 1.0).abs() < 1e-12);
    assert!((variances[0] - 1e8).abs() < 1e-3 && axes.columns(1, 2).norm() == 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// With V a basis of the row space and W = R⁻¹: gain V (Vᵀ AᵀWA V)⁻¹ Vᵀ AᵀW, covariance V (Vᵀ AᵀWA V)⁻¹ Vᵀ, for any rank, rows in
    /// any slots and correlated noise.
    #[test]
    fn normal_equations_in_the_row_space(
        rank in 1_usize..=3,
        slots in prop::collection::btree_set(0..SLOTS, 1..8),
        numbers in prop::collection::vec(-1.0_f64..1.0, 8 * 3 + 9),
        spread in prop::collection::vec(-1.0_f64..1.0, 64),
        sd in prop::collection::vec(0.05_f64..2.0, 8),
    ) {
        let slots: Vec<usize> = slots.into_iter().collect();
        let count = slots.len();
        // Rows within the span of `rank` directions.
        let span = DMatrix::from_fn(3, 3, |i, j| if j < rank { numbers[24 + 3 * i + j] } else { 0.0 });
        let a = DMatrix::from_fn(count, 3, |i, j| numbers[3 * i + j]) * span.transpose();
        let singular = a.clone().svd(false, true);
        let expected_rank = singular.singular_values.iter().filter(|&&value| value > 1e-2).count();
        prop_assume!(singular.singular_values.iter().all(|value| !(1e-12..=1e-2).contains(value)));
        prop_assume!(expected_rank > 0);
        let root = DMatrix::from_fn(count, count, |i, j| if i == j { sd[i] } else { 0.3 * spread[8 * i + j] * sd[i] });
        let r = &root * root.transpose();
        prop_assume!(r.clone().symmetric_eigenvalues().min() > 1e-4);

        let mut table = Rows::empty();
        for (i, &slot) in slots.iter().enumerate() {
            table.directions[slot] = Some(Vector3::new(a[(i, 0)], a[(i, 1)], a[(i, 2)]));
            for (j, &other) in slots.iter().enumerate() {
                table.noise[(slot, other)] = r[(i, j)];
            }
        }
        let solution = least_squares(&table).unwrap();
        prop_assert_eq!(solution.rank, expected_rank);

        let largest = singular.v_t.unwrap();
        let mut order: Vec<usize> = (0..singular.singular_values.len()).collect();
        order.sort_by(|&i, &j| singular.singular_values[j].total_cmp(&singular.singular_values[i]));
        let v = DMatrix::from_fn(3, expected_rank, |i, j| largest[(order[j], i)]);
        let w = r.try_inverse().unwrap();
        let information = v.transpose() * a.transpose() * &w * &a * &v;
        let inside = &v * information.try_inverse().unwrap() * v.transpose();
        let gain = &inside * a.transpose() * &w;
        for (i, &slot) in slots.iter().enumerate() {
            for k in 0..3 {
                prop_assert!((solution.gain[(k, slot)] - gain[(k, i)]).abs() < 1e-6 * gain.amax().max(1.0));
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                prop_assert!((solution.covariance[(i, j)] - inside[(i, j)]).abs() < 1e-6 * inside.amax().max(1.0));
            }
        }
        let observed: f64 = solution.gain.iter().map(|value| value * value).sum();
        let filled: f64 = gain.iter().map(|value| value * value).sum();
        prop_assert!((observed - filled).abs() < 1e-6 * filled.max(1.0), "an empty slot has a gain");
        // What no row sees is orthogonal to all of them.
        for k in 0..3 - expected_rank {
            let axis = DMatrix::from_fn(3, 1, |i, _| solution.null[(i, k)]);
            prop_assert!((&a * &axis).amax() < 1e-7 && (axis.norm() - 1.0).abs() < 1e-12);
        }
    }
}

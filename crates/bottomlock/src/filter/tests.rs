//! What a filter states of itself, and its update with correlated noise against dense matrices.

use super::*;
use crate::aiding::CorrelatedNoise;
use crate::testing::*;

/// A campaign holds hundreds of filters side by side, so each must fit in the second-level cache with its
/// neighbours.
#[test]
fn a_filter_takes_five_kilobytes() {
    assert!(size_of::<Eskf>() <= 5000, "{} bytes", size_of::<Eskf>());
}

fn filter() -> Eskf {
    let options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap()
}

/// A covariance in which every state is correlated with every other.
fn covariance() -> Covariance {
    let root = Covariance::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    let product = root * root.transpose() + Covariance::identity();
    (product + product.transpose()) * 0.005
}

fn value(i: usize, j: usize) -> f64 {
    ((i * 5 + j * 11) as f64 * 0.9).cos()
}

/// A velocity fix whose noise is correlated with the state error as in exact VB: S = U diag(3, 1.2, 0) Uᵀ.
struct SingularFix {
    h: SMatrix<f64, 3, DIM>,
    c: SMatrix<f64, DIM, 3>,
    s: Matrix3<f64>,
    /// S⁺.
    inverse: Matrix3<f64>,
    z: Vector3<f64>,
    innovation: Innovation,
}

fn singular_fix(p: &Covariance) -> SingularFix {
    let h = SMatrix::<f64, 3, DIM>::from_fn(value);
    let c = SMatrix::<f64, DIM, 3>::from_fn(|k, m| 0.05 * value(k + 3, m));
    let axes = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.9).into_inner();
    let of = |values: [f64; 3]| axes * Matrix3::from_diagonal(&values.into()) * axes.transpose();
    let s = of([3.0, 1.2, 0.0]);
    let half = h * c;
    let noise = s - h * p * h.transpose() - half - half.transpose();
    let z = Vector3::new(0.03, -0.02, 0.05);
    let mut innovation = Innovation {
        rows: 3,
        degrees: 3,
        ..Innovation::empty()
    };
    innovation.residual.fixed_rows_mut::<3>(0).copy_from(&z);
    innovation.jacobian.fixed_rows_mut::<3>(0).copy_from(&h);
    innovation.noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&noise);
    let mut cross = SMatrix::<f64, DIM, MAX_ROWS>::zeros();
    cross.fixed_columns_mut::<3>(0).copy_from(&c);
    innovation.cross = Some(Box::new(cross));
    let inverse = of([1.0 / 3.0, 1.0 / 1.2, 0.0]);
    SingularFix {
        h,
        c,
        s,
        inverse,
        z,
        innovation,
    }
}

/// With the pseudo-inverse of S: K = (P Hᵀ + C) S⁺, δx = K z, P − K S Kᵀ, NIS = zᵀ S⁺ z with two degrees of freedom.
#[test]
fn a_singular_innovation_is_updated_with_its_pseudo_inverse() {
    let p = covariance();
    let fix = singular_fix(&p);
    let mut filter = filter();
    filter.set_covariance(&p).unwrap();
    let mut expected = filter.state();
    let report = filter.update_correlated(&fix.innovation, 2, Sensor::Velocity).unwrap();

    let gain = (p * fix.h.transpose() + fix.c) * fix.inverse;
    assert_eq!((report.rows, report.degrees, report.verdict), (2, 2, Verdict::Accepted));
    let nis = fix.z.dot(&(fix.inverse * fix.z));
    assert!((report.nis / nis - 1.0).abs() < 1e-9, "{} of {nis}", report.nis);
    expected.inject(&(gain * fix.z));
    assert!(expected.error_of(&filter.state()).amax() < 1e-12);
    assert!((filter.covariance() - (p - gain * fix.s * gain.transpose())).amax() < 1e-12);
}

/// Without a cross-covariance the noise is independent of the state.
#[test]
fn a_fix_without_correlation_has_none() {
    let p = covariance();
    let fix = singular_fix(&p);
    let mut innovation = fix.innovation.clone();
    innovation.cross = None;
    let noise = Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3));
    innovation.noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&noise);
    let (mut correlated, mut plain) = (filter(), filter());
    for filter in [&mut correlated, &mut plain] {
        filter.set_covariance(&p).unwrap();
    }
    correlated.update_correlated(&innovation, 3, Sensor::Velocity).unwrap();
    plain.update(&innovation, Sensor::Velocity).unwrap();
    assert!((correlated.covariance() - plain.covariance()).amax() < 1e-12);
    assert!(correlated.state().error_of(&plain.state()).amax() < 1e-12);
}

/// The causes of the correlation are turned with the rows, for the smoother.
#[test]
fn the_causes_of_a_correlation_turn_with_its_rows() {
    let mut noise = CorrelatedNoise::default();
    noise
        .by_state
        .set_column(VELOCITY, &SVector::from_fn(|m, _| m as f64 + 1.0));
    noise.by_further.set_column(1, &SVector::from_fn(|m, _| m as f64 + 2.0));
    let mut axes = SMatrix::<f64, MAX_ROWS, MAX_ROWS>::zeros();
    axes[(0, 1)] = 1.0;
    (axes[(1, 0)], axes[(1, 2)]) = (1.0, -1.0);
    let turned = noise.turned(&axes);
    assert_eq!(
        [turned.by_state[(0, VELOCITY)], turned.by_state[(1, VELOCITY)]],
        [2.0, -2.0]
    );
    assert_eq!([turned.by_further[(0, 1)], turned.by_further[(1, 1)]], [3.0, -2.0]);
}

/// A covariance that is not symmetric beyond rounding, or has a negative variance, is refused and named; the filter keeps its
/// own.
#[test]
fn a_covariance_is_symmetric_and_positive() {
    let mut filter = filter();
    let own = filter.covariance();
    let matrix_of = |outcome: Result<(), NavError>| match outcome {
        Err(NavError::NotPositiveDefinite { matrix, .. }) => matrix,
        other => panic!("{other:?}"),
    };
    let scale = covariance().amax();
    for (by, is_refused) in [(0.9e-9, false), (1.1e-9, true)] {
        let mut skewed = covariance();
        // Half of it goes to either side of the mean.
        skewed[(2, 5)] += 2.0 * by * scale;
        assert_eq!(filter.clone().set_covariance(&skewed).is_err(), is_refused, "{by}");
    }
    let mut skewed = covariance();
    skewed[(2, 5)] += 0.5;
    assert_eq!(matrix_of(filter.set_covariance(&skewed)), "covariance (not symmetric)");
    for (index, block) in [(4, "misalignment_t_rad"), (19, "dvl_scale_factor")] {
        let mut negative = covariance();
        negative[(index, index)] *= -1.0;
        assert_eq!(matrix_of(filter.set_covariance(&negative)), block);
    }
    // Indefinite with every variance positive.
    let mut beyond = covariance();
    (beyond[(0, 1)], beyond[(1, 0)]) = (1.0, 1.0);
    assert_eq!(matrix_of(filter.set_covariance(&beyond)), "state covariance");
    assert_eq!(filter.covariance(), own);
    // The only fault of frozen states is none.
    let frozen = Model::table_2().initial_covariance(false);
    filter.set_covariance(&frozen).unwrap();
    assert_eq!(filter.covariance(), frozen);
    // They are not what is named where others are at fault.
    let mut beyond = frozen;
    (beyond[(0, 1)], beyond[(1, 0)]) = (5.0, 5.0);
    assert_eq!(matrix_of(filter.set_covariance(&beyond)), "state covariance");
}

/// ω_ip is the last rate less the estimated bias; one reading of the gyro has the variance N²/Δt, and none before the first step.
#[test]
fn a_motion_has_the_rate_without_its_bias() {
    let mut filter = filter();
    filter.state.gyro_bias_p_radps = Vec3::new(0.0, 0.25, 0.0);
    let reading = imu(0, [0.1, 0.2, 0.3], [0.0, 0.0, -9.8]);
    filter.note_rate(&reading);
    let density = filter.settings.noise.gyro;
    assert!(density > 0.0);
    let of = |filter: &Eskf| filter.with_motion(|motion| (motion.rate_ip_p_radps, motion.gyro_variance));
    let (rate, variance) = of(&filter);
    assert!((rate - Vector3::new(0.1, -0.05, 0.3)).norm() < 1e-15);
    assert_eq!(variance, 0.0);
    filter.note_interval(0.02);
    assert!((of(&filter).1 / (50.0 * density) - 1.0).abs() < 1e-12);
}

/// Any number of rows is updated at once: m rows of an information of one each.
#[test]
fn as_many_rows_as_a_measurement_has() {
    let p = covariance();
    for rows in 0..=MAX_ROWS {
        let mut innovation = Innovation {
            rows,
            degrees: rows,
            ..Innovation::empty()
        };
        for row in 0..rows {
            innovation.jacobian[(row, row)] = 1.0;
            innovation.noise[(row, row)] = 1.0;
        }
        let mut filter = filter();
        filter.set_covariance(&p).unwrap();
        let report = filter.update(&innovation, Sensor::Velocity).unwrap();
        assert_eq!(report.rows, rows);
        assert_eq!(report.was_used(), rows > 0);
        let mut information = p.try_inverse().unwrap();
        (0..rows).for_each(|row| information[(row, row)] += 1.0);
        assert!(
            (filter.covariance() - information.try_inverse().unwrap()).amax() < 1e-12,
            "{rows}"
        );
    }
}

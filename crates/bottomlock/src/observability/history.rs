//! Covariance analysis: the covariance of the filter along a truth, without simulated errors.
//!
//! Between epochs the covariance is propagated in steps of about 0.1 s with trapezoidal process noise. At an epoch one
//! Kalman update uses all rows.

use nalgebra::{DMatrix, DVector};

use super::{Aiding, Epochs, System, full, magnus, paper};
use crate::dvl::geometry::BeamGeometry;
use crate::earth::EarthModel;
use crate::error::{NavError, require_finite_squares};
use crate::error_model::{Coefficients, dense_noise};
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Inertial};
use crate::model::Model;
use crate::simulation::truth::{Truth, true_state};
use crate::stop::Stop;

/// Longest step of the prediction, ns.
const STEP_NS: i64 = 100_000_000;

/// Covariances over a window.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Times of the epochs, ns.
    pub time_ns: Vec<i64>,
    /// Covariance after the update of each epoch; the first includes the first update.
    pub covariance: Vec<DMatrix<f64>>,
}

/// Covariances of the 20-state filter along a truth.
///
/// # Errors
/// As [`full::systems`]; [`NavError::NotPositiveDefinite`] for an innovation covariance that cannot be factorised;
/// [`NavError::Interrupted`] where `stop` asks for an early end.
pub fn of_filter(
    truth: &Truth<'_>,
    geometry: &BeamGeometry,
    model: &Model,
    aiding: &Aiding,
    estimate_dvl: bool,
    epochs: Epochs<'_>,
    stop: &Stop,
) -> Result<History, NavError> {
    let mut systems = full::systems(truth, geometry, model, &[*aiding], true, epochs)?;
    let system = systems.remove(0);
    let initial = model.initial_covariance(estimate_dvl);
    let noise = model.process_noise(estimate_dvl);
    let earth = EarthTerms::from(&model.environment.on(EarthModel::TangentPlane));
    let density = |k: usize| {
        let inertial = Inertial {
            rate_p_radps: truth.omega_p_radps[k],
            force_p_mps2: truth.force_p_mps2[k],
        };
        let coefficients = Coefficients::at(&true_state(truth, k).kinematics(), &inertial, &earth);
        let rows = dense_noise(&coefficients, &noise);
        DMatrix::from_fn(DIM, DIM, |i, j| rows[i][j])
    };
    let between = |a: usize, b: usize| {
        let block = magnus::transition(truth, a, b, &model.environment, false);
        full::platform(truth, a, b, &block, DIM)
    };
    let initial = DMatrix::from_fn(DIM, DIM, |i, j| initial[(i, j)]);
    run(truth, &system, initial, between, density, stop)
}

/// Covariances of the 2015 model along a truth.
///
/// # Errors
/// As [`paper::system`]; [`NavError::NotPositiveDefinite`] for an innovation covariance that cannot be factorised;
/// [`NavError::Interrupted`] where `stop` asks for an early end.
pub fn of_paper(
    truth: &Truth<'_>,
    model: &Model,
    sensors: &paper::Sensors,
    period_ns: i64,
    stop: &Stop,
) -> Result<History, NavError> {
    let system = paper::system(truth, model, sensors, period_ns)?;
    let states = system.states();
    let dropped = 15 - states;
    let cut = |m: DMatrix<f64>| m.view((dropped, dropped), (states, states)).into_owned();
    let (initial, imu) = (&model.initial, &model.imu);
    let triples = [
        initial.position_sd_m,
        initial.velocity_sd_mps,
        initial.attitude_sd_rad,
        [imu.accel_bias_sd_mps2; 3],
        [imu.gyro_bias_sd_radps; 3],
    ];
    let square = |values: Vec<f64>| DMatrix::from_diagonal(&DVector::from_iterator(15, values.iter().map(|x| x * x)));
    let walks = [
        0.0,
        imu.accel_noise_mps_rts,
        imu.gyro_noise_rad_rts,
        imu.accel_bias_walk_mps2_rts,
        imu.gyro_bias_walk_radps_rts,
    ];
    let density = cut(square(walks.iter().flat_map(|&walk| [walk; 3]).collect()));
    run(
        truth,
        &system,
        cut(square(triples.concat())),
        |a, b| cut(paper::transition(truth, a, b, &model.environment)),
        |_| density.clone(),
        stop,
    )
}

/// Propagates and updates a covariance over the epochs of a system.
fn run(
    truth: &Truth<'_>,
    system: &System,
    initial: DMatrix<f64>,
    between: impl Fn(usize, usize) -> DMatrix<f64>,
    density: impl Fn(usize) -> DMatrix<f64>,
    stop: &Stop,
) -> Result<History, NavError> {
    let mut p = initial;
    let mut out = History {
        time_ns: Vec::with_capacity(system.epochs.len()),
        covariance: Vec::with_capacity(system.epochs.len()),
    };
    let mut k = 0;
    for epoch in &system.epochs {
        stop.check()?;
        while truth.time_ns[k] < epoch.time_ns {
            let limit = truth.time_ns[k].saturating_add(STEP_NS).min(epoch.time_ns);
            let next = truth
                .time_ns
                .partition_point(|&t| t <= limit)
                .saturating_sub(1)
                .max(k + 1);
            let half_s = 0.5e-9 * (truth.time_ns[next] - truth.time_ns[k]) as f64;
            let phi = between(k, next);
            p = &phi * (p + density(k) * half_s) * phi.transpose() + density(next) * half_s;
            k = next;
        }
        p = updated(&p, &epoch.rows, &epoch.noise, epoch.time_ns)?;
        require_finite_squares("state covariance", epoch.time_ns, p.as_slice())?;
        if p.diagonal().iter().any(|&variance| variance < 0.0) {
            return Err(NavError::NotPositiveDefinite {
                matrix: "state covariance",
                time_ns: epoch.time_ns,
            });
        }
        out.time_ns.push(epoch.time_ns);
        out.covariance.push(p.clone());
    }
    Ok(out)
}

/// Covariance after an update, in Joseph's form, which keeps it symmetric and positive for precise measurements.
fn updated(p: &DMatrix<f64>, h: &DMatrix<f64>, r: &DMatrix<f64>, time_ns: i64) -> Result<DMatrix<f64>, NavError> {
    if h.nrows() == 0 {
        return Ok(p.clone());
    }
    let cross_covariance = p * h.transpose();
    let factor = (h * &cross_covariance + r)
        .cholesky()
        .ok_or(NavError::NotPositiveDefinite {
            matrix: "innovation covariance",
            time_ns,
        })?;
    let gain = factor.solve(&cross_covariance.transpose()).transpose();
    let keep = DMatrix::identity(p.nrows(), p.nrows()) - &gain * h;
    let joseph = &keep * p * keep.transpose() + &gain * r * gain.transpose();
    Ok((&joseph + joseph.transpose()) * 0.5)
}

//! The 20-state model of the filter along a truth, with the rows of any sensors (Tal et al. 2017, Eqs. 4, 9, 18, 22 in
//! full).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::magnus::{self, Block, MOVING};
use super::{Aiding, Epoch, Epochs, StateKind, System, epoch_samples, scheduled_samples};
use crate::aiding;
use crate::aiding::registry::reports;
use crate::aiding::sensor::Quantity;
use crate::aiding::{Innovation, Motion};
use crate::dvl::geometry::{BeamGeometry, BeamSample, MAX_BEAMS};
use crate::earth::LocalLevel;
use crate::error::NavError;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DVL_SCALE, GYRO_BIAS, POSITION, VELOCITY};
use crate::model::Model;
use crate::simulation::truth::{Truth, true_state};

/// Names of the states in the order of [`crate::layout`].
pub const NAMES: [&str; DIM] = [
    "position north",
    "position east",
    "position down",
    "tilt north",
    "tilt east",
    "yaw",
    "velocity x",
    "velocity y",
    "velocity z",
    "accel bias x",
    "accel bias y",
    "accel bias z",
    "gyro bias x",
    "gyro bias y",
    "gyro bias z",
    "beam bias 1",
    "beam bias 2",
    "beam bias 3",
    "beam bias 4",
    "scale factor",
];

/// Number of states without beam biases and scale factor.
pub const INERTIAL: usize = DVL_BIAS;

fn kind(index: usize) -> StateKind {
    match index {
        POSITION..ATTITUDE => StateKind::Position,
        ATTITUDE..VELOCITY => StateKind::Tilt,
        VELOCITY..ACCEL_BIAS => StateKind::Velocity,
        ACCEL_BIAS..GYRO_BIAS => StateKind::AccelBias,
        GYRO_BIAS..DVL_BIAS => StateKind::GyroBias,
        DVL_BIAS..DVL_SCALE => StateKind::BeamBias,
        _ => StateKind::ScaleFactor,
    }
}

/// The linear system of a truth for each of several aiding sets.
///
/// With `estimate_dvl` false the system has the first 15 states. Transition matrices are of fourth order in the sample
/// interval and are computed once for all sets.
///
/// # Errors
/// [`NavError`] for an invalid truth, model or aiding set, which names the field and the time.
pub fn systems(
    truth: &Truth<'_>,
    geometry: &BeamGeometry,
    model: &Model,
    aidings: &[Aiding],
    estimate_dvl: bool,
    epochs: Epochs<'_>,
) -> Result<Vec<System>, NavError> {
    model.validate()?;
    aidings.iter().try_for_each(|aiding| aiding.validate(geometry))?;
    let samples = match epochs {
        Epochs::Every(period_ns) => epoch_samples(truth, period_ns)?,
        Epochs::Scheduled(scheduled) => scheduled_samples(truth, scheduled)?,
    };
    let states = if estimate_dvl { DIM } else { INERTIAL };
    let transitions = transitions(truth, model, &samples, states);
    let system = |aiding: &Aiding| {
        let epoch = |(index, &k): (usize, &usize)| -> Epoch {
            let sensors = match epochs {
                Epochs::Every(_) => *aiding,
                Epochs::Scheduled(scheduled) => aiding.and(&scheduled[index].1),
            };
            let (rows, row_scale, noise) = rows(truth, k, geometry, model, &sensors);
            let (transition, coarse) = transitions[index].clone();
            Epoch {
                time_ns: truth.time_ns[k],
                transition,
                coarse,
                rows: rows.columns(0, states).into_owned(),
                row_scale,
                noise,
            }
        };
        System {
            names: NAMES[..states].iter().map(ToString::to_string).collect(),
            kinds: (0..states).map(kind).collect(),
            gravity_mps2: model.environment.gravity_mps2,
            speed_mps: largest_speed(truth),
            epochs: samples.iter().enumerate().map(epoch).collect(),
        }
    };
    Ok(aidings.iter().map(system).collect())
}

/// Φ(t_k, t_0) at the samples, and the same from half as many truth samples.
fn transitions(
    truth: &Truth<'_>,
    model: &Model,
    samples: &[usize],
    states: usize,
) -> Vec<(DMatrix<f64>, DMatrix<f64>)> {
    let (mut fine, mut coarse) = (Block::identity(), Block::identity());
    let first = samples[0];
    let mut before = first;
    let mut out = Vec::with_capacity(samples.len());
    for &k in samples {
        if k > before {
            fine = magnus::transition(truth, before, k, &model.environment, false) * fine;
            coarse = magnus::transition(truth, before, k, &model.environment, true) * coarse;
        }
        before = k;
        let in_platform = |block: &Block| platform(truth, first, k, block, states);
        out.push((in_platform(&fine), in_platform(&coarse)));
    }
    out
}

/// Largest speed along a truth, m/s.
pub(super) fn largest_speed(truth: &Truth<'_>) -> f64 {
    truth
        .velocity_p_mps
        .iter()
        .map(|v| Vector3::from(*v).norm())
        .fold(0.0, f64::max)
}

/// Φ between two samples for the platform velocity, with the constant DVL states.
pub(super) fn platform(truth: &Truth<'_>, from: usize, to: usize, block: &Block, states: usize) -> DMatrix<f64> {
    let (start, end): (Matrix3<f64>, Matrix3<f64>) = (truth.attitude(from).matrix(), truth.attitude(to).matrix());
    let mut in_platform = *block;
    let columns = in_platform.fixed_columns::<3>(VELOCITY) * start;
    in_platform.fixed_columns_mut::<3>(VELOCITY).copy_from(&columns);
    let rows = end.transpose() * in_platform.fixed_rows::<3>(VELOCITY);
    in_platform.fixed_rows_mut::<3>(VELOCITY).copy_from(&rows);
    let mut out = DMatrix::identity(states, states);
    out.view_mut((0, 0), (MOVING, MOVING)).copy_from(&in_platform);
    out
}

/// Rows, their scales and their noise at a truth sample, on the true state.
fn rows(
    truth: &Truth<'_>,
    k: usize,
    geometry: &BeamGeometry,
    model: &Model,
    which: &Aiding,
) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let state = true_state(truth, k);
    let duration_s = (truth.time_ns[truth.time_ns.len() - 1] - truth.time_ns[0]) as f64 * 1e-9;
    let tilt = 1.0 / (model.environment.gravity_mps2 * duration_s);
    let motion = Motion {
        state: &state,
        rate_ip_p_radps: Vector3::from(truth.omega_p_radps[k]),
        earth_rate_t_radps: model.environment.earth_rate_t_radps().0,
        gyro_variance: 0.0,
        level: LocalLevel::of_plane(&state.position_t_m),
        water: None,
    };
    let mut parts: Vec<(Innovation, f64)> = Vec::new();
    if which.beams.count() > 0 {
        let ping = BeamSample {
            time_ns: truth.time_ns[k],
            velocity_mps: [0.0; MAX_BEAMS],
            sd_mps: [model.sensors.dvl.beam_noise_sd_mps; MAX_BEAMS],
            valid: which.beams,
        };
        let terms = aiding::beam_terms(&motion, geometry, &ping);
        parts.push((aiding::tightly_coupled(&terms, &ping), 1.0));
    }
    for (kind, report) in reports().filter(|(_, report)| which.sensors.contains(*report)) {
        let size = match report.quantity() {
            Some(Quantity::Position) => duration_s,
            Some(Quantity::Velocity) | None => 1.0,
            Some(Quantity::Angle) => tilt,
        };
        let measurement = kind
            .declaration()
            .of_truth(&motion, which.levers.of(kind), &model.sensors);
        parts.push((measurement.innovation(report, &motion, &which.levers), size));
    }
    let count = parts.iter().map(|(part, _)| part.rows).sum();
    let mut h = DMatrix::zeros(count, DIM);
    let mut scale = DVector::zeros(count);
    let mut noise = DMatrix::zeros(count, count);
    let mut row = 0;
    for (part, size) in parts {
        h.rows_mut(row, part.rows).copy_from(&part.jacobian.rows(0, part.rows));
        scale.rows_mut(row, part.rows).fill(size);
        noise
            .view_mut((row, row), (part.rows, part.rows))
            .copy_from(&part.noise.view((0, 0), (part.rows, part.rows)));
        row += part.rows;
    }
    (h, scale, noise)
}

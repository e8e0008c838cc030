//! The names that most unit tests use, and what they check by.

pub(crate) use crate::aiding::attitude::{MagnetometerModel, attitude};
pub(crate) use crate::aiding::calibration::CalibrationPrior;
pub(crate) use crate::aiding::current_layers::{LayerVector, Water};
pub(crate) use crate::aiding::depth::{DepthModel, depth};
pub(crate) use crate::aiding::further::{Block, FurtherVector, block};
pub(crate) use crate::aiding::heading::{HeadingModel, heading};
pub(crate) use crate::aiding::motion_prior::MotionPrior;
pub(crate) use crate::aiding::position::position;
pub(crate) use crate::aiding::registry::{Sensor, SensorKind};
pub(crate) use crate::aiding::sensor::{SlowSd, TimeConstant, WalkTime, WavePeriod};
pub(crate) use crate::aiding::thrust::{ThrustModel, ThrustSample, ThrustUse};
pub(crate) use crate::aiding::velocity::velocity;
pub(crate) use crate::aiding::water::{CURRENT, WATER, WaterPrior, WaterVector};
pub(crate) use crate::aiding::{Innovation, MAX_ROWS, Motion, beam_terms, tightly_coupled};
pub(crate) use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
pub(crate) use crate::dvl::partial::{Assumptions, BeamNoise, PartialMethod, fix_estimator};
pub(crate) use crate::earth::{Earth, EarthModel, Environment, LocalLevel};
pub(crate) use crate::error::NavError;
pub(crate) use crate::filter::Eskf;
pub(crate) use crate::filter::gate::Gate;
pub(crate) use crate::filter::options::Options;
pub(crate) use crate::filter::report::Verdict;
pub(crate) use crate::filter::water_block::WaterBlock;
pub(crate) use crate::frames::{Platform, Rot, Tangent, Vec3};
pub(crate) use crate::layout::{ATTITUDE, DIM, DVL_BIAS, POSITION, VELOCITY};
pub(crate) use crate::mechanisation::ImuSample;
pub(crate) use crate::model::Model;
pub(crate) use crate::navigator::events::{DepthSample, Event};
pub(crate) use crate::navigator::{METHODS, Method, Navigator};
pub(crate) use crate::random::Normals;
pub(crate) use crate::replay::replay;
pub(crate) use crate::replay::tests::steady_turn;
pub(crate) use crate::simd::on_every_level;
pub(crate) use crate::state::{Covariance, ErrorVector, NavState};
pub(crate) use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

/// −∂residual/∂x by central differences of a step: asserts that its columns are those stated.
pub(crate) fn assert_slopes<const M: usize, const N: usize>(
    place: &str,
    stated: &SMatrix<f64, M, N>,
    [step, allowed]: [f64; 2],
    residual_at: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
) {
    for j in 0..N {
        let by = SVector::from_fn(|k, _| if k == j { step } else { 0.0 });
        let gap = ((residual_at(&-by) - residual_at(&by)) / (2.0 * step) - stated.column(j)).amax();
        assert!(gap < allowed, "{place}, column {j}: off by {gap}");
    }
}

/// The numbers of a block of further states.
pub(crate) fn part<const N: usize>(of: &FurtherVector, block: Block) -> SVector<f64, N> {
    of.fixed_rows::<N>(block.first).into_owned()
}

/// An inertial reading: rate, rad/s, and force, m/s², platform frame.
pub(crate) fn imu(time_ns: i64, rate: [f64; 3], force: [f64; 3]) -> ImuSample {
    ImuSample {
        time_ns,
        rate_p_radps: Vec3::from_array(rate),
        force_p_mps2: Vec3::from_array(force),
    }
}

/// A ping whose beams have the same standard deviation, m/s.
pub(crate) fn ping_of(time_ns: i64, velocity_mps: [f64; MAX_BEAMS], sd_mps: f64, valid: BeamMask) -> BeamSample {
    BeamSample {
        time_ns,
        velocity_mps,
        sd_mps: [sd_mps; MAX_BEAMS],
        valid,
    }
}

/// A ping at time 0 of all four beams without errors, of a velocity in the platform frame, m/s.
pub(crate) fn ping_at(geometry: &BeamGeometry, velocity_p_mps: [f64; 3], sd_mps: f64) -> BeamSample {
    let velocity = Vector3::from(velocity_p_mps);
    let reading = |beam| match beam {
        0..4 => geometry.direction_p(beam).dot(&velocity),
        _ => f64::NAN,
    };
    ping_of(0, std::array::from_fn(reading), sd_mps, BeamMask::all(4))
}

/// Components of the velocity from surge on: residuals, m/s, of one variance.
pub(crate) fn velocity_rows(residuals: &[f64], variance: f64) -> Innovation {
    let rows = residuals.len();
    let mut innovation = Innovation {
        rows,
        degrees: rows,
        ..Innovation::empty()
    };
    for (row, residual) in residuals.iter().enumerate() {
        innovation.residual[row] = *residual;
        innovation.jacobian[(row, VELOCITY + row)] = 1.0;
        innovation.noise[(row, row)] = variance;
    }
    innovation
}

/// Every measurement is taken, and the covariance propagated at every step.
pub(crate) fn every_step() -> Options {
    Options {
        gate: Gate::Off,
        covariance_period_ns: 0,
        ..Options::default()
    }
}

/// Words of a refusal, and the change that earns it.
pub(crate) type Fault<T> = (&'static str, fn(&mut T));

/// Asserts that a value passes its check, and with each of the changes fails it in a message that has the words.
pub(crate) fn assert_refused<T: Clone>(good: &T, check: impl Fn(&T) -> Result<(), NavError>, faults: &[Fault<T>]) {
    assert_eq!(check(good), Ok(()));
    for (number, (words, change)) in faults.iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad);
        let text = check(&bad).expect_err(&format!("fault {number}, {words}")).to_string();
        assert!(text.contains(words), "fault {number}: {text} has no {words}");
    }
}

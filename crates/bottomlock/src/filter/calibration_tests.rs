//! Mounting and clock: what is certain, what they add to noise, and the accelerations that they need.

use super::*;
use crate::aiding::CorrelatedNoise;
use crate::aiding::calibration::{CALIBRATION, CLOCK, CalibrationCovariance, CalibrationVector};
use crate::aiding::further::FURTHER;
use crate::aiding::water::sway_row;
use crate::filter::level_turn::advance;
use crate::filter::mean_change::MeanChange;
use crate::frames::skew;
use crate::layout::GYRO_BIAS;
use crate::testing::*;

const PRIOR: CalibrationPrior = CalibrationPrior {
    mounting_sd_rad: [0.02, 0.03, 0.05],
    clock_sd_s: 0.1,
};

fn filter() -> Eskf {
    let mut model = Model::table_2();
    model.sensors.depth = DepthModel {
        sd_m: 0.02,
        bias_sd_m: 0.3,
        bias_time_s: TimeConstant(100.0),
        ..DepthModel::default()
    };
    // Within the linear range.
    model.initial.attitude_sd_rad = [1e-3; 3];
    let options = Options {
        calibration: PRIOR,
        ..every_step()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    Eskf::new(state, &model, &options)
        .unwrap()
        .with_water(Some(WaterBlock::new(&options.water)))
}

fn change(filter: &Eskf) -> &MeanChange {
    filter.extensions.change.as_deref().unwrap()
}

/// Covariance of the error state with mounting and clock.
fn cross(filter: &Eskf) -> SMatrix<f64, DIM, CALIBRATION> {
    let further = filter.extensions.further().cross();
    further
        .fixed_columns::<CALIBRATION>(block::CALIBRATION.first)
        .into_owned()
}

fn ping(valid: BeamMask) -> BeamSample {
    ping_of(0, [0.6, -0.3, -0.4, 0.5, 0.0, 0.0, 0.0, 0.0], 0.01, valid)
}

fn geometry() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 0.5)
        .unwrap()
        .with_lever_arms(&[Vec3::new(1.0, 0.2, 0.3); 4])
        .unwrap()
}

/// An unknown without prior deviation stays what it is, to the last bit.
#[test]
fn what_is_certain_stays() {
    let mut options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    options.calibration.mounting_sd_rad = [0.0, 0.0, 0.05];
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    let mut filter = Eskf::new(state, &Model::table_2(), &options).unwrap();
    advance(&mut filter, 50);
    filter.prepare_for_ping();
    let sample = ping(BeamMask::all(4));
    let innovation = tightly_coupled(&filter.beam_terms(&geometry(), &sample), &sample);
    filter.update(&innovation, Sensor::Beams).unwrap();
    let (estimate, covariance) = filter.calibration().unwrap();
    let numbers = estimate.numbers();
    assert!(numbers[2] != 0.0 && covariance[(2, 2)] < 0.0025);
    assert_eq!((numbers[0], numbers[1], numbers[CLOCK]), (0.0, 0.0, 0.0));
    assert_eq!(
        (covariance[(0, 0)], covariance[(1, 1)], covariance[(CLOCK, CLOCK)]),
        (0.0, 0.0, 0.0)
    );
}

/// Off, there is nothing; a covariance set from outside begins anew.
#[test]
fn begins_at_the_prior() {
    let without = Eskf::new(NavState::at_rest(0), &Model::table_2(), &Options::default()).unwrap();
    assert!(without.calibration().is_none() && without.extensions.is_empty());
    let mut filter = filter();
    advance(&mut filter, 50);
    filter.prepare_for_ping();
    let sample = ping(BeamMask::all(4));
    let innovation = tightly_coupled(&filter.beam_terms(&geometry(), &sample), &sample);
    filter.update(&innovation, Sensor::Beams).unwrap();
    assert!(cross(&filter).amax() > 0.0);
    let covariance = filter.covariance();
    filter.set_covariance(&covariance).unwrap();
    let (estimate, covariance) = filter.calibration().unwrap();
    assert_eq!(estimate, Calibration::default());
    assert_eq!(
        covariance,
        CalibrationCovariance::from_diagonal(&CalibrationVector::from([0.02, 0.03, 0.05, 0.1].map(|sd: f64| sd * sd)))
    );
}

/// A filter whose every state beside the others is correlated with mounting and clock.
fn correlated() -> Eskf {
    let mut filter = filter();
    for _ in 0..2 {
        advance(&mut filter, 30);
        filter.prepare_for_ping();
        let sample = ping(BeamMask::all(4));
        let innovation = tightly_coupled(&filter.beam_terms(&geometry(), &sample), &sample);
        filter.update(&innovation, Sensor::Beams).unwrap();
        let innovation = depth(
            &Motion::still(&filter.state()),
            0.3,
            0.02,
            &Vec3::from_array([0.4, 0.1, -0.2]),
        );
        filter.update(&innovation, Sensor::Depth).unwrap();
        let water = filter.water_states().unwrap().estimate;
        let assumed = filter.with_motion(|motion| sway_row(motion, &water));
        filter.assume(&assumed, Sensor::Sway).unwrap();
    }
    filter
}

/// What mounting and clock add to S is (H J Hᵀ of error state, mounting and clock) less that of the error state alone; to noise with
/// causes among the states, the same without H.
#[test]
fn added_noise_is_that_of_the_joint_covariance() {
    let mut filter = correlated();
    filter.prepare_for_ping();
    assert!(cross(&filter).amax() > 1e-6);
    let mut terms = filter.beam_terms(&geometry(), &ping(BeamMask::all(4)));
    let rows = terms.by_further.clone().unwrap();
    let (p, further) = (filter.covariance(), filter.extensions.further().clone());
    let whole = DMatrix::from_fn(DIM + FURTHER, DIM + FURTHER, |i, j| match (i < DIM, j < DIM) {
        (true, true) => p[(i, j)],
        (true, false) => further.cross()[(i, j - DIM)],
        (false, true) => further.cross()[(j, i - DIM)],
        (false, false) => further.covariance()[(i - DIM, j - DIM)],
    });
    let both = DMatrix::from_fn(MAX_ROWS, DIM + FURTHER, |i, j| {
        if j < DIM {
            terms.jacobian[(i, j)]
        } else {
            rows[(i, j - DIM)]
        }
    });
    let own = DMatrix::from_fn(DIM, DIM, |i, j| p[(i, j)]);
    let h = DMatrix::from_fn(MAX_ROWS, DIM, |i, j| terms.jacobian[(i, j)]);
    let added = &both * &whole * both.transpose() - &h * own * h.transpose();
    let before = terms.noise;
    filter.add_further_to(&mut terms);
    for i in 0..MAX_ROWS {
        for j in 0..MAX_ROWS {
            let got = terms.noise[(i, j)] - before[(i, j)];
            assert!(
                (got - added[(i, j)]).abs() < 1e-12,
                "({i}, {j}): {got} of {}",
                added[(i, j)]
            );
        }
    }

    // n = D δx + C δc + independent: C δc adds D X Cᵀ, its transpose and C P_c Cᵀ to R, and X Cᵀ to E[δx nᵀ].
    let mut innovation = tightly_coupled(&terms, &ping(BeamMask::all(4)));
    innovation.by_further = None;
    let mut noise = CorrelatedNoise::default();
    noise
        .by_state
        .set_column(VELOCITY, &nalgebra::SVector::from_fn(|i, _| 0.3 + i as f64));
    innovation.correlated_noise = Some(Box::new(noise.clone()));
    let before = innovation.noise;
    further.add_to(&mut innovation, &rows);
    let x = further.cross() * rows.transpose();
    let half = noise.by_state * x;
    let expected = rows.as_ref() * further.covariance() * rows.transpose() + half + half.transpose();
    assert!(half.amax() > 1e-6 && (innovation.noise - before - expected).amax() < 1e-12);
    assert!((**innovation.cross.as_ref().unwrap() - x).amax() < 1e-15);
    assert_eq!(innovation.correlated_noise.unwrap().by_further, *rows);
}

/// A correction of the velocity is no acceleration.
#[test]
fn corrections_are_no_acceleration() {
    let mut filter = filter();
    advance(&mut filter, 50);
    filter.prepare_for_ping();
    let before = change(&filter).acceleration_p_mps2;
    let innovation = velocity_rows(&[1.0], 1e-6);
    filter.update(&innovation, Sensor::Velocity).unwrap();
    assert!(filter.state().velocity_p_mps.0.x > 2.9);
    advance(&mut filter, 10);
    filter.prepare_for_ping();
    let after = change(&filter).acceleration_p_mps2;
    // 1 m/s within a step of 10 ms would be 4 m/s² a time constant later.
    assert!((after - before).x.abs() < 0.1, "{before} {after}");
}

/// The velocity's change by the states: −[ω×] by itself, with the bias off the rate, and −[v×] by the gyro's bias.
#[test]
fn change_of_the_velocity_by_the_states() {
    let mut filter = filter();
    advance(&mut filter, 1);
    filter.state.gyro_bias_p_radps = Vec3::new(0.002, -0.003, 0.004);
    let f = filter.velocity_by_state();
    let earth = filter.kinematics.rotation_t_p;
    let turn: [f64; 3] = std::array::from_fn(|k| {
        let of_earth: f64 = (0..3).map(|i| earth[i][k] * filter.settings.earth.rate_t[i]).sum();
        [-0.002, 0.013, 0.096][k] + of_earth
    });
    let velocity = Vector3::from(filter.kinematics.velocity_p_mps);
    for (start, expected) in [(VELOCITY, -skew(&Vector3::from(turn))), (GYRO_BIAS, -skew(&velocity))] {
        let block: Matrix3<f64> = f.fixed_view::<3, 3>(0, start).into();
        assert!((block - expected).amax() < 1e-12, "{start}: {block} {expected}");
    }
}

/// Numbers from bytes are finite, or named.
#[test]
fn restored_numbers_are_checked() {
    let filter = correlated();
    let faults: [Fault<MeanChange>; 2] = [
        ("", |change| change.acceleration_p_mps2.y = f64::NAN),
        ("", |change| change.angular_acceleration_p_radps2.z = f64::NAN),
    ];
    assert_refused(change(&filter), |one| one.check_restored(3), &faults);
}

/// Before a ping the mean acceleration is that up to it, though the covariance is not due.
#[test]
fn a_ping_finds_the_acceleration_up_to_date() {
    let options = Options {
        calibration: PRIOR,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    advance(&mut filter, 5);
    assert_eq!(change(&filter).acceleration_p_mps2, Vector3::zeros());
    filter.prepare_for_ping();
    assert!((change(&filter).acceleration_p_mps2.y - 0.2).abs() < 0.01);
}

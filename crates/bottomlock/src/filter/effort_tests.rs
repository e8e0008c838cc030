//! What a filter takes of forces: the acceleration that the strapdown found, what drag and mass are wrong by, and when.

use super::*;
use crate::aiding::Corrects;
use crate::aiding::effort::{INERTIA, SLIP};
use crate::aiding::registry::{Levers, Measurement, Sensor};
use crate::aiding::sensor::{Fraction, TimeConstant};
use crate::aiding::thrust::ThrustUse;
use crate::filter::options::Options;
use crate::filter::water_block::WaterBlock;
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::state::NavState;

const GRAVITY: f64 = 9.8;

fn model() -> Model {
    let mut model = Model::table_2();
    model.environment.gravity_mps2 = GRAVITY;
    model.environment.earth_rate_radps = 0.0;
    model.sensors.effort = EffortModel {
        mass_kg: [20.0; 3],
        linear_drag_kgps: [100.0, 200.0, 0.0],
        speed_scale_sd: Fraction(0.1),
        speed_scale_time_s: TimeConstant(1000.0),
        inertia_sd: Fraction(0.2),
        slip_sd_mps: 0.02,
        slip_time_s: TimeConstant(5.0),
        noise_sd_n: 1.0,
        ..EffortModel::default()
    };
    model
}

fn filter(used: ThrustUse, speed_mps: f64) -> Eskf {
    let options = Options {
        thrust: used,
        covariance_period_ns: 0,
        ..Options::default()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(speed_mps, 0.0, 0.0);
    let water = WaterBlock::new(&options.water);
    Eskf::new(state, &model(), &options).unwrap().with_water(Some(water))
}

fn reading(time_ns: i64, force_mps2: [f64; 3]) -> ImuSample {
    ImuSample {
        time_ns,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
        force_p_mps2: Vec3::from_array(force_mps2),
    }
}

fn forces(time_ns: i64, surge_n: f64) -> Measurement {
    EffortSample {
        time_ns,
        force_p_n: Vec3::new(surge_n, 0.0, 0.0),
        sd_n: 1.0,
    }
    .into()
}

fn surge_of(filter: &Eskf, measurement: &Measurement) -> Innovation {
    filter.aiding_innovation(measurement, Sensor::EffortSurge, &Levers::default(), Corrects::All)
}

/// Hand-worked: 0.2 m/s² for a second bring the vehicle from 1 m/s to 1.2 m/s, and 20 kg take 4 N of 124 N; 120 N are 1.2 m/s.
#[test]
fn an_acceleration_by_hand() {
    let mut filter = filter(ThrustUse::All, 1.0);
    let samples: Vec<ImuSample> = (0..=100)
        .map(|k| reading(k * 10_000_000, [0.2, 0.0, -GRAVITY]))
        .collect();
    filter.predict_along(&samples).unwrap();
    filter.prepare_for_thrust();
    let row = surge_of(&filter, &forces(1_000_000_000, 124.0));
    let whole = filter.with_further_noise(&row).unwrap();
    assert!(whole.residual[0].abs() < 1e-9, "{}", whole.residual[0]);
    let inertia = row.by_further.unwrap()[(0, FIRST_EFFORT + INERTIA)];
    assert!((inertia - 20.0 * 0.2 / 100.0).abs() < 1e-9, "{inertia}");
}

/// The states are there with the option and a drag, and begin at the model: speed as by the drag law; they go back to it.
#[test]
fn states_at_their_model() {
    let mut with = filter(ThrustUse::Velocity, 1.0);
    let (estimate, covariance) = with.effort().unwrap();
    // No drag along heave: no state.
    let expected = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(estimate.as_slice(), expected);
    let sd = covariance.diagonal().map(f64::sqrt);
    for (k, expected) in [0.1, 0.1, 0.0, 0.02, 0.02, 0.0, 0.2, 0.2, 0.0].into_iter().enumerate() {
        assert!((sd[k] - expected).abs() < 1e-15);
    }
    assert!(with.thrust().is_none());
    with.prepare_for_thrust();
    let row = surge_of(&with, &forces(0, 130.0));
    with.update(&row, Sensor::EffortSurge).unwrap();
    let found = with.effort().unwrap().0;
    assert!(found[SPEED_SCALE] < 0.99 && found[SLIP] < -1e-4, "{found}");
    // exp(−1000 s / 1000 s) of it is left.
    let left = with.extensions.processes.left(1000.0);
    with.extensions.processes.propagate(1000.0, &left);
    let later = with.effort().unwrap().0;
    let expected = 1.0 + (found[SPEED_SCALE] - 1.0) * (-1.0_f64).exp();
    assert!((later[SPEED_SCALE] - expected).abs() < 1e-12 && later[SLIP].abs() < 1e-80);
    with.extensions.restart(&with.kinematics.clone());
    assert_eq!(with.effort().unwrap().0[SPEED_SCALE], 1.0);

    let off = Eskf::new(NavState::at_rest(0), &model(), &Options::default()).unwrap();
    assert!(off.effort().is_none());
    let mut wrong = model();
    wrong.sensors.effort.mass_kg[0] = 0.0;
    let options = Options {
        thrust: ThrustUse::All,
        ..Options::default()
    };
    let error = Eskf::new(NavState::at_rest(0), &wrong, &options).unwrap_err();
    assert!(error.to_string().contains("effort.mass_kg"), "{error}");
    // Without the states there is no row.
    assert_eq!(
        off.effort_innovation(
            0,
            &EffortSample {
                time_ns: 0,
                force_p_n: Vec3::new(1.0, 0.0, 0.0),
                sd_n: 1.0
            },
            &Vec3::new(0.0, 0.0, 0.0)
        )
        .rows,
        0
    );
}

/// In a world that is the model's, twenty minutes along a way that turns leave the errors of speed, slip and mass within their claim.
#[test]
fn drag_is_learned() {
    // 20 % more drag: the speed is 1/1.2 of that by the law.
    let (truth, mut filter) = (1.0 / 1.2, filter(ThrustUse::All, 1.0));
    let mut time_ns = 0;
    for k in 0..600 {
        let force_n = if k % 2 == 0 { 120.0 } else { 60.0 };
        let speed = truth * force_n / 100.0;
        time_ns += 2_000_000_000;
        let mut state = filter.state();
        state.time_ns = time_ns;
        state.velocity_p_mps = Vec3::new(speed, 0.0, 0.0);
        filter.state = state;
        filter.kinematics = state.kinematics();
        filter.extensions.begin_interval(&state.kinematics());
        filter.prepare_for_thrust();
        let measurement = forces(time_ns, force_n);
        let row = filter.aiding_innovation(
            &measurement,
            Sensor::EffortSurge,
            &Levers::default(),
            Corrects::ThroughWater,
        );
        filter.update(&row, Sensor::EffortSurge).unwrap();
    }
    let (estimate, covariance) = filter.effort().unwrap();
    let error = estimate[SPEED_SCALE] - truth;
    let sd = covariance[(SPEED_SCALE, SPEED_SCALE)].sqrt();
    assert!(error.abs() < 2.0 * sd && error.abs() < 0.03, "{error} {sd}");
}

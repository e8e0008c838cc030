//! Advance and slip by hand, and what a row corrects.

use proptest::prelude::*;

use super::*;
use crate::aiding::further::FURTHER;
use crate::aiding::sensor::TimeConstant;
use crate::aiding::thrust::{PER_METRE, SLIP, ThrustModel, ThrustUse, thrust};
use crate::aiding::{Corrects, Innovation};
use crate::filter::gate::Gate;
use crate::filter::options::Options;
use crate::filter::report::Sensor;
use crate::filter::water_block::WaterBlock;
use crate::frames::{Rot, Vec3};
use crate::layout::{DIM, VELOCITY};
use crate::model::Model;
use crate::state::NavState;

fn filter(state: NavState) -> Eskf {
    let options = Options {
        gate: Gate::Off,
        thrust: ThrustUse::Velocity,
        covariance_period_ns: 0,
        ..Options::default()
    };
    let mut model = Model::table_2();
    model.sensors.thrust = ThrustModel {
        revolutions_per_m: 10.0,
        revolutions_per_m_sd: 1.0,
        slip_sd_hz: 0.2,
        slip_time_s: TimeConstant(5.0),
        noise_sd_hz: 0.1,
        ..ThrustModel::default()
    };
    let water = WaterBlock::new(&options.water);
    Eskf::new(state, &model, &options).unwrap().with_water(Some(water))
}

fn update(filter: &mut Eskf, revolutions_hz: f64, corrects: Corrects) {
    let row = filter.with_motion(|motion| thrust(motion, revolutions_hz, 0.1));
    filter.update(&Innovation { corrects, ..row }, Sensor::Thrust).unwrap();
}

/// Hand-worked: level and heading north at 2 m/s, 22 turns a second where 20 are expected. Of the two turns each takes by its
/// variance: velocity 10² · 0.0025, current 10² · 0.09, turns per metre 2² · 1, slip 0.04, noise 0.01 (1/s)².
#[test]
fn by_hand() {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    for corrects in [Corrects::All, Corrects::Velocity] {
        let mut filter = filter(state);
        let (before, _) = filter.thrust().unwrap();
        assert_eq!([before[PER_METRE], before[SLIP]], [10.0, 0.0]);
        update(&mut filter, 22.0, corrects);
        let share = 2.0 / (0.25 + 9.0 + 4.0 + 0.04 + 0.01);
        let (estimate, covariance) = filter.thrust().unwrap();
        assert!((estimate[PER_METRE] - (10.0 + share * 2.0)).abs() < 1e-12);
        assert!((estimate[SLIP] - share * 0.04).abs() < 1e-12);
        assert!((filter.state().velocity_p_mps.0.x - (2.0 + share * 0.025)).abs() < 1e-12);
        assert!((filter.current().unwrap().0.x + share * 0.9).abs() < 1e-12);
        let left = 1.0 - 4.0 * share / 2.0;
        assert!((covariance[(PER_METRE, PER_METRE)] - left).abs() < 1e-12);
    }
    assert!(filter(state).with_water(None).thrust().is_some());
    let off = Eskf::new(state, &Model::table_2(), &Options::default()).unwrap();
    assert!(off.thrust().is_none());
}

/// The options need a model of the propeller.
#[test]
fn a_model_is_needed() {
    let options = Options {
        thrust: ThrustUse::All,
        ..Options::default()
    };
    let error = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap_err();
    assert!(error.to_string().contains("thrust.revolutions_per_m"), "{error}");
}

proptest! {
    /// Whatever the attitude, the covariance and the revolutions, a row that corrects the velocity alone leaves position, attitude,
    /// biases and the DVL's errors as they are; its covariance is that of Schmidt's filter: no variance is
    /// below that of the optimal update, and all of it is Joseph's form of its gain, written out over all states.
    #[test]
    fn the_velocity_alone(
        angles in prop::array::uniform3(-3.0..3.0_f64),
        revolutions_hz in prop_oneof![-40.0..-1.0_f64, 1.0..40.0_f64],
        seed in prop::collection::vec(-1.0..1.0_f64, DIM * DIM),
    ) {
        let mut state = NavState::at_rest(0);
        state.attitude_t_p = Rot::from_euler_rad(angles[0], angles[1] / 2.0, angles[2]);
        state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.2);
        let mut before = filter(state);
        let prior = before.covariance();
        let root = crate::state::Covariance::from_vec(seed);
        let sd = prior.diagonal().map(f64::sqrt);
        let mixed = crate::state::Covariance::from_diagonal(&sd) * root * 0.3;
        before.set_covariance(&{
            let joint = prior + mixed * mixed.transpose();
            (joint + joint.transpose()) * 0.5
        }).unwrap();
        before.set_water(Some(WaterBlock::new(&Options::default().water)));
        let (mut partial, mut whole) = (before.clone(), before.clone());
        update(&mut partial, revolutions_hz, Corrects::Velocity);
        update(&mut whole, revolutions_hz, Corrects::All);
        let (was, is) = (before.state(), partial.state());
        prop_assert_eq!(was.position_t_m, is.position_t_m);
        let turned = (was.attitude_t_p.inverse() * is.attitude_t_p).log();
        prop_assert!(turned.amax() < 1e-15);
        prop_assert_eq!(was.accel_bias_p_mps2, is.accel_bias_p_mps2);
        prop_assert_eq!(was.gyro_bias_p_radps, is.gyro_bias_p_radps);
        prop_assert_eq!(was.dvl_bias_mps, is.dvl_bias_mps);
        prop_assert!((whole.state().velocity_p_mps.0 - is.velocity_p_mps.0).amax() < 1e-12);

        let joint = before.joint_covariance();
        let row = before.with_motion(|motion| thrust(motion, revolutions_hz, 0.1));
        let further: Vec<usize> = before.extensions.further().states().collect();
        let h = nalgebra::DMatrix::from_fn(1, joint.nrows(), |_, k| {
            if k < DIM { row.jacobian[(0, k)] } else { row.by_further.as_ref().unwrap()[(0, further[k - DIM])] }
        });
        let s = (&h * &joint * h.transpose())[0] + 1e-2;
        let mut gain = &joint * h.transpose() / s;
        for k in (0..DIM).filter(|k| !(VELOCITY..VELOCITY + 3).contains(k)) {
            gain[k] = 0.0;
        }
        let reduce = nalgebra::DMatrix::identity(joint.nrows(), joint.nrows()) - &gain * h;
        let expected = &reduce * &joint * reduce.transpose() + &gain * gain.transpose() * 1e-2;
        let (found, optimal) = (partial.joint_covariance(), whole.joint_covariance());
        for i in 0..joint.nrows() {
            for k in 0..joint.nrows() {
                let scale = (joint[(i, i)] * joint[(k, k)]).sqrt();
                prop_assert!((found[(i, k)] - expected[(i, k)]).abs() <= 1e-9 * scale, "{i}, {k}");
            }
            prop_assert!(optimal[(i, i)] <= found[(i, i)] * (1.0 + 1e-9));
        }
    }
}

/// The corrected further states are those of motion, thrust and water, and none where a depth corrects itself.
#[test]
fn further_states_that_are_corrected() {
    assert_eq!(Corrects::All.further_states(), 0..FURTHER);
    assert!(Corrects::Depth.further_states().is_empty());
    let alone = Corrects::Velocity.further_states();
    assert!(alone.contains(&FIRST_THRUST) && alone.end == FURTHER);
    assert!(!alone.contains(&(crate::aiding::further::FIRST_MOTION - 1)));
}

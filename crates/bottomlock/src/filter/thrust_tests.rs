//! Scale and slip by hand, and what a row corrects.

use proptest::prelude::*;

use super::*;
use crate::aiding::Corrects;
use crate::aiding::further::FURTHER;
use crate::aiding::thrust::{SCALE, SLIP, thrust};
use crate::filter::report::UpdateReport;
use crate::testing::*;

fn filter(state: NavState) -> Eskf {
    let options = Options {
        thrust: ThrustUse::Velocity,
        ..every_step()
    };
    let mut model = Model::table_2();
    model.sensors.thrust = ThrustModel {
        scale_sd: [0.1, 0.0, 0.0],
        slip_sd_mps: [0.02, 0.0, 0.0],
        slip_time_s: TimeConstant(5.0),
        noise_sd_mps: 0.01,
        ..ThrustModel::default()
    };
    let water = WaterBlock::new(&options.water);
    Eskf::new(state, &model, &options).unwrap().with_water(Some(water))
}

fn sample(speed_mps: f64) -> ThrustSample {
    ThrustSample {
        time_ns: 0,
        speed_p_mps: Vec3::new(speed_mps, 0.7, 0.0),
        sd_mps: 0.01,
    }
}

fn row_of(filter: &Eskf, speed_mps: f64) -> Innovation {
    filter.with_motion(|motion| thrust(0, motion, &sample(speed_mps), &Vec3::zeros()))
}

fn known_row(filter: &Eskf, sensor: Sensor, speed_mps: f64, corrects: Corrects) -> Innovation {
    filter.aiding_innovation(&sample(speed_mps).into(), sensor, &Levers::default(), corrects)
}

fn update(filter: &mut Eskf, speed_mps: f64, corrects: Corrects) -> UpdateReport {
    filter.prepare_for_thrust();
    let row = known_row(filter, Sensor::ThrustSurge, speed_mps, corrects);
    filter.update(&row, Sensor::ThrustSurge).unwrap()
}

/// Hand-worked: level and heading north at 2 m/s with σ 0.05 m/s, the propeller says 2.2 m/s. Variances with 2.2 m/s in
/// the column of the scale: velocity 0.0025, current 0.09, scale (2.2 · 0.1)² = 0.0484, slip 0.0004, noise 0.0001, together
/// 0.1414 m²/s². Slip and noise are 1/282.8 of it, so that 2.2 − 2/282.8 m/s are without ten times as much; of the 0.2 m/s each
/// then takes by its variance. Along sway, which the model does not use, there is no row whatever is said.
#[test]
fn by_hand() {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    for corrects in [Corrects::All, Corrects::Velocity] {
        let mut filter = filter(state);
        let (before, _) = filter.thrust().unwrap();
        assert_eq!([before[SCALE], before[SCALE + 1], before[SLIP]], [1.0, 0.0, 0.0]);
        assert_eq!(known_row(&filter, Sensor::ThrustSway, 2.2, corrects).rows, 0);
        let report = update(&mut filter, 2.2, corrects);
        assert!((report.residual[0] - 0.2).abs() < 1e-12);
        let said_mps: f64 = 2.2 - 2.0 / 282.8;
        let share = 0.2 / (0.093 + (said_mps * 0.1).powi(2));
        let (estimate, covariance) = filter.thrust().unwrap();
        assert!((estimate[SCALE] - (1.0 - share * said_mps * 1e-2)).abs() < 1e-12);
        assert!((estimate[SLIP] + share * 4e-4).abs() < 1e-12);
        assert!((filter.state().velocity_p_mps.0.x - (2.0 + share * 0.0025)).abs() < 1e-12);
        assert!((filter.current().unwrap().0.x + share * 0.09).abs() < 1e-12);
        let left = 1e-2 - (said_mps * 1e-2).powi(2) * share / 0.2;
        assert!((covariance[(SCALE, SCALE)] - left).abs() < 1e-12);
    }
    assert!(filter(state).with_water(None).thrust().is_some());
    let off = Eskf::new(state, &Model::table_2(), &Options::default()).unwrap();
    assert!(off.thrust().is_none());
}

/// The options need a model of the drives.
#[test]
fn a_model_is_needed() {
    let options = Options {
        thrust: ThrustUse::All,
        ..Options::default()
    };
    let error = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap_err();
    assert!(error.to_string().contains("thrust.slip_sd_mps"), "{error}");
}

proptest! {
    /// Whatever the attitude, the covariance and the speed that is said, a row that corrects the velocity alone leaves position, attitude,
    /// biases and the DVL's errors as they are; its covariance is that of Schmidt's filter: no variance is
    /// below that of the optimal update, and all of it is Joseph's form of its gain, written out over all states.
    #[test]
    fn the_velocity_alone(
        angles in prop::array::uniform3(-3.0..3.0_f64),
        speed_mps in prop_oneof![-4.0..-0.1_f64, 0.1..4.0_f64],
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
        update(&mut partial, speed_mps, Corrects::Velocity);
        update(&mut whole, speed_mps, Corrects::All);
        let (was, is) = (before.state(), partial.state());
        prop_assert_eq!(was.position_t_m, is.position_t_m);
        let turned = (was.attitude_t_p.inverse() * is.attitude_t_p).log();
        prop_assert!(turned.amax() < 1e-15);
        prop_assert_eq!(was.accel_bias_p_mps2, is.accel_bias_p_mps2);
        prop_assert_eq!(was.gyro_bias_p_radps, is.gyro_bias_p_radps);
        prop_assert_eq!(was.dvl_bias_mps, is.dvl_bias_mps);
        prop_assert!((whole.state().velocity_p_mps.0 - is.velocity_p_mps.0).amax() < 1e-12);

        let joint = before.joint_covariance();
        let row = known_row(&before, Sensor::ThrustSurge, speed_mps, Corrects::All);
        let further: Vec<usize> = before.extensions.further().states().collect();
        let h = nalgebra::DMatrix::from_fn(1, joint.nrows(), |_, k| {
            if k < DIM { row.jacobian[(0, k)] } else { row.by_further.as_ref().unwrap()[(0, further[k - DIM])] }
        });
        let s = (&h * &joint * h.transpose())[0] + 1e-4;
        let mut gain = &joint * h.transpose() / s;
        for k in (0..DIM).filter(|k| !(VELOCITY..VELOCITY + 3).contains(k)) {
            gain[k] = 0.0;
        }
        let reduce = nalgebra::DMatrix::identity(joint.nrows(), joint.nrows()) - &gain * h;
        let expected = &reduce * &joint * reduce.transpose() + &gain * gain.transpose() * 1e-4;
        let (found, optimal) = (partial.joint_covariance(), whole.joint_covariance());
        for i in 0..joint.nrows() {
            for k in 0..joint.nrows() {
                let scale = (joint[(i, i)] * joint[(k, k)]).sqrt();
                prop_assert!((found[(i, k)] - expected[(i, k)]).abs() <= 1e-9 * scale, "{i}, {k}");
            }
            // The position follows the path that the optimal update corrects.
            let is_position = (POSITION..POSITION + 3).contains(&i);
            prop_assert!(is_position || optimal[(i, i)] <= found[(i, i)] * (1.0 + 1e-9));
        }
    }
}

/// The corrected further states are those of motion, thrust and water, and none where a depth corrects itself.
#[test]
fn further_states_that_are_corrected() {
    assert_eq!(Corrects::All.further_states(), 0..FURTHER);
    assert!(Corrects::Depth.further_states().is_empty());
    let alone = Corrects::Velocity.further_states();
    assert!(alone.contains(&block::THRUST.first) && alone.end == FURTHER);
    assert!(!alone.contains(&(crate::aiding::further::block::MOTION.first - 1)));
    assert_eq!(Corrects::ThroughWater.further_states(), block::THRUST.first..FURTHER);
    assert!(block::BEAM_BIAS.range().all(|bias| !alone.contains(&bias)));
}

/// While the velocity is held, a row learns current and advance and leaves the error state as it is, covariance included.
#[test]
fn a_held_velocity_is_left_alone() {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let mut filter = filter(state);
    let (before, covariance) = (filter.state(), filter.covariance());
    update(&mut filter, 2.2, Corrects::ThroughWater);
    assert_eq!((filter.state(), filter.covariance()), (before, covariance));
    assert!(filter.thrust().unwrap().0[SCALE] < 0.999 && filter.current().unwrap().0.x < -0.1);
    let used = [ThrustUse::Velocity, ThrustUse::All].map(|used| [true, false].map(|is_held| used.corrects(is_held)));
    let expected = [[Corrects::ThroughWater, Corrects::Velocity], [Corrects::All; 2]];
    assert_eq!(used, expected);
}

/// At 2 m/s, read with white noise of 2 cm/s but a speed that does not change: a thousand readings
/// say the sum of scale and current and nothing of the two apart, whatever their own noise does. With half of it in the
/// Jacobian the scale ends 1.2 of its σ off. The first readings, before anything is known, still tell up to a twentieth of it apart.
#[test]
fn noise_is_no_change_of_speed() {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    for stream in 1..6 {
        let mut filter = filter(state);
        let mut random = crate::random::Normals::new([5; 32], stream);
        let certain = crate::state::Covariance::from_diagonal(&crate::state::ErrorVector::repeat(1e-8));
        filter.set_covariance(&certain).unwrap();
        for _ in 0..1000 {
            let further = filter.extensions.further.as_mut().unwrap();
            further.renew(block::THRUST.first + SLIP);
            update(&mut filter, 2.0 + 0.02 * random.one(), Corrects::ThroughWater);
        }
        let (estimate, covariance) = filter.thrust().unwrap();
        // Beside a current of σ 0.3 m/s the prior's 0.1 · 2 m/s = 0.2 m/s leave of it 0.3/√(0.3² + 0.2²).
        let sd = covariance[(SCALE, SCALE)].sqrt();
        assert!((sd / (0.1 * 0.3 / 0.13_f64.sqrt()) - 1.0).abs() < 0.1, "{sd}");
        let off = (estimate[SCALE] - 1.0) / sd;
        assert!(off.abs() < 1.0, "stream {stream}: {off} of its sigma");
    }
}

/// Five rejections that agree make slip, scale and current uncertain, each by its variance; others do not.
#[test]
fn rejections_are_charged_by_variances() {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let (scale, slip) = (block::THRUST.first + SCALE, block::THRUST.first + SLIP);
    for speed_mps in [4.5, 0.05] {
        let mut once = filter(state);
        let row = row_of(&once, speed_mps);
        let before = once.extensions.further().covariance().diagonal();
        let noted: Vec<_> = (0..5)
            .map(|_| once.note_rejected(&row, Sensor::ThrustSurge, false).unwrap())
            .collect();
        assert!(noted[..4].iter().all(Option::is_none));
        let charge = noted[4].as_ref().unwrap();
        let added = once.extensions.further().covariance().diagonal() - before;
        let factor = charge.factor.unwrap() - 1.0;
        assert!(factor > 1.0 && charge.to_sensor == 1.0, "{charge:?}");
        for (state, variance) in [(scale, 1e-2), (slip, 4e-4), (block::WATER.first, 0.09)] {
            assert!((added[state] / (variance * factor) - 1.0).abs() < 1e-9, "{state}");
        }
    }
    // Ahead and astern in turn is noise.
    let mut once = filter(state);
    let rows = [6.0, -2.0].map(|speed_mps| row_of(&once, speed_mps));
    assert!((0..20).all(|k| once.note_rejected(&rows[k % 2], Sensor::ThrustSurge, false) == Ok(None)));
}

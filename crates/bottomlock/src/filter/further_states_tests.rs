//! The further states of every block against a Kalman filter on all states.

use super::*;
use crate::aiding::RowJacobian;
use crate::aiding::calibration::CalibrationVector;
use crate::aiding::further::FurtherRows;
use crate::aiding::thrust::thrust;
use crate::aiding::water::sway_row;
use crate::filter::imu_matrix::MATRIX;
use crate::filter::level_turn::{advance, assert_close};
use crate::testing::*;

const ALL: usize = DIM + FURTHER;
const MOTION: MotionPrior = MotionPrior {
    mean_sd_mps: [1.0, 0.2, 0.1],
    mean_time_s: 5000.0,
    change_sd_mps: [0.1, 0.05, 0.03],
    change_time_s: [40.0, 20.0, 10.0],
};

/// A filter that has every further state.
fn filter() -> Eskf {
    let mut model = Model::table_2();
    model.sensors.depth = DepthModel {
        sd_m: 0.02,
        bias_sd_m: 0.3,
        bias_time_s: TimeConstant(100.0),
        wave_sd_m: SlowSd(0.4),
        wave_period_s: WavePeriod(7.0),
    };
    (model.imu.gyro_scale_sd, model.imu.gyro_misalignment_sd_rad) = (1e-3, 3e-3);
    (model.imu.gyro_g_sensitivity_sd_radps_per_mps2, model.imu.accel_scale_sd) = (1e-5, 1e-3);
    model.sensors.magnetometer = MagnetometerModel {
        yaw_offset_sd_rad: SlowSd(0.03),
        roll_pitch_offset_sd_rad: SlowSd(0.01),
        yaw_walk_sd_rad: SlowSd(0.02),
        roll_pitch_walk_sd_rad: SlowSd(0.005),
        walk_time_s: WalkTime(60.0),
        yaw_semicircular_sd_rad: SlowSd(0.02),
        yaw_quadrantal_sd_rad: SlowSd(0.01),
        ..model.sensors.magnetometer
    };
    model.sensors.heading = HeadingModel {
        sd_rad: 0.01,
        offset_sd_rad: SlowSd(0.02),
        walk_sd_rad: SlowSd(0.01),
        walk_time_s: WalkTime(200.0),
        semicircular_sd_rad: SlowSd(0.01),
        quadrantal_sd_rad: SlowSd(0.005),
    };
    model.sensors.thrust = ThrustModel {
        scale_sd: [0.1, 0.2, 0.1],
        slip_sd_mps: [0.02, 0.03, 0.02],
        slip_time_s: TimeConstant(5.0),
        ..ThrustModel::default()
    };
    // Within the linear range.
    model.initial.attitude_sd_rad = [1e-3; 3];
    let options = Options {
        calibration: CalibrationPrior {
            mounting_sd_rad: [0.02, 0.03, 0.05],
            clock_sd_s: 0.1,
        },
        motion: MOTION,
        thrust: ThrustUse::All,
        ..every_step()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    let filter = Eskf::new(state, &model, &options).unwrap();
    filter.with_beams(8, &model, true).with_water(Some(
        WaterBlock::new(&options.water).with_layers(&options.current_layers),
    ))
}

fn ping(valid: BeamMask) -> BeamSample {
    ping_of(0, [0.6, -0.3, -0.4, 0.5, 0.0, 0.0, 0.0, 0.0], 0.01, valid)
}

fn beams(filter: &mut Eskf, valid: BeamMask) -> Innovation {
    filter.prepare_for_ping();
    let geometry = BeamGeometry::janus(Janus::X, 0.5)
        .unwrap()
        .with_lever_arms(&[Vec3::new(1.0, 0.2, 0.3); 4])
        .unwrap();
    tightly_coupled(&filter.beam_terms(&geometry, &ping(valid)), &ping(valid))
}

/// An attitude that is off by a few hundredths of a radian.
fn attitude_reading(filter: &Eskf) -> Innovation {
    let off = Rot::<Tangent, Tangent>::exp(Vector3::new(0.01, -0.02, 0.03));
    attitude(
        &Motion::still(&filter.state()),
        &(off * filter.state().attitude_t_p),
        0.004,
        0.01,
    )
}

/// Readings of every sensor by turns.
fn readings(filter: &mut Eskf, round: usize) -> Vec<(Innovation, Sensor)> {
    let valid = [
        BeamMask::all(4),
        [0, 2].into_iter().collect(),
        [3].into_iter().collect(),
    ][round];
    let lever = Vec3::from_array([0.4, 0.1, -0.2]);
    let speeds = ThrustSample {
        time_ns: 0,
        speed_p_mps: Vec3::new(1.9, 0.2, -0.1),
        sd_mps: 0.01,
    };
    let along = |filter: &Eskf, axis| filter.with_motion(|motion| thrust(axis, motion, &speeds, &lever));
    vec![
        (beams(filter, valid), Sensor::Beams),
        (depth(&Motion::still(&filter.state()), 0.3, 0.02, &lever), Sensor::Depth),
        (attitude_reading(filter), Sensor::Attitude),
        (heading(&Motion::still(&filter.state()), 0.07, 0.01), Sensor::Heading),
        (MOTION.innovation(&filter.state()), Sensor::Motion),
        (along(filter, 0), Sensor::ThrustSurge),
        (along(filter, 1), Sensor::ThrustSway),
        (along(filter, 2), Sensor::ThrustHeave),
    ]
}

/// Covariance after the textbook's update of all states, and the error that it estimates; `estimate` is that of the
/// slow errors, which the residual still contains. Errors of the inertial sensors are considered.
fn updated(p: &DMatrix<f64>, innovation: &Innovation, estimate: &FurtherVector) -> (DMatrix<f64>, DVector<f64>) {
    let (m, rows) = (innovation.rows, innovation.by_further.as_deref().unwrap());
    let h = DMatrix::from_fn(m, ALL, |i, j| {
        if j < DIM {
            innovation.jacobian[(i, j)]
        } else {
            rows[(i, j - DIM)]
        }
    });
    let r = innovation.noise.view((0, 0), (m, m)).into_owned();
    let mut slow = *estimate;
    for open in [block::CALIBRATION, block::BEAM_BIAS, block::WATER, block::LAYERS] {
        slow.rows_range_mut(open.range()).fill(0.0);
    }
    let z = DVector::from_column_slice((innovation.residual - rows * slow).rows(0, m).as_slice());
    let mut gain = p * h.transpose() * (&h * p * h.transpose() + &r).try_inverse().unwrap();
    gain.rows_mut(DIM + MATRIX.start, MATRIX.len()).fill(0.0);
    let left = DMatrix::identity(ALL, ALL) - &gain * h;
    (&left * p * left.transpose() + &gain * r * gain.transpose(), gain * z)
}

/// Pings of four, two and one beam, depths, attitudes, headings, speeds by the drives and assumptions by turns: covariance of all states and
/// estimates of the slow errors are the textbook's.
#[test]
fn updates_are_the_textbook_updates_of_all_states() {
    let mut filter = filter();
    for round in 0..3 {
        for kind in 0..8 {
            advance(&mut filter, 30);
            let (innovation, sensor) = readings(&mut filter, round).swap_remove(kind);
            let (p, before) = (filter.joint_covariance(), *filter.extensions.further().estimate());
            let (mut calibrated, _) = filter.calibration().unwrap();
            let (expected, error) = updated(&p, &innovation, &before);
            filter.update(&innovation, sensor).unwrap();
            assert_close(&filter.joint_covariance(), &expected, 1e-9, sensor.name());
            for k in block::SLOW.into_iter().flat_map(Block::range) {
                let after = filter.extensions.further().estimate()[k];
                assert!((after - before[k] - error[DIM + k]).abs() < 1e-10, "{k}");
            }
            calibrated.inject(&CalibrationVector::from_fn(|k, _| {
                error[DIM + block::CALIBRATION.first + k]
            }));
            let gap = filter.calibration().unwrap().0.numbers() - calibrated.numbers();
            assert!(gap.amax() < 1e-10, "{}: {gap}", sensor.name());
        }
        let water = filter.water_states().unwrap().estimate;
        let assumed = filter.with_motion(|motion| sway_row(motion, &water));
        let mut begun = filter.clone();
        let added = begun.extensions.water.as_deref_mut().unwrap().begin_epoch(&assumed);
        begun
            .extensions
            .further
            .as_deref_mut()
            .unwrap()
            .add_variance(block::WATER.first + assumed.slip, added);
        let p = begun.joint_covariance();
        let mut rows = FurtherRows::zeros();
        rows.fixed_view_mut::<1, WATER>(0, block::WATER.first)
            .copy_from(&assumed.by_water.transpose());
        let mut by_state = RowJacobian::zeros();
        by_state.set_row(0, &assumed.by_state.transpose());
        let at = filter.current_at_vehicle().unwrap();
        filter.with_motion(|motion| at.complete(motion, &Vector3::zeros(), 0, &mut by_state, &mut rows));
        let h = DVector::from_fn(ALL, |i, _| if i < DIM { by_state[(0, i)] } else { rows[(0, i - DIM)] });
        let mut gain = &p * &h / (h.dot(&(&p * &h)) + assumed.variance);
        gain.rows_mut(DIM + MATRIX.start, MATRIX.len()).fill(0.0);
        let left = DMatrix::identity(ALL, ALL) - &gain * h.transpose();
        let expected = &left * p * left.transpose() + &gain * gain.transpose() * assumed.variance;
        let mut learnt = Water::common(&water);
        let step = WaterVector::from_fn(|k, _| gain[DIM + block::WATER.first + k] * assumed.residual);
        learnt.inject(gain[ATTITUDE + 2] * assumed.residual, &step, &LayerVector::zeros());
        filter.assume(&assumed, Sensor::Sway).unwrap();
        assert_close(&filter.joint_covariance(), &expected, 1e-9, "assumption");
        assert!((filter.water_states().unwrap().estimate - learnt.estimate).amax() < 1e-12);
    }
    assert!(filter.extensions.further().covariance()[(block::ATTITUDE_ERROR.first, block::WATER.first)] != 0.0);
}

/// Over an interval with all states correlated: Φ P Φᵀ + Q of all states, with the transition that the tape records.
#[test]
fn propagation_is_that_of_all_states() {
    let mut filter = filter();
    for kind in 0..8 {
        let (innovation, sensor) = readings(&mut filter, 0).swap_remove(kind);
        filter.update(&innovation, sensor).unwrap();
        advance(&mut filter, 1);
    }
    let before = filter.joint_covariance();
    filter.begin_tape();
    advance(&mut filter, 50);
    filter.propagated_covariance();
    let tape = filter.take_tape().unwrap();
    let [crate::filter::tape::Step::Transition(phi)] = tape.steps.as_slice() else {
        panic!("one transition");
    };
    let after = filter.joint_covariance();
    let carried = phi * &before * phi.transpose();
    let (steady, walk) = (filter.extensions.further().variance(), filter.extensions.further().walk);
    assert!(walk[block::BEAM_BIAS.first] > 0.0);
    for k in 0..block::WATER.first {
        let left = phi.view((DIM + k, DIM), (1, FURTHER)).norm();
        for i in (0..block::WATER.first).filter(|&i| i != k) {
            let gap = after[(DIM + i, DIM + k)] - carried[(DIM + i, DIM + k)];
            assert!(gap.abs() < 1e-13, "{i} {k}");
        }
        let expected = carried[(DIM + k, DIM + k)] + (1.0 - left * left) * steady[k] + walk[k] * 0.5;
        assert!((after[(DIM + k, DIM + k)] - expected).abs() < 1e-13, "{k}");
        for i in 0..DIM {
            assert!((after[(i, DIM + k)] - carried[(i, DIM + k)]).abs() < 1e-12, "{i} {k}");
        }
    }
}

/// What corrects the depth alone leaves the further states: Joseph's form of that gain.
#[test]
fn a_depth_alone_leaves_the_further_states() {
    let mut filter = filter();
    let mut wide = filter.covariance();
    (VELOCITY..VELOCITY + 3).for_each(|k| wide[(k, k)] = 1e4);
    filter.set_covariance(&wide).unwrap();
    advance(&mut filter, 10);
    assert!(filter.is_beyond_linear_range());
    let innovation = depth(&Motion::still(&filter.state()), 0.7, 0.02, &Vec3::zeros());
    filter.update(&innovation, Sensor::Depth).unwrap();
    let (estimate_m, sd_m) = filter.depth_bias_m().unwrap();
    assert!(estimate_m == 0.0 && (sd_m - 0.3).abs() < 1e-12);
    // The position has followed the reading, and its error is now minus that of the bias.
    let cross = filter.extensions.further().cross()[(POSITION + 2, 0)];
    assert!((cross / 0.09 + 1.0).abs() < 0.05);
}

/// A block that begins, or begins anew, is independent of all others; one that ends is gone.
#[test]
fn blocks_begin_and_end() {
    let begun = |block: Block, variances: &[f64]| {
        let processes = variances.iter().map(|variance| Process::constant(variance.sqrt()));
        (block, processes.collect())
    };
    let mut further = FurtherStates::none();
    assert!(further.is_empty());
    further.begin(&begun(block::DEPTH_WAVE, &[4.0, 9.0]));
    further.begin(&begun(block::DEPTH_BIAS, &[1.0]));
    assert_eq!(further.states().collect::<Vec<_>>(), [0, 1, 2]);
    further.covariance[(0, 2)] = 0.5;
    further.cross[(7, 2)] = 0.5;
    further.estimate[2] = 0.5;
    further.begin(&begun(block::DEPTH_WAVE, &[16.0, 25.0]));
    assert_eq!(
        further.covariance.diagonal().rows(0, 4),
        DVector::from_vec(vec![1.0, 16.0, 25.0, 0.0])
    );
    assert_eq!(
        (further.covariance[(0, 2)], further.cross.amax(), further.estimate[2]),
        (0.0, 0.0, 0.0)
    );
    further.end(block::DEPTH_WAVE);
    assert_eq!(further.states().collect::<Vec<_>>(), [0]);
    assert_eq!((further.covariance.amax(), further.variance.amax()), (1.0, 1.0));
}

/// Water states that start anew in a running filter are independent, and all others keep their correlations.
#[test]
fn water_states_start_anew() {
    let mut filter = filter();
    for kind in 0..8 {
        let (innovation, sensor) = readings(&mut filter, 0).swap_remove(kind);
        filter.update(&innovation, sensor).unwrap();
    }
    let before = filter.joint_covariance();
    let options = Options::default();
    let water = WaterBlock::new(&options.water).with_layers(&options.current_layers);
    let anew = filter.with_water(Some(water));
    let after = anew.joint_covariance();
    let kept = DIM + block::WATER.first;
    assert_eq!(after.view((0, 0), (kept, kept)), before.view((0, 0), (kept, kept)));
    assert_eq!(after.view((0, kept), (kept, FURTHER - block::WATER.first)).amax(), 0.0);
    assert_eq!(anew.with_water(None).joint_covariance().nrows(), kept);
}

/// Saved are the numbers of the states that there are; those that do not fit their blocks are refused.
#[test]
fn saved_states_are_those_that_there_are() {
    let mut filter = filter();
    let (innovation, sensor) = readings(&mut filter, 0).swap_remove(0);
    filter.update(&innovation, sensor).unwrap();
    let further = filter.with_water(None).extensions.further().clone();
    let saved = Saved::from(further.clone());
    assert_eq!(saved.cross.len(), block::WATER.first * DIM);
    assert_eq!(FurtherStates::try_from(saved.clone()), Ok(further));
    let faults: [fn(&mut Saved); 4] = [
        |saved| saved.blocks.push(0..usize::MAX),
        |saved| saved.processes.truncate(3),
        |saved| saved.cross.truncate(3),
        |saved| saved.covariance.push(0.0),
    ];
    for (number, change) in faults.into_iter().enumerate() {
        let mut bad = saved.clone();
        change(&mut bad);
        assert!(FurtherStates::try_from(bad).is_err(), "{number}");
    }
}

/// A move of the path takes the correlation of the position along.
#[test]
fn moves_with_the_path() {
    let mut further = FurtherStates::none();
    further.begin(&(block::DEPTH_BIAS, vec![Process::constant(1.0)]));
    further.cross = SMatrix::from_fn(|i, j| (i as f64 + 2.0 * j as f64 + 1.0) * 1e-3);
    let before = further.cross;
    let by = Matrix3::new(0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 5.0, 0.0, 0.0);
    let turned = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 2.0);
    further.move_to_corrected_path(&CorrectedPath {
        by_position: Some(turned),
        by_misalignment: by,
        offset_t_m: Vector3::new(7.0, 8.0, 9.0),
    });
    let expected = turned * before.fixed_rows::<3>(POSITION) + by * before.fixed_rows::<3>(ATTITUDE);
    assert!((further.cross.fixed_rows::<3>(POSITION) - expected).amax() < 1e-15);
    assert_eq!(
        further.cross.rows(ATTITUDE, DIM - ATTITUDE),
        before.rows(ATTITUDE, DIM - ATTITUDE)
    );
}

/// Numbers and blocks from bytes are those that a filter can have, or named.
#[test]
fn restored_numbers_are_checked() {
    let mut good = FurtherStates::none();
    good.begin(&(block::DEPTH_BIAS, vec![Process::lasting(1.0, 50.0)]));
    good.begin(&(block::DEPTH_WAVE, vec![Process::lasting(1.0, 8.0); 2]));
    let faults: [Fault<FurtherStates>; 8] = [
        ("", |further| further.mean[0] = f64::NAN),
        ("", |further| further.estimate[1] = f64::INFINITY),
        ("", |further| (further.variance[1], further.time_s[2]) = (1.0, 0.0)),
        ("", |further| further.covariance[(2, 1)] = f64::NAN),
        ("", |further| further.cross[(3, 1)] = f64::INFINITY),
        ("", |further| further.blocks.push(FURTHER..FURTHER + 9)),
        ("", |further| further.blocks.push(0..1)),
        ("", |further| further.blocks[0] = 0..2),
    ];
    assert_refused(&good, |one| one.check_restored(3), &faults);
}

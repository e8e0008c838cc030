//! Readings of every sensor: of a row of a log, of the true motion, and simulated with the draws of their streams.

use super::acoustic_position::{AcousticPositionModel, AcousticPositionSample};
use super::attitude::AttitudeSample;
use super::deviation::harmonics;
use super::gps::{GpsModel, GpsSample, GpsVelocity};
use super::heading::HeadingSample;
use super::registry::SensorModels;
use super::sensor::{AidingSensor, Fraction, Reading, Scene, Signed, TrueMotion};
use super::velocity::VelocitySample;
use crate::testing::*;

const SEED: [u8; 32] = [3; 32];
const NOW_NS: i64 = 5_000_000_000;
fn lever() -> Vec3<Platform> {
    Vec3::new(1.0, -2.0, 0.5)
}

/// (roll, pitch, yaw), rad.
const ANGLES: [f64; 3] = [0.3, -0.4, 1.2];

fn models() -> SensorModels {
    SensorModels {
        depth: DepthModel {
            sd_m: 0.2,
            bias_sd_m: 3.0,
            bias_time_s: TimeConstant(100.0),
            ..DepthModel::default()
        },
        magnetometer: MagnetometerModel {
            roll_pitch_sd_rad: 0.01,
            yaw_sd_rad: 0.05,
            yaw_semicircular_sd_rad: SlowSd(0.02),
            yaw_quadrantal_sd_rad: SlowSd(0.01),
            ..MagnetometerModel::default()
        },
        heading: HeadingModel {
            sd_rad: 0.03,
            semicircular_sd_rad: SlowSd(0.02),
            quadrantal_sd_rad: SlowSd(0.01),
            ..HeadingModel::default()
        },
        gps: GpsModel {
            position_sd_m: [1.0, 2.0, 4.0],
            velocity_sd_mps: [0.1, 0.2, 0.3],
        },
        acoustic_position: AcousticPositionModel {
            sd_m: 3.0,
            sd_per_range: 0.0,
            outlier_fraction: Fraction(0.0),
            ..AcousticPositionModel::default()
        },
        thrust: ThrustModel {
            scale_sd: [0.1, 0.0, 0.0],
            true_scale_error: Signed(0.2),
            slip_sd_mps: [0.2, 0.0, 0.0],
            slip_time_s: TimeConstant(5.0),
            noise_sd_mps: 0.3,
        },
        ..SensorModels::default()
    }
}

/// What the navigator is told: a tenth of it all.
fn claimed() -> SensorModels {
    let mut models = models();
    models.depth.sd_m = 0.02;
    models.magnetometer.roll_pitch_sd_rad = 0.001;
    models.magnetometer.yaw_sd_rad = 0.005;
    models.heading.sd_rad = 0.003;
    models.gps.position_sd_m = [0.1, 0.2, 0.4];
    models.gps.velocity_sd_mps = [0.01, 0.02, 0.03];
    models.acoustic_position.sd_m = 0.3;
    models.thrust.noise_sd_mps = 0.03;
    models
}

fn truth() -> TrueMotion {
    TrueMotion {
        position_t_m: Vector3::new(300.0, -20.0, 40.0),
        attitude_t_p: Rot::from_euler_rad(ANGLES[0], ANGLES[1], ANGLES[2]),
        velocity_p_mps: Vector3::new(2.0, 0.1, -0.2),
        omega_p_radps: Vector3::zeros(),
    }
}

/// A platform that does not turn.
fn still(state: &NavState) -> Motion<'_> {
    Motion::still(state)
}

/// A simulated reading with the given offset, and the first draws of its streams.
fn simulated<S: AidingSensor>(offset: f64) -> (S, Vec<Normals>) {
    let streams = S::SIMULATION.unwrap().random;
    let fresh = || -> Vec<Normals> { streams.iter().map(|&number| Normals::new(SEED, number)).collect() };
    let (actual, claimed, truth) = (models(), claimed(), truth());
    let scene = Scene {
        time_ns: NOW_NS,
        truth: &truth,
        level: LocalLevel::of_plane(&truth.position_t_m.into()),
        offset,
        lever_p_m: lever(),
        actual: &actual,
        claimed: &claimed,
    };
    let reading = S::simulate(&scene, &mut fresh()).unwrap();
    assert_eq!(reading.time_ns(), NOW_NS);
    (reading, fresh())
}

fn of_row<S: AidingSensor>(values: &[Option<&[f64]>]) -> S {
    assert_eq!(values.len(), S::LOG.len());
    let reading = S::of_row(NOW_NS, values, &claimed()).unwrap();
    assert_eq!(reading.time_ns(), NOW_NS);
    assert!(S::of_row(NOW_NS, &vec![None; values.len()], &claimed()).is_none());
    reading
}

fn of_truth<S: AidingSensor>() -> S {
    let mut state = NavState::at_rest(NOW_NS);
    let truth = truth();
    state.position_t_m = truth.position_t_m.into();
    state.attitude_t_p = truth.attitude_t_p;
    state.velocity_p_mps = truth.velocity_p_mps.into();
    let motion = still(&state);
    let reading = S::of_truth(&motion, &lever(), &claimed());
    assert_eq!(reading.time_ns(), NOW_NS);
    reading
}

/// The true depth, an offset, a bias and noise of their own streams.
#[test]
fn depths() {
    let (reading, mut draws) = simulated::<DepthSample>(7.0);
    let noise = 3.0 * draws[1].one() + 0.2 * draws[0].one();
    assert!((reading.depth_m - (47.0 + noise)).abs() < 1e-12);
    assert_eq!(reading.sd_m, 0.02);
    assert_eq!(reading.numbers(), [reading.depth_m]);
    let expected = DepthSample {
        time_ns: NOW_NS,
        depth_m: 12.5,
        sd_m: 0.02,
    };
    assert_eq!(of_row::<DepthSample>(&[Some(&[12.5])]), expected);
    assert_eq!(
        of_truth::<DepthSample>(),
        DepthSample {
            depth_m: 40.0,
            ..expected
        }
    );
}

/// The deviation at the true yaw, by the coefficients that the streams draw.
fn deviation(draws: &mut [Normals]) -> f64 {
    let drawn = draws.iter_mut().zip([0.02, 0.02, 0.01, 0.01]).zip(harmonics(ANGLES[2]));
    drawn.map(|((draw, sd), harmonic)| sd * draw.one() * harmonic).sum()
}

/// Yaw alone, with noise and deviation.
#[test]
fn headings() {
    let (reading, mut draws) = simulated::<HeadingSample>(0.0);
    let error = 0.03 * draws[0].one() + deviation(&mut draws[3..]);
    assert!((reading.yaw_rad - (ANGLES[2] + error)).abs() < 1e-12);
    assert_eq!(reading.sd_rad, 0.003);
    assert_eq!(reading.numbers(), [reading.yaw_rad]);
    let read: HeadingSample = of_row(&[Some(&[0.25])]);
    assert_eq!((read.yaw_rad, read.sd_rad), (0.25, 0.003));
    let read: HeadingSample = of_truth();
    assert!((read.yaw_rad - ANGLES[2]).abs() < 1e-12 && read.sd_rad == 0.003);
}

/// Each angle with its own noise, the yaw with its offset and its deviation besides.
#[test]
fn attitudes() {
    let (reading, mut draws) = simulated::<AttitudeSample>(0.7);
    let noise = draws[0].each(&[0.01, 0.01, 0.05]);
    let measured = reading.attitude_t_p.to_euler_rad();
    for (k, offset) in [0.0, 0.0, 0.7 + deviation(&mut draws[7..])].into_iter().enumerate() {
        assert!((measured[k] - (ANGLES[k] + offset + noise[k])).abs() < 1e-12, "{k}");
    }
    assert_eq!((reading.roll_pitch_sd_rad, reading.yaw_sd_rad), (0.001, 0.005));
    assert_eq!(reading.numbers(), reading.attitude_t_p.to_quaternion_wxyz());
    let read: AttitudeSample = of_row(&[Some(&truth().attitude_t_p.to_quaternion_wxyz())]);
    assert_eq!(read, of_truth());
    assert_eq!(read.attitude_t_p, truth().attitude_t_p);
    assert_eq!((read.roll_pitch_sd_rad, read.yaw_sd_rad), (0.001, 0.005));
}

/// What each coefficient of a deviation adds to the yaw moves the residual by its column, also near the vertical.
#[test]
fn a_deviation_moves_the_residual_by_its_columns() {
    const STEP: f64 = 1e-6;
    for (pitch, own_yaw) in [(0.3, 0.4), (-0.5, 2.0), (1.5, -1.0)] {
        let mut state = NavState::at_rest(0);
        state.attitude_t_p = Rot::from_euler_rad(0.2, pitch, own_yaw);
        for (k, harmonic) in harmonics(own_yaw).into_iter().enumerate() {
            let moved = [0.0, STEP].map(|step| {
                let measured = Rot::from_euler_rad(0.2, pitch, own_yaw + step * harmonic);
                attitude(&still(&state), &measured, 0.01, 0.01)
            });
            let by_step = (moved[1].residual - moved[0].residual) / STEP;
            let column = moved[0]
                .by_further
                .as_ref()
                .unwrap()
                .column(block::ATTITUDE_DEVIATION.first + k)
                .into_owned();
            assert!((by_step - column).amax() < 1e-8, "{pitch} {k}");
            let moved = [0.0, STEP].map(|step| heading(&still(&state), own_yaw + step * harmonic, 0.01));
            let by_step = (moved[1].residual - moved[0].residual) / STEP;
            let column = moved[0]
                .by_further
                .as_ref()
                .unwrap()
                .column(block::HEADING_DEVIATION.first + k)
                .into_owned();
            assert!((by_step - column).amax() < 1e-8, "{pitch} {k}");
        }
    }
}

/// A position and a velocity with noise of their own; a log has the position alone.
#[test]
fn gps_fixes() {
    let (reading, mut draws) = simulated::<GpsSample>(0.0);
    let position = truth().position_t_m + draws[0].each(&[1.0, 2.0, 4.0]);
    let true_t_mps = (truth().attitude_t_p * Vec3::from(truth().velocity_p_mps)).0;
    let velocity = true_t_mps + draws[1].each(&[0.1, 0.2, 0.3]);
    let read = reading.velocity.unwrap();
    assert!((reading.position_t_m.0 - position).norm() < 1e-12);
    assert!((read.velocity_t_mps.0 - velocity).norm() < 1e-12);
    assert_eq!(
        (reading.position_sd_m, read.sd_mps),
        ([0.1, 0.2, 0.4], [0.01, 0.02, 0.03])
    );
    let (p, v) = (reading.position_t_m.to_array(), read.velocity_t_mps.to_array());
    assert_eq!(reading.numbers(), [p, v].concat());

    let read: GpsSample = of_row(&[Some(&[1.0, 2.0, 3.0])]);
    assert_eq!(
        (read.position_t_m, read.position_sd_m),
        (Vec3::new(1.0, 2.0, 3.0), [0.1, 0.2, 0.4])
    );
    assert!(read.velocity.is_none() && read.numbers()[3..].iter().all(|number| number.is_nan()));
    assert!(read.gives(Sensor::GpsPosition) && !read.gives(Sensor::GpsVelocity) && reading.gives(Sensor::GpsVelocity));
    let state = NavState::at_rest(NOW_NS);
    let motion = still(&state);
    let row = |report| {
        reading
            .innovation(report, &motion, &Vec3::zeros())
            .residual
            .fixed_rows::<3>(0)
            .into_owned()
    };
    assert_eq!(row(Sensor::GpsPosition), reading.position_t_m.0 - state.position_t_m.0);
    assert_eq!(row(Sensor::GpsVelocity), reading.velocity.unwrap().velocity_t_mps.0);

    let read: GpsSample = of_truth();
    let expected = GpsVelocity {
        velocity_t_mps: true_t_mps.into(),
        sd_mps: [0.01, 0.02, 0.03],
    };
    assert_eq!(
        (read.position_t_m.0, read.velocity),
        (truth().position_t_m, Some(expected))
    );
    assert_eq!(read.position_sd_m, [0.1, 0.2, 0.4]);
}

/// Of the transponder at its lever arm. A log need not state the deviations of a fix.
#[test]
fn acoustic_fixes() {
    let (reading, mut draws) = simulated::<AcousticPositionSample>(0.0);
    let lever_t_m = (truth().attitude_t_p * lever()).0;
    let transponder_t_m = truth().position_t_m + lever_t_m;
    assert!((reading.position_t_m.0 - (transponder_t_m + draws[0].each(&[3.0; 3]))).norm() < 1e-12);
    assert_eq!(reading.sd_m, [0.3; 3]);
    assert_eq!(reading.numbers(), [reading.position_t_m.to_array(), [0.3; 3]].concat());

    let optional: Vec<_> = AcousticPositionSample::LOG
        .iter()
        .filter(|column| column.optional)
        .collect();
    assert!(matches!(optional[..], [column] if column.key == "acoustic_position_sd_m"));
    let place: &[f64] = &[1.0, 2.0, 3.0];
    let bare: AcousticPositionSample = of_row(&[Some(place), None]);
    assert_eq!((bare.position_t_m, bare.sd_m), (Vec3::new(1.0, 2.0, 3.0), [0.3; 3]));
    let stated: AcousticPositionSample = of_row(&[Some(place), Some(&[4.0, 5.0, 6.0])]);
    assert_eq!(stated.sd_m, [4.0, 5.0, 6.0]);
    let read: AcousticPositionSample = of_truth();
    assert!((read.position_t_m.0 - transponder_t_m).norm() < 1e-12 && read.sd_m == [0.3; 3]);
}

/// The speed along the platform's forward axis less the current, slip and noise, over the scale of the simulated vehicle, which is
/// not what the filter assumes; what is read off the truth has no scale, on every axis that the model uses.
#[test]
fn speeds_by_the_drives() {
    let (reading, mut draws) = simulated::<ThrustSample>(0.4);
    let speed_mps = 2.0 - 0.4 - 0.2 * draws[1].one() - 0.3 * draws[0].one();
    let scale = 1.2 + 0.1 * draws[2].one();
    assert!((reading.speed_p_mps.0.x - speed_mps / scale).abs() < 1e-12);
    assert_eq!(
        (reading.sd_mps, reading.numbers()),
        (0.03, vec![reading.speed_p_mps.0.x, 0.0, 0.0])
    );
    let read: ThrustSample = of_row(&[Some(&[1.45, 0.1, 0.2])]);
    assert_eq!((read.speed_p_mps, read.sd_mps), (Vec3::new(1.45, 0.1, 0.2), 0.03));
    let read: ThrustSample = of_truth();
    assert_eq!((read.speed_p_mps.to_array(), read.sd_mps), ([2.0, 0.0, 0.0], 0.03));
}

/// A velocity of an instrument without beams is neither simulated nor in a log; its noise is that of a beam.
#[test]
fn velocities() {
    assert!(VelocitySample::SIMULATION.is_none() && VelocitySample::LOG.is_empty());
    let mut models = claimed();
    models.dvl.beam_noise_sd_mps = 0.5;
    let state = NavState::at_rest(NOW_NS);
    let motion = still(&state);
    let read = VelocitySample::of_truth(&motion, &lever(), &models);
    assert_eq!((read.time_ns(), read.cov_m2ps2), (NOW_NS, Matrix3::identity() * 0.25));
    assert_eq!(read.velocity_p_mps, state.velocity_p_mps);
    assert!(read.numbers().is_empty());
}

/// Roll, pitch and yaw turn about the axes of their order: roll about the bow's level direction, pitch across it, yaw about the
/// vertical. Level and with equal tilt the noise is round; pitched by 60° the axis of roll has half its length there.
#[test]
fn noise_of_an_attitude() {
    let noise = |pitch: f64, yaw: f64| -> Matrix3<f64> {
        let measured = Rot::<Tangent, Platform>::from_euler_rad(0.2, pitch, yaw);
        let innovation = attitude(&Motion::still(&NavState::at_rest(0)), &measured, 0.1, 0.3);
        innovation.noise.fixed_view::<3, 3>(0, 0).into()
    };
    for yaw in [0.0, 0.7, -2.0] {
        let level = noise(0.0, yaw);
        assert!((level - Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.09))).amax() < 1e-15);
    }
    let half = std::f64::consts::FRAC_PI_3;
    let (sin, cos) = (half.sin(), 0.5);
    let roll = Vector3::new(cos * 0.7_f64.cos(), cos * 0.7_f64.sin(), -sin) * 0.1;
    let pitch = Vector3::new(-0.7_f64.sin(), 0.7_f64.cos(), 0.0) * 0.1;
    let yaw = Vector3::z() * 0.3;
    let expected = roll * roll.transpose() + pitch * pitch.transpose() + yaw * yaw.transpose();
    assert!((noise(half, 0.7) - expected).amax() < 1e-15);
    // On end the cosine of the roll's axis is the angle by which the reading may be wrong.
    let floor = 0.1_f64.hypot(0.3);
    assert!((noise(std::f64::consts::FRAC_PI_2, 0.0)[(0, 0)] - (0.1 * floor).powi(2)).abs() < 1e-12);
}

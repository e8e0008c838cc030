//! Laws across modules: streaming = batch, bits, the 15-state filter, perfect sensors, hostile input.

// Helpers outside `#[test]` functions fail loudly too.
#![allow(clippy::unwrap_used)]

use bottomlock::NavError;
use bottomlock::aiding::registry::{SensorKind, SensorModels};
use bottomlock::aiding::{beam_terms, tightly_coupled};
use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use bottomlock::error_model::{Coefficients, dense_noise};
use bottomlock::filter::gate::Gate;
use bottomlock::filter::options::Options;
use bottomlock::frames::{Rot, Vec3};
use bottomlock::layout::DIM;
use bottomlock::mechanisation::{EarthTerms, ImuSample, Inertial, Sampling};
use bottomlock::model::*;
use bottomlock::navigator::NavigatorSet;
use bottomlock::navigator::events::{
    AttitudeSample, DepthSample, Event, GpsSample, GpsVelocity, HeadingSample, VelocitySample,
};
use bottomlock::navigator::{BeamAiding, Navigator};
use bottomlock::navigator::{METHODS, Method};
use bottomlock::simulation::batch::{Batch, run_batch};
use bottomlock::simulation::closed_loop::{ClosedLoop, ClosedLoopSetup, TruthSegment, VehicleStart};
use bottomlock::simulation::schedule::Schedule;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams::simulate;
use bottomlock::simulation::truth::{Truth, true_state};
use bottomlock::state::{Covariance, NavState};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use proptest::prelude::*;

const SECOND: i64 = 1_000_000_000;

fn perfect() -> Model {
    Model {
        imu: ImuModel::default(),
        initial: InitialModel::default(),
        sensors: SensorModels::default(),
        ..Model::table_2()
    }
}

/// A steady level turn with sideslip, exact: body rates and forces are constant apart from the Earth's turning.
struct Turn {
    time_ns: Vec<i64>,
    position_t_m: Vec<[f64; 3]>,
    attitude_t_p: Vec<[f64; 4]>,
    velocity_p_mps: Vec<[f64; 3]>,
    omega_p_radps: Vec<[f64; 3]>,
    force_p_mps2: Vec<[f64; 3]>,
}

impl Turn {
    fn new(seconds: i64, yaw_rate: f64) -> Self {
        let environment = Model::table_2().environment;
        let (earth, gravity) = (
            environment.earth_rate_t_radps().0,
            Vector3::new(0.0, 0.0, environment.gravity_mps2),
        );
        let velocity = Vector3::new(2.0, -0.03, 0.0);
        let mut turn = Turn {
            time_ns: vec![],
            position_t_m: vec![],
            attitude_t_p: vec![],
            velocity_p_mps: vec![],
            omega_p_radps: vec![],
            force_p_mps2: vec![],
        };
        for k in 0..=seconds * 150 {
            let time_ns = (k as f64 * 1e9 / 150.0).round() as i64;
            let yaw = yaw_rate * time_ns as f64 * 1e-9;
            let attitude =
                Rot::<bottomlock::frames::Tangent, bottomlock::frames::Platform>::from_euler_rad(0.0, 0.0, yaw);
            let rotation = attitude.matrix();
            let omega = Vector3::new(0.0, 0.0, yaw_rate) + rotation.transpose() * earth;
            let force = (omega + rotation.transpose() * earth).cross(&velocity) - rotation.transpose() * gravity;
            let (s, c) = (yaw.sin(), yaw.cos());
            let radius = velocity / yaw_rate;
            turn.time_ns.push(time_ns);
            turn.position_t_m.push([
                radius.x * s - radius.y * (1.0 - c),
                radius.x * (1.0 - c) + radius.y * s,
                0.0,
            ]);
            turn.attitude_t_p.push(attitude.to_quaternion_wxyz());
            turn.velocity_p_mps.push(velocity.into());
            turn.omega_p_radps.push(omega.into());
            turn.force_p_mps2.push(force.into());
        }
        turn
    }

    fn truth(&self) -> Truth<'_> {
        Truth {
            time_ns: &self.time_ns,
            position_t_m: &self.position_t_m,
            attitude_t_p: &self.attitude_t_p,
            velocity_p_mps: &self.velocity_p_mps,
            omega_p_radps: &self.omega_p_radps,
            force_p_mps2: &self.force_p_mps2,
        }
    }
}

fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap()
}

struct Epochs {
    dvl: Vec<i64>,
    masks: Vec<BeamMask>,
    depth: Vec<i64>,
    magnetometer: Vec<i64>,
    gps: Vec<i64>,
    samples: Vec<i64>,
}

impl Epochs {
    /// DVL at odd times, depth and magnetometer between IMU samples, GPS on a second.
    fn new(seconds: i64) -> Self {
        let dvl: Vec<i64> = (1..seconds).map(|k| k * SECOND - 3_141_592).collect();
        Self {
            masks: (0..dvl.len())
                .map(|k| [0_usize, 1, 2, 3].into_iter().filter(|b| k % 5 != *b).collect())
                .collect(),
            depth: (1..seconds).step_by(4).map(|k| k * SECOND + 123).collect(),
            magnetometer: (1..seconds).step_by(2).map(|k| k * SECOND + 500_000_001).collect(),
            gps: vec![SECOND, 2 * SECOND],
            samples: (1..=seconds).map(|k| k * SECOND).collect(),
            dvl,
        }
    }

    fn schedule(&self) -> Schedule<'_> {
        Schedule {
            dvl_time_ns: &self.dvl,
            beam_valid: &self.masks,
            ..Schedule::default()
        }
        .with(SensorKind::Depth, &self.depth, &[])
        .with(SensorKind::Attitude, &self.magnetometer, &[])
        .with(SensorKind::Gps, &self.gps, &[])
    }
}

fn batch<'a>(
    turn: &'a Turn,
    epochs: &'a Epochs,
    schedules: &'a [Schedule<'a>],
    model: &'a Model,
    options: &'a Options,
    geometry: &'a BeamGeometry,
) -> Batch<'a> {
    Batch {
        truth: turn.truth(),
        geometry,
        simulated: model,
        assumed: model,
        options,
        schedules,
        sample_time_ns: &epochs.samples,
        methods: &METHODS,
        seed: 2017,
        trajectory_key: 7,
        first_run: 0,
        runs: 4,
    }
}

fn bits(records: &[Vec<bottomlock::simulation::monte_carlo_run::MethodRecord>]) -> Vec<u64> {
    let flat = records.iter().flatten();
    flat.flat_map(|r| {
        r.error
            .iter()
            .chain(&r.sd)
            .flatten()
            .chain(&r.nees)
            .copied()
            .chain([r.nis_mean])
            .map(f64::to_bits)
    })
    .collect()
}

/// The truth in pieces, as a vehicle that flies on its estimate hands it out, yields the bits of the whole.
#[test]
fn pieces_of_the_truth_yield_the_bits_of_the_whole() {
    let (turn, epochs, model, geometry) = (Turn::new(8, 0.05), Epochs::new(8), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            sampling,
            ..Options::default()
        };
        let schedules = [epochs.schedule()];
        let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
        let common = ClosedLoopSetup {
            geometry: &geometry,
            simulated: &model,
            assumed: &model,
            options: &options,
            seed: whole.seed,
            trajectory_key: whole.trajectory_key,
        };
        let truth = turn.truth();
        let departure = |run| VehicleStart {
            run,
            start: true_state(&truth, 0),
            methods: &METHODS,
        };
        let departures: Vec<_> = (0..whole.runs as u64).map(departure).collect();
        let mut pieces = ClosedLoop::new(&common, &departures, 2).unwrap();
        let ends = [0, 1, 7, 300, 301, 900, truth.time_ns.len() - 1];
        for pair in ends.windows(2) {
            let within = |times: &[i64]| -> Vec<i64> {
                let (first, last) = (truth.time_ns[pair[0]], truth.time_ns[pair[1]]);
                times.iter().copied().filter(|&t| t > first && t <= last).collect()
            };
            let (dvl, depth) = (within(&epochs.dvl), within(&epochs.depth));
            let (magnetometer, gps) = (within(&epochs.magnetometer), within(&epochs.gps));
            let skipped = epochs.dvl.iter().take_while(|&&t| t <= truth.time_ns[pair[0]]).count();
            let schedule = Schedule {
                dvl_time_ns: &dvl,
                beam_valid: &epochs.masks[skipped..skipped + dvl.len()],
                ..Schedule::default()
            }
            .with(SensorKind::Depth, &depth, &[])
            .with(SensorKind::Attitude, &magnetometer, &[])
            .with(SensorKind::Gps, &gps, &[]);
            let segment = TruthSegment {
                truth: truth.slice(pair[0]..pair[1] + 1),
                schedule,
            };
            pieces
                .advance(&vec![segment; whole.runs], &within(&epochs.samples))
                .unwrap();
        }
        assert_eq!(bits(&run_batch(&whole, 1).unwrap()), bits(&pieces.records()));
        let lost = pieces.advance(&[], &[]).unwrap_err();
        assert!(lost.to_string().contains("one per vehicle"), "{lost}");
    }
}

/// What the surroundings add moves the reading by just that, and no other stream.
#[test]
fn offsets_move_their_own_reading_alone() {
    let (turn, epochs, model, geometry) = (Turn::new(8, 0.05), Epochs::new(8), Model::table_2(), janus());
    let key = RunKey {
        seed: 1,
        trajectory: 2,
        run: 3,
    };
    let (depth, yaw) = (vec![0.5; epochs.depth.len()], vec![0.1; epochs.magnetometer.len()]);
    let off = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth).with(
        SensorKind::Attitude,
        &epochs.magnetometer,
        &yaw,
    );
    let draw = |schedule: &Schedule<'_>| {
        let options = Options::default();
        simulate(&turn.truth(), &geometry, &model, &model, schedule, &options, &key)
    };
    let (ideal, moved) = (draw(&epochs.schedule()).unwrap(), draw(&off).unwrap());
    for (a, b) in ideal.of::<DepthSample>().zip(moved.of::<DepthSample>()) {
        assert!((b.depth_m - a.depth_m - 0.5).abs() < 1e-12);
    }
    for (a, b) in ideal.of::<AttitudeSample>().zip(moved.of::<AttitudeSample>()) {
        let [roll, pitch, turned] = b.attitude_t_p.to_euler_rad();
        let [roll_0, pitch_0, yaw_0] = a.attitude_t_p.to_euler_rad();
        let apart = [roll - roll_0, pitch - pitch_0, turned - yaw_0 - 0.1];
        assert!(apart.iter().all(|angle| angle.abs() < 1e-12), "{apart:?}");
    }
    assert!(
        ideal.imu == moved.imu
            && ideal.of::<GpsSample>().eq(moved.of::<GpsSample>())
            && ideal.scale_factor == moved.scale_factor
    );
    let short = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth[1..]);
    assert!(draw(&short).unwrap_err().to_string().contains("depth_offset_m"));
}

/// Same seed, same bits: one thread, two threads, and any cutting into chunks.
#[test]
fn bits_do_not_depend_on_threads_or_chunks() {
    let (turn, epochs, model, options, geometry) = (
        Turn::new(8, 0.05),
        Epochs::new(8),
        Model::table_2(),
        Options::default(),
        janus(),
    );
    let schedules = [epochs.schedule()];
    let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
    let one = run_batch(&whole, 1).unwrap();
    assert_eq!(bits(&one), bits(&run_batch(&whole, 2).unwrap()));
    let mut chunks = run_batch(
        &Batch {
            first_run: 0,
            runs: 1,
            ..whole
        },
        2,
    )
    .unwrap();
    chunks.extend(
        run_batch(
            &Batch {
                first_run: 1,
                runs: 3,
                ..whole
            },
            1,
        )
        .unwrap(),
    );
    assert_eq!(bits(&one), bits(&chunks));
    let other = run_batch(&Batch { seed: 2018, ..whole }, 1).unwrap();
    assert_ne!(bits(&one), bits(&other), "the seed counts");
}

/// Switching a sensor off shifts no other stream, and a lost beam is drawn like the others.
#[test]
fn streams_are_independent() {
    let (turn, mut epochs, model, geometry) = (Turn::new(5, 0.05), Epochs::new(5), Model::table_2(), janus());
    let key = RunKey {
        seed: 1,
        trajectory: 2,
        run: 3,
    };
    let draw = |epochs: &Epochs| {
        simulate(
            &turn.truth(),
            &geometry,
            &model,
            &model,
            &epochs.schedule(),
            &Options::default(),
            &key,
        )
        .unwrap()
    };
    let all = draw(&epochs);
    epochs.depth.clear();
    epochs.masks = vec![BeamMask::NONE; epochs.dvl.len()];
    let fewer = draw(&epochs);
    assert_eq!(all.imu, fewer.imu);
    assert!(all.of::<AttitudeSample>().eq(fewer.of::<AttitudeSample>()));
    for (a, b) in all.pings.iter().zip(&fewer.pings) {
        assert_eq!(a.velocity_mps[..4], b.velocity_mps[..4]);
    }
}

/// A navigator fed a sample at a time, asked for its state and covariance all the while, gives the batch's bits.
#[test]
fn streaming_is_batch_bit_for_bit() {
    let (turn, epochs, model, options, geometry) = (
        Turn::new(8, 0.05),
        Epochs::new(8),
        Model::table_2(),
        Options::default(),
        janus(),
    );
    let schedules = [epochs.schedule()];
    let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
    let records = run_batch(&whole, 1).unwrap();
    for (index, method) in METHODS.iter().enumerate() {
        let key = RunKey {
            seed: 2017,
            trajectory: 7,
            run: 2,
        };
        let streams = simulate(
            &turn.truth(),
            &geometry,
            &model,
            &model,
            &epochs.schedule(),
            &Options::default(),
            &key,
        )
        .unwrap();
        let mut navigator = NavigatorSet::new(streams.initial, &geometry, method.aiding, &model, &options).unwrap();
        let mut events: Vec<Event> = streams.imu.iter().copied().map(Event::Imu).collect();
        let all = BeamMask::all(4);
        events.extend(streams.pings.iter().map(|p| {
            Event::Beams(BeamSample {
                valid: if method.all_beams { all } else { p.valid },
                ..*p
            })
        }));
        events.extend(streams.sensors.iter().flatten().copied().map(Event::Aiding));
        events.sort_by_key(Event::time_ns);
        let last_ns = turn.time_ns[turn.time_ns.len() - 1];
        for event in events.iter().filter(|event| event.time_ns() <= last_ns) {
            navigator.push(event, &mut |_| {}).unwrap();
            let _ = (navigator.state(), navigator.covariance());
        }
        let expected = records[2][index].sd.last().unwrap();
        let covariance = navigator.covariance();
        for k in 0..9 {
            assert_eq!(
                covariance[(k, k)].sqrt().to_bits(),
                expected[k].to_bits(),
                "{} state {k}",
                method.name
            );
        }
    }
}

/// Perfect sensors return the truth, for both meanings of an IMU sample, with aids at odd times splitting the steps.
#[test]
fn perfect_sensors_return_the_truth() {
    let (turn, epochs, assumed, geometry) = (Turn::new(60, 0.05), Epochs::new(60), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            sampling,
            ..Options::default()
        };
        let simulated = perfect();
        let methods = [Method::named("ins").unwrap(), Method::named("tc").unwrap()];
        let schedules = [epochs.schedule()];
        let whole = Batch {
            simulated: &simulated,
            methods: &methods,
            runs: 1,
            ..batch(&turn, &epochs, &schedules, &assumed, &options, &geometry)
        };
        for record in &run_batch(&whole, 1).unwrap()[0] {
            let last = record.error.last().unwrap();
            assert!(
                last[..3].iter().all(|e| e.abs() < 1e-3),
                "{sampling:?} position {last:?}"
            );
            assert!(
                last[3..6].iter().all(|e| e.abs() < 1e-6),
                "{sampling:?} attitude {last:?}"
            );
        }
    }
}

type P15 = SMatrix<f64, 15, 15>;

/// The 15-state filter, written out densely, is the 20-state filter with frozen DVL blocks.
#[test]
fn fifteen_states_are_twenty_with_frozen_dvl() {
    let (turn, model, geometry) = (Turn::new(4, 0.05), Model::table_2(), janus());
    let epochs = Epochs::new(4);
    let options = Options {
        estimate_dvl: false,
        covariance_period_ns: 0,
        gate: Gate::Off,
        ..Options::default()
    };
    let key = RunKey {
        seed: 3,
        trajectory: 0,
        run: 0,
    };
    let streams = simulate(
        &turn.truth(),
        &geometry,
        &model,
        &model,
        &epochs.schedule(),
        &options,
        &key,
    )
    .unwrap();
    let mut navigator = Navigator::new(streams.initial, geometry.clone(), BeamAiding::Tight, &model, &options).unwrap();
    let earth = EarthTerms::from(&model.environment);
    let mut p: P15 = model.initial_covariance(false).fixed_view::<15, 15>(0, 0).into_owned();
    for (k, imu) in streams.imu.iter().enumerate() {
        let before = navigator.state();
        navigator.push(&Event::Imu(*imu), &mut |_| {}).unwrap();
        if k == 0 {
            continue;
        }
        let at = |state: &NavState, sample: &ImuSample| {
            let inertial = Inertial {
                rate_p_radps: (sample.rate_p_radps - state.gyro_bias_p_radps).to_array(),
                force_p_mps2: (sample.force_p_mps2 - state.accel_bias_p_mps2).to_array(),
            };
            let c = Coefficients::at(&state.kinematics(), &inertial, &earth);
            let f = c.dense(&earth);
            let q = dense_noise(&c, &model.process_noise(false));
            (P15::from_fn(|i, j| f[i][j]), P15::from_fn(|i, j| q[i][j]))
        };
        let dt = (imu.time_ns - streams.imu[k - 1].time_ns) as f64 * 1e-9;
        let ((f0, q0), (f1, q1)) = (at(&before, &streams.imu[k - 1]), at(&navigator.state(), imu));
        let phi = P15::identity() + (f0 + f1) * (0.5 * dt);
        let q = (q0 + q1) * (0.25 * dt);
        p = phi * (p + q) * phi.transpose() + q;
        if k % 150 == 0 {
            let ping = BeamSample {
                time_ns: imu.time_ns,
                valid: BeamMask::all(2),
                ..streams.pings[0]
            };
            let inn = {
                let mut filter = navigator.clone();
                let filter = filter.filter_mut();
                filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping))
            };
            let before = navigator.state();
            navigator.push(&Event::Beams(ping), &mut |_| {}).unwrap();
            let h = inn.jacobian.fixed_view::<2, 15>(0, 0).into_owned();
            let r = inn.noise.fixed_view::<2, 2>(0, 0).into_owned();
            let s = h * p * h.transpose() + r;
            let gain = p * h.transpose() * s.try_inverse().unwrap();
            let delta = gain * inn.residual.fixed_rows::<2>(0);
            p = (P15::identity() - gain * h) * p;
            let moved = navigator.state().error_of(&before);
            let expected = SVector::<f64, 15>::from_fn(|i, _| delta[i]);
            assert!((moved.fixed_rows::<15>(0) - expected).amax() < 1e-9 * expected.amax());
        }
        let twenty = navigator.covariance();
        let scaled = |a: f64, i: usize, j: usize| a / (twenty[(i, i)] * twenty[(j, j)]).sqrt();
        for i in 0..15 {
            for j in 0..15 {
                assert!(
                    (scaled(twenty[(i, j)], i, j) - scaled(p[(i, j)], i, j)).abs() < 1e-7,
                    "step {k}, {i},{j}"
                );
            }
        }
        assert_eq!(twenty.fixed_columns::<5>(15).amax(), 0.0, "frozen");
    }
}

/// Time that stands still or runs backwards is refused, and the navigator goes on as if nothing had come.
#[test]
fn disorder_in_time_is_refused() {
    let imu = |time_ns| {
        Event::Imu(ImuSample {
            time_ns,
            rate_p_radps: Vec3::zeros(),
            force_p_mps2: Vec3::new(0.0, 0.0, -9.8),
        })
    };
    let mut navigator = Navigator::new(
        NavState::at_rest(0),
        janus(),
        BeamAiding::Tight,
        &Model::table_2(),
        &Options::default(),
    )
    .unwrap();
    navigator.push(&imu(10), &mut |_| {}).unwrap();
    navigator.push(&imu(20), &mut |_| {}).unwrap();
    let state = navigator.state();
    for bad in [20, 15] {
        assert!(matches!(
            navigator.push(&imu(bad), &mut |_| {}),
            Err(NavError::TimeNotIncreasing { stream: "imu", .. })
        ));
    }
    let depth = |time_ns| {
        Event::from(DepthSample {
            time_ns,
            depth_m: 1.0,
            sd_m: 0.1,
        })
    };
    assert!(
        navigator.push(&depth(19), &mut |_| {}).is_err(),
        "before the filter's time"
    );
    assert_eq!(navigator.state(), state);
    navigator.push(&depth(25), &mut |_| {}).unwrap();
    assert!(navigator.push(&depth(25), &mut |_| {}).is_err(), "twice at one time");
    navigator.push(&imu(30), &mut |_| {}).unwrap();
}

/// The gate per row drops a bad beam and keeps the good one.
#[test]
fn gate_per_row_drops_the_bad_beam() {
    let options = Options {
        gate: Gate::PerRow,
        ..Options::default()
    };
    let mut navigator = Navigator::new(
        NavState::at_rest(0),
        janus(),
        BeamAiding::Tight,
        &Model::table_2(),
        &options,
    )
    .unwrap();
    let imu = ImuSample {
        time_ns: 1,
        rate_p_radps: Vec3::zeros(),
        force_p_mps2: Vec3::new(0.0, 0.0, -9.8),
    };
    navigator.push(&Event::Imu(imu), &mut |_| {}).unwrap();
    let mut velocity_mps = [0.0; MAX_BEAMS];
    velocity_mps[1] = 5.0;
    let ping = BeamSample {
        time_ns: 1,
        velocity_mps,
        sd_mps: [0.042; MAX_BEAMS],
        valid: BeamMask::all(2),
    };
    let mut verdicts = vec![];
    navigator
        .push(&Event::Beams(ping), &mut |report| verdicts.push(report.verdict))
        .unwrap();
    assert_eq!(
        verdicts,
        vec![bottomlock::filter::report::Verdict::AcceptedInPart { rejected_rows: 2 }]
    );
    assert!(navigator.state().velocity_p_mps.0.norm() < 0.01);
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -10.0_f64..10.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0), 1 => Just(1e300), 1 => Just(-1e-300)]
}

fn event() -> impl Strategy<Value = Event> {
    (0_usize..7, -1_i64..400, prop::array::uniform9(number()), 0_usize..256).prop_map(|(kind, tenth, x, bits)| {
        let time_ns = tenth * 10_000_000;
        let (a, b) = ([x[0], x[1], x[2]], [x[3], x[4], x[5]]);
        match kind {
            0 | 1 => Event::Imu(ImuSample {
                time_ns,
                rate_p_radps: Vec3::from_array(a),
                force_p_mps2: Vec3::from_array(b),
            }),
            2 => Event::Beams(BeamSample {
                time_ns,
                velocity_mps: [x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0],
                sd_mps: [x[4]; MAX_BEAMS],
                valid: (0..MAX_BEAMS).filter(|k| bits & (1 << k) != 0).collect(),
            }),
            3 => Event::from(DepthSample {
                time_ns,
                depth_m: x[0],
                sd_m: x[1],
            }),
            4 => Event::from(VelocitySample {
                time_ns,
                velocity_p_mps: Vec3::from_array(a),
                cov_m2ps2: Matrix3::from_diagonal(&b.into()),
            }),
            5 => Event::from(GpsSample {
                time_ns,
                position_t_m: Vec3::from_array(a),
                position_sd_m: b,
                velocity: Some(GpsVelocity {
                    velocity_t_mps: Vec3::from_array(a),
                    sd_mps: b,
                }),
            }),
            _ if bits % 2 == 0 => Event::from(HeadingSample {
                time_ns,
                yaw_rad: x[0],
                sd_rad: x[1],
            }),
            _ => Event::from(AttitudeSample {
                time_ns,
                attitude_t_p: Rot::from_quaternion_wxyz([x[0], x[1], x[2], x[3]]),
                roll_pitch_sd_rad: x[4],
                yaw_sd_rad: x[5],
            }),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    /// Whatever arrives, the kernel answers with a value or an error: no panic, no NaN in the state.
    #[test]
    fn hostile_input_never_panics(events in prop::collection::vec(event(), 1..40), index in 0_usize..METHODS.len(), slow in any::<bool>()) {
        let options = Options { covariance_period_ns: if slow { 100_000_000 } else { 0 }, ..Options::default() };
        let mut navigator = NavigatorSet::new(NavState::at_rest(0), &janus(), METHODS[index].aiding, &Model::table_2(), &options).unwrap();
        for event in &events {
            let failed = navigator.push(event, &mut |_| {}).is_err();
            let finite = navigator.state().validate().is_ok();
            prop_assert!(finite || failed, "NaN without an error");
            if !finite {
                break;
            }
        }
    }

    /// After any honest sequence of updates P is symmetric to the bit and its diagonal positive.
    #[test]
    fn covariance_stays_symmetric(masks in prop::collection::vec(0_usize..16, 1..30), index in 0_usize..METHODS.len()) {
        let mut navigator = NavigatorSet::new(NavState::at_rest(0), &janus(), METHODS[index].aiding, &Model::table_2(), &Options::default()).unwrap();
        for (k, mask) in masks.iter().enumerate() {
            let time_ns = (k as i64 + 1) * 100_000_000;
            let imu = ImuSample { time_ns, rate_p_radps: Vec3::new(0.01, 0.0, 0.05), force_p_mps2: Vec3::new(0.0, 0.1, -9.8) };
            navigator.push(&Event::Imu(imu), &mut |_| {}).unwrap();
            let valid = (0..4).filter(|b| mask & (1 << b) != 0).collect();
            let ping = BeamSample { time_ns, velocity_mps: [0.01; MAX_BEAMS], sd_mps: [0.042; MAX_BEAMS], valid };
            navigator.push(&Event::Beams(ping), &mut |_| {}).unwrap();
            let p: Covariance = navigator.covariance();
            prop_assert_eq!(p, p.transpose());
            prop_assert!((0..DIM).all(|i| p[(i, i)] > 0.0));
        }
    }
}

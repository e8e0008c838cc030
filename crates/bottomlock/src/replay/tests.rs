//! A log of a steady turn with streams that never meet, through every method.

use super::*;
use crate::aiding::registry::{Measurement, SENSORS};
use crate::dvl::geometry::BeamMotion;
use crate::filter::report::UpdateReport;
use crate::mechanisation::Sampling;
use crate::navigator::events::{AttitudeSample, GpsSample, HeadingSample};
use crate::testing::*;

const MS: i64 = 1_000_000;

pub(crate) struct Recording {
    pub(crate) imu: Vec<ImuSample>,
    pub(crate) pings: Vec<BeamSample>,
    pub(crate) sensors: [Vec<Measurement>; SENSORS],
    pub(crate) geometry: BeamGeometry,
    pub(crate) model: Model,
    pub(crate) start: NavState,
}

/// Times of a stream, ns. Its period has no common divisor with the IMU's: no measurement falls on an inertial reading but at
/// the start.
fn every(seconds: i64, period_ms: i64, offset_ms: i64) -> impl Iterator<Item = i64> {
    (0..)
        .map(move |k| (k * period_ms + offset_ms) * MS + 371)
        .take_while(move |&t| t < seconds * 1000 * MS)
}

/// Depth, attitude, heading and GPS of a steady turn.
fn turn_measurements(seconds: i64, speed: f64, rate: f64) -> [Vec<Measurement>; SENSORS] {
    let yaw = |time_ns: i64| rate * time_ns as f64 * 1e-9;
    let place = |time_ns: i64| Vec3::new(yaw(time_ns).sin(), 1.0 - yaw(time_ns).cos(), 0.0) * (speed / rate);
    let depth = every(seconds, 517, 40).map(|time_ns| DepthSample {
        time_ns,
        depth_m: 0.0,
        sd_m: 0.02,
    });
    let attitude = every(seconds, 1709, 5).map(|time_ns| AttitudeSample {
        time_ns,
        attitude_t_p: Rot::from_euler_rad(0.0, 0.0, yaw(time_ns)),
        roll_pitch_sd_rad: 0.02,
        yaw_sd_rad: 0.1,
    });
    let heading = every(seconds, 1301, 77).map(|time_ns| HeadingSample {
        time_ns,
        yaw_rad: yaw(time_ns),
        sd_rad: 0.1,
    });
    let gps = every(seconds, 2903, 800).map(|time_ns| GpsSample {
        time_ns,
        position_t_m: place(time_ns),
        position_sd_m: [2.0; 3],
        velocity: None,
    });
    let mut sensors: [Vec<Measurement>; SENSORS] = Default::default();
    sensors[SensorKind::Depth as usize] = depth.map(Into::into).collect();
    sensors[SensorKind::Attitude as usize] = attitude.map(Into::into).collect();
    sensors[SensorKind::Heading as usize] = heading.map(Into::into).collect();
    sensors[SensorKind::Gps as usize] = gps.map(Into::into).collect();
    sensors
}

/// A level turn of 0.05 rad/s at 2 m/s on an Earth that does not turn: what it reads is constant.
pub(crate) fn steady_turn(seconds: i64) -> Recording {
    let (speed, rate) = (2.0, 0.05);
    let mut model = Model::table_2();
    model.environment.earth_rate_radps = 0.0;
    let geometry = BeamGeometry::janus(Janus::X, 30_f64.to_radians())
        .and_then(|g| g.with_lever_arms(&[Vec3::new(-1.8, 0.0, 0.1); 4]))
        .unwrap();
    let motion = BeamMotion {
        velocity_p_mps: Vector3::new(speed, 0.0, 0.0),
        omega_tp_p_radps: Vector3::new(0.0, 0.0, rate),
        beam_bias_mps: [0.0; 4],
        scale_factor: 0.0,
    };
    let mut velocity_mps = [f64::NAN; MAX_BEAMS];
    (0..4).for_each(|beam| velocity_mps[beam] = geometry.beam_velocity_mps(beam, &motion));
    let mut start = NavState::at_rest(0);
    start.velocity_p_mps = Vec3::new(speed, 0.0, 0.0);
    Recording {
        imu: (0..=seconds * 100)
            .map(|k| {
                imu(
                    k * 10 * MS,
                    [0.0, 0.0, rate],
                    [0.0, speed * rate, -model.environment.gravity_mps2],
                )
            })
            .collect(),
        pings: every(seconds, 993, 130)
            .enumerate()
            .map(|(k, time_ns)| BeamSample {
                time_ns,
                velocity_mps,
                sd_mps: [0.01 + 0.01 * k as f64; MAX_BEAMS],
                valid: if k % 3 == 2 {
                    [0, 1].into_iter().collect()
                } else {
                    BeamMask::all(4)
                },
            })
            .collect(),
        sensors: turn_measurements(seconds, speed, rate),
        geometry,
        model,
        start,
    }
}

impl Recording {
    fn depth(&self, row: usize) -> DepthSample {
        self.sensors[SensorKind::Depth as usize][row].try_into().unwrap()
    }

    pub(crate) fn log(&self) -> Log<'_> {
        Log {
            imu: &self.imu,
            pings: &self.pings,
            sensors: self.sensors.each_ref().map(Vec::as_slice),
            water_track: &[],
        }
    }

    pub(crate) fn replay<'a>(&'a self, options: &'a Options, sample_time_ns: &'a [i64]) -> Replay<'a> {
        Replay {
            log: self.log(),
            geometry: &self.geometry,
            model: &self.model,
            options,
            start: self.start,
            covariance: None,
            methods: &METHODS,
            sample_time_ns,
            smooth: false,
            covariances: true,
            innovations: false,
            withheld: Default::default(),
        }
    }
}

/// Every method ends where a guide ends that is fed the events one by one as they arrive, to the last bit.
#[test]
fn replay_is_streaming_bit_for_bit() {
    let recording = steady_turn(8);
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            imu_sampling: sampling,
            ..Options::default()
        };
        let samples = [0, 1_500 * MS, 8_000 * MS];
        let out = replay(&recording.replay(&options, &samples), 1).unwrap();
        let mut events: Vec<Event> = (0..STREAMS)
            .flat_map(|stream| (0..recording.log().len(stream)).map(move |row| (stream, row)))
            .filter_map(|(stream, row)| recording.log().get(stream, row))
            .collect();
        events.sort_by_key(Event::time_ns);
        for (method, track) in METHODS.iter().zip(&out.tracks) {
            let mut guide = Navigator::new(
                recording.start,
                recording.geometry.clone(),
                method.aiding,
                &recording.model,
                &options,
            )
            .unwrap();
            let mut pings = 0;
            for event in &events {
                guide
                    .push(event, &mut |report| {
                        pings += usize::from(report.sensor == Sensor::Beams)
                    })
                    .unwrap();
            }
            assert_eq!(track.filtered.states.last(), Some(&guide.state()), "{}", method.name);
            assert_eq!(
                track.filtered.covariances.last(),
                Some(&guide.covariance()),
                "{}",
                method.name
            );
            assert_eq!(track.filtered.states.len(), 3);
            let seen = track.pings.iter().filter(|ping| ping.status != FixStatus::None).count();
            assert_eq!(seen, pings, "{}", method.name);
        }
        // NaN stands where no fix is: compared as text, which prints every bit that counts.
        let threaded = replay(&recording.replay(&options, &samples), 3).unwrap();
        assert_eq!(format!("{threaded:?}"), format!("{out:?}"));
    }
}

/// Perfect readings at odd times leave the estimate on the circle: each is taken at its own time of validity. A millisecond's
/// slip of a ping would show 0.1 mm/s in sway, of a heading 50 µrad.
#[test]
fn odd_times_cost_nothing() {
    let recording = steady_turn(20);
    let options = Options::default();
    let out = replay(&recording.replay(&options, &[20_000 * MS]), 1).unwrap();
    for (method, track) in METHODS.iter().zip(&out.tracks) {
        if !matches!(method.name, "ins" | "lc" | "tc" | "info" | "plcf") {
            continue; // These assume something of sway or heave that the turn does not do.
        }
        let state = track.filtered.states[0];
        let angle = 0.05 * 20.0_f64;
        let place = Vec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) * 40.0;
        assert!(
            (state.position_t_m - place).0.norm() < 2e-5,
            "{} {:?}",
            method.name,
            state.position_t_m
        );
        assert!(
            (state.velocity_p_mps.0 - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-6,
            "{}",
            method.name
        );
        assert!(
            (state.attitude_t_p.to_euler_rad()[2] - angle).abs() < 1e-8,
            "{}",
            method.name
        );
    }
}

/// A ping just after an inertial reading: the gyro's noise on the lever arm is that of a reading, not of the split step.
#[test]
fn a_split_step_does_not_make_the_gyro_worse() {
    let mut recording = steady_turn(2);
    let options = Options::default();
    let mut sds = Vec::new();
    for offset_ns in [0, 1, 5 * MS] {
        recording.pings.truncate(1);
        recording.pings[0].time_ns = 1_000 * MS + offset_ns;
        let out = replay(&recording.replay(&options, &[2_000 * MS]), 1).unwrap();
        let tc = METHODS.iter().position(|method| method.name == "tc").unwrap();
        sds.push(out.tracks[tc].pings[0].innovation_sd_mps[0]);
    }
    assert!(
        (sds[1] / sds[0] - 1.0).abs() < 1e-6 && (sds[2] / sds[0] - 1.0).abs() < 5e-3,
        "{sds:?}"
    );
}

/// Live, measurements between two IMU samples may arrive in any order; a late one is an error, is counted and changes nothing.
#[test]
fn arrival_out_of_order() {
    let recording = steady_turn(3);
    let options = Options::default();
    let method = crate::navigator::Method::named("sway_current").unwrap();
    let mut guides = [(); 2].map(|()| {
        Navigator::new(
            recording.start,
            recording.geometry.clone(),
            method.aiding,
            &recording.model,
            &options,
        )
        .unwrap()
    });
    let (imu, depth) = (recording.imu[20], recording.depth(0));
    let mut ping = recording.pings[0];
    ping.time_ns = depth.time_ns + 5;
    let waiting = [Event::from(depth), Event::Beams(ping)];
    let quiet = &mut |_: &UpdateReport| {};
    for (guide, order) in guides.iter_mut().zip([[0, 1], [1, 0]]) {
        guide.push(&Event::Imu(recording.imu[0]), quiet).unwrap();
        order.iter().for_each(|&k| guide.push(&waiting[k], quiet).unwrap());
        guide.push(&Event::Imu(imu), quiet).unwrap();
    }
    assert_eq!(guides[0].state(), guides[1].state());
    assert_eq!(guides[0].covariance(), guides[1].covariance());
    let before = guides[0].state();
    let late = DepthSample {
        time_ns: depth.time_ns + 9,
        ..depth
    };
    let error = guides[0].push(&Event::from(late), quiet).unwrap_err().to_string();
    assert!(
        error.starts_with("depth time 40000380 ns does not come after 200000000 ns"),
        "{error}"
    );
    assert_eq!(guides[0].state(), before);
}

/// A start in the middle and a tail beyond the inertial readings: counted by stream, never used.
#[test]
fn what_is_not_used_is_counted() {
    let mut recording = steady_turn(4);
    recording.start.time_ns = 1_000 * MS;
    recording.imu.truncate(301);
    let options = Options::default();
    let out = replay(&recording.replay(&options, &[1_000 * MS, 3_000 * MS]), 1).unwrap();
    assert_eq!(out.unused.before_start[0], 100);
    assert_eq!(out.unused.before_start[1], 1);
    assert_eq!(out.unused.after_end[0], 0);
    assert_eq!(out.unused.after_end[1], 1);
    let tc = &out.tracks[2];
    assert_eq!(tc.filtered.states[0].time_ns, 1_000 * MS);
    let used: Vec<bool> = tc.pings.iter().map(|ping| ping.status != FixStatus::None).collect();
    assert_eq!(used, [false, true, true, false]);
}

/// Errors name stream, row and time.
#[test]
fn bad_rows_are_named() {
    let options = Options::default();
    let text = |recording: &Recording, samples: &[i64]| {
        replay(&recording.replay(&options, samples), 1).unwrap_err().to_string()
    };
    let mut late = steady_turn(3);
    late.sensors[SensorKind::Depth as usize][2] = DepthSample {
        time_ns: late.depth(1).time_ns,
        ..late.depth(2)
    }
    .into();
    assert!(text(&late, &[0]).starts_with("depth row 2: depth time 557000371 ns does not come after 557000371 ns"));
    let mut nan = steady_turn(3);
    nan.pings[1].velocity_mps[2] = f64::NAN;
    assert!(text(&nan, &[0]).starts_with("dvl row 1: beam 3 at 1123000371 ns"));
    let good = steady_turn(3);
    assert!(text(&good, &[4_000 * MS]).contains("outside the replay (0 to 3000000000 ns"));
    assert!(text(&good, &[5, 5]).contains("sample time 5 ns does not come after 5 ns"));
    let mut empty = steady_turn(3);
    empty.start.time_ns = 9_000 * MS;
    assert!(text(&empty, &[]).contains("good imu rows at or after the start: got 0"));
    let mut mad = steady_turn(3);
    mad.sensors[SensorKind::Depth as usize][2] = DepthSample {
        sd_m: 1e200,
        ..mad.depth(2)
    }
    .into();
    assert!(text(&mad, &[]).starts_with("depth row 2: depth sd_m is 1e200, expected"));
    let mut gap = steady_turn(3);
    gap.imu.drain(51..152);
    let error = text(&gap, &[]);
    assert!(
        error.starts_with("imu row 51: imu time 1520000000 ns comes 1.020000 s after"),
        "{error}"
    );
    let mut mad = steady_turn(3);
    mad.imu[7].force_p_mps2 = Vec3::new(1e308, 1e308, 1e308);
    let message = text(&mad, &[]);
    assert!(message.starts_with("imu row 7: imu force_p_mps2 at "), "{message}");
}

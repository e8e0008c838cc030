//! Random logs with every sensor and fault, random orders in which they arrive, and what a navigator tells of them.

use std::collections::BTreeMap;

use crate::common::*;
use bottomlock::aiding::acoustic_position::AcousticPositionSample;
use bottomlock::aiding::outliers::{Robust, Tail};
use bottomlock::aiding::registry::{Measurement, SENSORS};
use bottomlock::aiding::thrust::{ThrustModel, ThrustUse};
use bottomlock::navigator::Standing;
use bottomlock::navigator::events::{ThrustSample, WATER_TRACK, WaterSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) const MS: i64 = 1_000_000;

/// Interval of the inertial readings, and their number.
const STEP_NS: i64 = 20 * MS;
const READINGS: i64 = 150;

/// How long a navigator asks whether forces and attitude agree, with a reading that may be missing.
const FORCES_NS: i64 = 1_200 * MS;

/// A log, and the navigator that takes it.
pub(crate) struct Case {
    pub(crate) method: &'static Method,
    pub(crate) model: Model,
    pub(crate) options: Options,
    /// Every event in the order of a log: by time, at equal times by stream.
    pub(crate) log: Vec<Event>,
    pub(crate) imu: Vec<ImuSample>,
    pub(crate) pings: Vec<BeamSample>,
    pub(crate) sensors: [Vec<Measurement>; SENSORS],
    pub(crate) water_track: Vec<WaterSample>,
}

impl Case {
    /// Three seconds of a vehicle that rocks; readings out of range, stuck, or missing, outliers and lost beams, equal times.
    pub(crate) fn new(seed: u64, method: &'static Method) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let imu = readings(&mut random);
        let mut pings = Vec::new();
        let mut sensors: [Vec<Measurement>; SENSORS] = std::array::from_fn(|_| Vec::new());
        let last_ns = imu.last().map_or(0, |last| last.time_ns);
        let mut time_ns = 0;
        while time_ns <= last_ns {
            pings.push(ping(&mut random, time_ns));
            time_ns = later(&mut random, time_ns, 130 * MS);
        }
        for (sensor, column) in sensors.iter_mut().enumerate().take(SensorKind::Thrust as usize) {
            let mut time_ns = random.random_range(0..300 * MS);
            while time_ns <= last_ns {
                column.push(measurement(&mut random, sensor, time_ns));
                time_ns = later(&mut random, time_ns, 300 * MS);
            }
        }
        // Drawn apart, so that seeds of old failures keep their meaning.
        let mut water = ChaCha8Rng::seed_from_u64(seed ^ 0x0057_4154_4552);
        let mut water_track = Vec::new();
        if water.random() {
            let mut time_ns = 0;
            while time_ns <= last_ns {
                let range_m = if water.random() {
                    0.0
                } else {
                    25.0 * water.random::<f64>()
                };
                let ping = ping(&mut water, time_ns);
                water_track.push(WaterSample { ping, range_m });
                time_ns = later(&mut water, time_ns, 200 * MS);
            }
        }
        let mut propeller = ChaCha8Rng::seed_from_u64(seed ^ 0x5052_4f50);
        let thrust = [ThrustUse::Off, ThrustUse::Velocity, ThrustUse::All][propeller.random_range(0..3)];
        if thrust != ThrustUse::Off {
            let mut time_ns = 0;
            while time_ns <= last_ns {
                sensors[SensorKind::Thrust as usize].push(speeds(&mut propeller, time_ns));
                time_ns = later(&mut propeller, time_ns, 200 * MS);
            }
        }
        let mut log: Vec<Event> = imu.iter().copied().map(Event::Imu).collect();
        log.extend(pings.iter().copied().map(Event::Beams));
        log.extend(sensors.iter().flatten().copied().map(Event::Aiding));
        log.extend(water_track.iter().copied().map(Event::WaterTrack));
        // Stable: the streams were put in in their order.
        log.sort_by_key(Event::time_ns);
        let mut model = Model::table_2();
        model.sensors.depth.bias_sd_m = if random.random() { 0.3 } else { 0.0 };
        model.sensors.thrust = ThrustModel {
            scale_sd: [0.1; 3],
            slip_sd_mps: [0.02, 0.02, 0.0],
            ..ThrustModel::default()
        };
        Self {
            method,
            model,
            options: Options {
                water_track: !water_track.is_empty(),
                thrust,
                ..options(&mut random)
            },
            log,
            imu,
            pings,
            sensors,
            water_track,
        }
    }

    /// The log in the order of arrival: every measurement with a random latency of its own, less than the horizon, or each
    /// stream with one, as the inertial readings have.
    pub(crate) fn arrival(&self, seed: u64, horizon_ns: i64) -> Vec<Event> {
        let mut random = ChaCha8Rng::seed_from_u64(!seed);
        let of_stream: [i64; 12] = std::array::from_fn(|_| random.random_range(0..horizon_ns));
        let (by_stream, late_readings): (bool, bool) = (random.random(), random.random());
        let stream = |event: &Event| match event {
            Event::Imu(_) => 0,
            Event::Beams(_) => 1,
            Event::Aiding(measurement) => 2 + measurement.kind() as usize,
            Event::WaterTrack(_) => WATER_TRACK,
        };
        let mut arriving: Vec<(i64, u32, Event)> = Vec::new();
        for event in &self.log {
            let latency_ns = match event {
                Event::Imu(_) if !late_readings => 0,
                Event::Imu(_) => of_stream[0],
                _ if by_stream => of_stream[stream(event)],
                _ => random.random_range(0..horizon_ns),
            };
            arriving.push((event.time_ns() + latency_ns, random.random(), *event));
        }
        arriving.sort_by_key(|(arrival_ns, tie, _)| (*arrival_ns, *tie));
        arriving.into_iter().map(|(_, _, event)| event).collect()
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn vector(random: &mut ChaCha8Rng, sd: f64) -> [f64; 3] {
    std::array::from_fn(|_| sd * normal(random))
}

/// Time of the next measurement: now and then that of a reading.
fn later(random: &mut ChaCha8Rng, time_ns: i64, mean_ns: i64) -> i64 {
    let next_ns = time_ns + random.random_range(1..2 * mean_ns);
    if random.random_bool(0.3) {
        (next_ns / STEP_NS + 1) * STEP_NS
    } else {
        next_ns
    }
}

fn readings(random: &mut ChaCha8Rng) -> Vec<ImuSample> {
    let mut imu: Vec<ImuSample> = Vec::new();
    let first = i64::from(random.random::<bool>());
    for k in first..READINGS {
        if k > first && random.random_bool(0.05) {
            continue;
        }
        let [x, y, z] = vector(random, 0.05);
        let mut sample = ImuSample {
            time_ns: k * STEP_NS,
            rate_p_radps: Vec3::from_array(vector(random, 0.02)),
            force_p_mps2: Vec3::new(x, y, z - 9.8),
        };
        match random.random_range(0..40) {
            // Not of the force: its mean tells the unit, and the first to arrive may be two.
            0 => sample.rate_p_radps = Vec3::new(20.0, 0.0, 0.0),
            1..=4 => {
                if let Some(last) = imu.last() {
                    sample = ImuSample {
                        time_ns: sample.time_ns,
                        ..*last
                    };
                }
            }
            _ => {}
        }
        imu.push(sample);
    }
    // The last one is good, so that nothing waits at the end.
    let time_ns = READINGS * STEP_NS;
    imu.push(ImuSample {
        time_ns,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.01),
        force_p_mps2: Vec3::new(0.0, 0.0, -9.8),
    });
    imu
}

fn ping(random: &mut ChaCha8Rng, time_ns: i64) -> BeamSample {
    let mut velocity_mps = [f64::NAN; MAX_BEAMS];
    for beam in velocity_mps.iter_mut().take(4) {
        *beam = 0.04 * normal(random) + if random.random_bool(0.1) { 3.0 } else { 0.0 };
    }
    BeamSample {
        time_ns,
        velocity_mps,
        sd_mps: [0.042; MAX_BEAMS],
        valid: (0..4).filter(|_| random.random_bool(0.75)).collect(),
    }
}

fn speeds(random: &mut ChaCha8Rng, time_ns: i64) -> Measurement {
    let wild = if random.random_bool(0.15) { 30.0 } else { 1.0 };
    let mut speed = || {
        if random.random_bool(0.1) {
            0.0
        } else {
            0.1 * wild * normal(random)
        }
    };
    ThrustSample {
        time_ns,
        speed_p_mps: Vec3::new(speed(), speed(), speed()),
        sd_mps: 0.05,
    }
    .into()
}

fn measurement(random: &mut ChaCha8Rng, sensor: usize, time_ns: i64) -> Measurement {
    let wild = if random.random_bool(0.15) { 30.0 } else { 1.0 };
    match sensor {
        0 => VelocitySample {
            time_ns,
            velocity_p_mps: Vec3::from_array(vector(random, 0.1 * wild)),
            cov_m2ps2: Matrix3::identity() * 0.01,
        }
        .into(),
        1 => DepthSample {
            time_ns,
            depth_m: 0.1 * wild * normal(random),
            sd_m: 0.1,
        }
        .into(),
        2 => {
            // Not in the first second, whose forces are held against the attitude.
            let wild = if time_ns < FORCES_NS { 1.0 } else { wild };
            let [roll, pitch, yaw] = vector(random, 0.02 * wild);
            AttitudeSample {
                time_ns,
                attitude_t_p: Rot::from_euler_rad(roll, pitch, yaw),
                roll_pitch_sd_rad: 0.02,
                yaw_sd_rad: 0.05,
            }
            .into()
        }
        3 => HeadingSample {
            time_ns,
            // Beyond a turn it would be refused as degrees.
            yaw_rad: (0.05 * wild * normal(random)).clamp(-6.0, 6.0),
            sd_rad: 0.05,
        }
        .into(),
        4 => GpsSample {
            time_ns,
            position_t_m: Vec3::from_array(vector(random, wild)),
            position_sd_m: [1.0; 3],
            velocity: random.random_bool(0.5).then(|| GpsVelocity {
                velocity_t_mps: Vec3::from_array(vector(random, 0.1)),
                sd_mps: [0.1; 3],
            }),
        }
        .into(),
        _ => {
            let position_t_m = Vec3::from_array(vector(random, 2.0 * wild));
            let model = &Model::table_2().sensors.acoustic_position;
            AcousticPositionSample::new(time_ns, position_t_m, Some([2.0; 3]), model).into()
        }
    }
}

fn options(random: &mut ChaCha8Rng) -> Options {
    let mut options = Options {
        gate: match random.random_range(0..3) {
            0 => Gate::PerRow,
            1 => Gate::Off,
            _ => Gate::Joint,
        },
        inflate_after_rejections: if random.random() { 2 } else { 5 },
        covariance_period_ns: if random.random_bool(0.3) { 0 } else { 100 * MS },
        imu_sampling: if random.random() {
            Sampling::Instantaneous
        } else {
            Sampling::Averaged
        },
        estimate_dvl: random.random(),
        robust: match random.random_range(0..3) {
            0 => None,
            1 => Some(Robust {
                tail: Tail::Gaussian,
                ..Robust::default()
            }),
            _ => Some(Robust::default()),
        },
        ..Options::default()
    };
    options.imu_limits.stuck_after = if random.random() { 3 } else { 0 };
    options.imu_limits.gap = LongGap::Inflate;
    options.imu_limits.max_gap_s = if random.random() { 0.05 } else { 1.0 };
    options.imu_limits.gap_rate_sd_radps = 0.01;
    options
}

/// The cases have equal times across streams, faults of every kind, and arrivals that differ from the log.
pub(crate) fn check_cases() {
    let cases: Vec<Case> = (0..20)
        .map(|seed| Case::new(seed, &bottomlock::navigator::METHODS[0]))
        .collect();
    let equal = |case: &Case| {
        case.log
            .windows(2)
            .filter(|pair| pair[0].time_ns() == pair[1].time_ns())
            .count()
    };
    assert!(cases.iter().map(equal).sum::<usize>() > 100);
    let is_used = |case: &Case| case.options.thrust != ThrustUse::Off;
    let is_filled = |case: &Case| {
        let sensors = if is_used(case) {
            SENSORS
        } else {
            SensorKind::Thrust as usize
        };
        case.sensors[..sensors].iter().all(|column| column.len() > 2)
    };
    assert!(cases.iter().all(is_filled));
    assert!(cases.iter().any(is_used) && !cases.iter().all(is_used));
    for (seed, case) in (0..).zip(&cases) {
        let arrival = case.arrival(seed, 900 * MS);
        assert!(arrival.len() == case.log.len() && arrival != case.log);
    }
}

/// What stands of all that a navigator has reported.
#[derive(Clone, Default)]
pub(crate) struct Reported(BTreeMap<(i64, &'static str), Finding>);

impl Reported {
    pub(crate) fn note(&mut self, notice: &Notice) {
        let key = match &notice.finding {
            Finding::Update(report) => (report.time_ns, report.sensor.name()),
            Finding::Rejected { time_ns, .. } => (*time_ns, "imu"),
        };
        let before = self.0.insert(key, notice.finding.clone());
        assert_eq!(before.is_some(), notice.standing != Standing::New, "{key:?}");
    }

    /// As text, which prints every bit that counts; NaN equals NaN.
    pub(crate) fn text(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// All that is to be the same after the same events.
pub(crate) fn outcome(navigator: &LiveNavigator) -> String {
    format!("{:?} {:?}", navigator.navigator(), navigator.imu_faults())
}

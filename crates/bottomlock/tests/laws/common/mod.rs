//! A simulated turn, its measurement epochs, and a batch on them; the names that most laws use.

pub(crate) mod arrivals;

pub(crate) use bottomlock::NavError;
pub(crate) use bottomlock::aiding::registry::SensorKind;
pub(crate) use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
pub(crate) use bottomlock::filter::gate::Gate;
pub(crate) use bottomlock::filter::options::Options;
pub(crate) use bottomlock::frames::{Rot, Vec3};
pub(crate) use bottomlock::layout::DIM;
pub(crate) use bottomlock::mechanisation::{ImuSample, LongGap, Sampling};
pub(crate) use bottomlock::model::Model;
pub(crate) use bottomlock::navigator::events::{
    AttitudeSample, DepthSample, Event, GpsSample, GpsVelocity, HeadingSample, VelocitySample,
};
pub(crate) use bottomlock::navigator::{BeamAiding, Finding, LiveNavigator, METHODS, Method, Navigator, Notice};
pub(crate) use bottomlock::simulation::batch::Batch;
pub(crate) use bottomlock::simulation::schedule::Schedule;
pub(crate) use bottomlock::state::{Covariance, NavState};
pub(crate) use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams::{Streams, simulate};
use bottomlock::simulation::truth::Truth;

pub(crate) const SECOND: i64 = 1_000_000_000;

/// A level turn with sideslip in closed form: body rates and specific forces are constant apart from the Earth rate.
pub(crate) struct Turn {
    pub(crate) time_ns: Vec<i64>,
    pub(crate) position_t_m: Vec<[f64; 3]>,
    pub(crate) attitude_t_p: Vec<[f64; 4]>,
    pub(crate) velocity_p_mps: Vec<[f64; 3]>,
    pub(crate) omega_p_radps: Vec<[f64; 3]>,
    pub(crate) force_p_mps2: Vec<[f64; 3]>,
}

impl Turn {
    pub(crate) fn new(seconds: i64, yaw_rate: f64) -> Self {
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

    pub(crate) fn truth(&self) -> Truth<'_> {
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

pub(crate) fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap()
}

pub(crate) struct Epochs {
    pub(crate) dvl: Vec<i64>,
    pub(crate) masks: Vec<BeamMask>,
    pub(crate) depth: Vec<i64>,
    pub(crate) magnetometer: Vec<i64>,
    pub(crate) gps: Vec<i64>,
    pub(crate) samples: Vec<i64>,
}

impl Epochs {
    /// Epochs of the DVL, the depth sensor and the magnetometer between IMU samples, and of GPS on full seconds.
    pub(crate) fn new(seconds: i64) -> Self {
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

    pub(crate) fn schedule(&self) -> Schedule<'_> {
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

/// The streams of one run on a turn, with the sensor errors of Table 2 and a Janus.
pub(crate) fn draw(
    turn: &Turn,
    schedule: &Schedule<'_>,
    seed: u64,
    trajectory: u64,
    run: u64,
) -> Result<Streams, NavError> {
    let (model, options) = (Model::table_2(), Options::default());
    let key = RunKey { seed, trajectory, run };
    simulate(&turn.truth(), &janus(), &model, &model, schedule, &options, &key)
}

/// A turn of eight seconds and its epochs, with the model, the options and the geometry of a batch.
pub(crate) fn eight_seconds() -> (Turn, Epochs, Model, Options, BeamGeometry) {
    (
        Turn::new(8, 0.05),
        Epochs::new(8),
        Model::table_2(),
        Options::default(),
        janus(),
    )
}

/// A batch of four runs of every method on a turn.
pub(crate) fn batch<'a>(
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

/// The bits of errors, standard deviations, NEES and NIS of every record.
pub(crate) fn bits(records: &[Vec<bottomlock::simulation::monte_carlo_run::MethodRecord>]) -> Vec<u64> {
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

/// An inertial reading of a slow turn, with a force ahead, m/s².
pub(crate) fn imu(time_ns: i64, force_x: f64) -> Event {
    Event::Imu(ImuSample {
        time_ns,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.01),
        force_p_mps2: Vec3::new(force_x, 0.0, -9.8),
    })
}

/// A navigator at rest with tight coupling.
pub(crate) fn tight(options: &Options) -> Navigator {
    let (start, model) = (NavState::at_rest(0), Model::table_2());
    Navigator::new(start, janus(), BeamAiding::Tight, &model, options).unwrap()
}

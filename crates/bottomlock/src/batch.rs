//! Runs × arms over the event loop: every arm of a run sees the same streams; results are placed by index.

use crate::dvl::geometry::{BeamGeometry, BeamMask};
use crate::dvl::partial::Method;
use crate::error::NavError;
use crate::events::Event;
use crate::frames::Vec3;
use crate::layout::{ATTITUDE, DIM};
use crate::model::{Model, Options};
use crate::report::{Sensor, UpdateReport, nees};
use crate::run::{BeamAiding, Navigator};
use crate::sensors::{RunKey, Schedule, Streams, simulate};
use crate::state::NavState;
use crate::truth::{Truth, true_state};

/// A way of aiding, by its short name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arm {
    /// Short name.
    pub name: &'static str,
    /// What it makes of the beams.
    pub aiding: BeamAiding,
    /// True where it sees every beam, lost or not: the reference.
    pub all_beams: bool,
}

/// Every arm.
pub const ARMS: [Arm; 11] = [
    Arm {
        name: "ins",
        aiding: BeamAiding::None,
        all_beams: false,
    },
    Arm {
        name: "lc",
        aiding: BeamAiding::Loose(Method::LeastSquares),
        all_beams: true,
    },
    Arm {
        name: "tc",
        aiding: BeamAiding::Tight,
        all_beams: false,
    },
    Arm {
        name: "vb",
        aiding: BeamAiding::Loose(Method::VirtualBeam),
        all_beams: false,
    },
    Arm {
        name: "nsv",
        aiding: BeamAiding::Loose(Method::NullifiedSway),
        all_beams: false,
    },
    Arm {
        name: "plcf",
        aiding: BeamAiding::Loose(Method::PartialLoose),
        all_beams: false,
    },
    Arm {
        name: "vhv",
        aiding: BeamAiding::Loose(Method::VirtualHeave),
        all_beams: false,
    },
    Arm {
        name: "elc",
        aiding: BeamAiding::Loose(Method::Selector),
        all_beams: false,
    },
    Arm {
        name: "vb_exact",
        aiding: BeamAiding::Loose(Method::VirtualBeamExact),
        all_beams: false,
    },
    Arm {
        name: "info",
        aiding: BeamAiding::Loose(Method::Information),
        all_beams: false,
    },
    Arm {
        name: "weak_sway",
        aiding: BeamAiding::Loose(Method::WeakSway),
        all_beams: false,
    },
];

/// Finds an arm by its short name.
///
/// # Errors
/// [`NavError::UnknownName`] with the names that are known.
pub fn arm(name: &str) -> Result<Arm, NavError> {
    ARMS.iter()
        .find(|arm| arm.name == name)
        .copied()
        .ok_or_else(|| NavError::UnknownName {
            what: "arm",
            name: name.into(),
            expected: "ins, lc, tc, vb, nsv, plcf, vhv, elc, vb_exact, info, weak_sway",
        })
}

/// What a batch works on.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// The true motion.
    pub truth: Truth<'a>,
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// What the sensors are.
    pub simulated: &'a Model,
    /// What the filter assumes them to be.
    pub assumed: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// When sensors measure; its beam masks are those of every run unless `masks_of_run` says otherwise.
    pub schedule: Schedule<'a>,
    /// Beam masks run by run (first run first), each as long as the DVL epochs.
    pub masks_of_run: Option<&'a [BeamMask]>,
    /// Times at which errors are recorded, ns, rising; the first IMU sample at or after each counts.
    pub sample_time_ns: &'a [i64],
    /// Ways of aiding.
    pub arms: &'a [Arm],
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory_key: u64,
    /// Number of the first run.
    pub first_run: u64,
    /// Number of runs.
    pub runs: usize,
}

/// What one arm of one run yields.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ArmRecord {
    /// Error at each sample: position (tangent, m), misalignment (tangent, rad), velocity (platform, m/s).
    pub error: Vec<[f64; 9]>,
    /// Standard deviation claimed for each.
    pub sd: Vec<[f64; 9]>,
    /// Normalised estimation error squared of the whole state.
    pub nees: Vec<f64>,
    /// The same of misalignment and velocity (6 degrees of freedom).
    pub nees_velocity_attitude: Vec<f64>,
    /// Mean normalised innovation squared over the DVL fixes; NaN without any.
    pub nis_mean: f64,
    /// DVL fixes used, whole or in part.
    pub fixes_accepted: u64,
    /// DVL fixes rejected by the gate.
    pub fixes_rejected: u64,
}

/// Works off a batch on `threads` threads; the bits do not depend on their number.
///
/// # Errors
/// [`NavError`]; an error inside a run names the run and the arm.
pub fn run_batch(batch: &Batch<'_>, threads: usize) -> Result<Vec<Vec<ArmRecord>>, NavError> {
    batch.truth.validate()?;
    batch.simulated.validate()?;
    if let Some(masks) = batch.masks_of_run {
        let expected = batch.runs * batch.schedule.dvl_time_ns.len();
        if masks.len() != expected {
            return Err(NavError::WrongCount {
                field: "beam_valid",
                got: masks.len(),
                expected: format!("{expected}, runs times DVL epochs"),
            });
        }
    }
    if let Some(pair) = batch.sample_time_ns.windows(2).find(|pair| pair[1] <= pair[0]) {
        return Err(NavError::TimeNotIncreasing {
            stream: "sample",
            time_ns: pair[1],
            previous_ns: pair[0],
        });
    }
    let last_ns = batch.truth.time_ns[batch.truth.time_ns.len() - 1];
    let first_ns = batch.truth.time_ns[0];
    if let Some(&time_ns) = batch.sample_time_ns.iter().find(|&&t| t < first_ns || t > last_ns) {
        return Err(NavError::OutsideTruth {
            stream: "sample",
            time_ns,
            first_ns,
            last_ns,
        });
    }
    in_parallel(batch.runs, threads, |index| one_run(batch, index))
}

#[cfg(feature = "parallel")]
fn in_parallel<T: Send>(
    count: usize,
    threads: usize,
    work: impl Fn(usize) -> Result<T, NavError> + Sync + Send,
) -> Result<Vec<T>, NavError> {
    use rayon::prelude::*;
    if threads == 1 {
        return (0..count).map(work).collect();
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|_| NavError::OutOfRange {
            field: "threads",
            value: threads as f64,
            expected: "a number of threads that the system can start",
        })?;
    // Collected in order: the first error by run number is returned, whichever thread meets one first.
    let results: Vec<Result<T, NavError>> = pool.install(|| (0..count).into_par_iter().map(work).collect());
    results.into_iter().collect()
}

#[cfg(not(feature = "parallel"))]
fn in_parallel<T>(
    count: usize,
    _threads: usize,
    work: impl Fn(usize) -> Result<T, NavError>,
) -> Result<Vec<T>, NavError> {
    (0..count).map(work).collect()
}

fn one_run(batch: &Batch<'_>, index: usize) -> Result<Vec<ArmRecord>, NavError> {
    let run = batch.first_run + index as u64;
    let key = RunKey {
        seed: batch.seed,
        trajectory: batch.trajectory_key,
        run,
    };
    let mut schedule = batch.schedule;
    if let Some(masks) = batch.masks_of_run {
        let epochs = schedule.dvl_time_ns.len();
        schedule.beam_valid = &masks[index * epochs..(index + 1) * epochs];
    }
    let streams = simulate(
        &batch.truth,
        batch.geometry,
        batch.simulated,
        batch.assumed,
        &schedule,
        batch.options.sampling,
        &key,
    )?;
    batch
        .arms
        .iter()
        .map(|arm| {
            one_arm(batch, &streams, arm).map_err(|source| NavError::InRun {
                run,
                arm: arm.name,
                source: Box::new(source),
            })
        })
        .collect()
}

fn one_arm(batch: &Batch<'_>, streams: &Streams, arm: &Arm) -> Result<ArmRecord, NavError> {
    let mut navigator = Navigator::new(
        streams.initial,
        batch.geometry.clone(),
        arm.aiding,
        batch.assumed,
        batch.options,
    )?;
    let mut record = ArmRecord::default();
    let (mut nis_sum, mut fixes) = (0.0, 0_u64);
    let mut heard = |report: &UpdateReport| {
        if report.sensor == Sensor::Beams && report.rows > 0 {
            nis_sum += report.nis;
            fixes += 1;
            if report.was_used() {
                record.fixes_accepted += 1;
            } else {
                record.fixes_rejected += 1;
            }
        }
    };
    let all = BeamMask::all(batch.geometry.beams());
    let mut aids = merged(streams);
    aids.iter_mut().for_each(|aid| {
        if let (Event::Beams(ping), true) = (aid, arm.all_beams) {
            ping.valid = all;
        }
    });
    let mut aids = aids.iter().peekable();
    let mut samples = batch.sample_time_ns.iter().peekable();
    let mut samples_taken = Vec::new();
    for (k, imu) in streams.imu.iter().enumerate() {
        navigator.push(&Event::Imu(*imu), &mut heard)?;
        // A measurement at the very time of an IMU sample comes after it; one between two samples waits inside the navigator.
        let next_ns = streams.imu.get(k + 1).map_or(i64::MAX, |next| next.time_ns);
        while let Some(aid) = aids.next_if(|aid| aid.time_ns() < next_ns) {
            navigator.push(aid, &mut heard)?;
        }
        if samples.next_if(|&&time_ns| time_ns <= imu.time_ns).is_some() {
            samples_taken.push(sample(batch, streams, k, &navigator)?);
        }
    }
    for taken in samples_taken {
        record.error.push(taken.error);
        record.sd.push(taken.sd);
        record.nees.push(taken.nees);
        record.nees_velocity_attitude.push(taken.nees_velocity_attitude);
    }
    record.nis_mean = if fixes > 0 { nis_sum / fixes as f64 } else { f64::NAN };
    Ok(record)
}

/// All measurements but the IMU's, by time; at the same time DVL before depth before attitude before GPS.
fn merged(streams: &Streams) -> Vec<Event> {
    let mut events: Vec<Event> = streams.pings.iter().copied().map(Event::Beams).collect();
    events.extend(streams.depth.iter().copied().map(Event::Depth));
    events.extend(streams.attitude.iter().copied().map(Event::Attitude));
    events.extend(streams.gps.iter().copied().map(Event::Gps));
    events.sort_by_key(Event::time_ns);
    events
}

struct Sample {
    error: [f64; 9],
    sd: [f64; 9],
    nees: f64,
    nees_velocity_attitude: f64,
}

fn sample(batch: &Batch<'_>, streams: &Streams, k: usize, navigator: &Navigator) -> Result<Sample, NavError> {
    let truth = full_truth(batch, streams, k);
    let error = truth.error_of(&navigator.state());
    let covariance = navigator.covariance();
    let indefinite = || NavError::NotPositiveDefinite {
        matrix: "state covariance",
        time_ns: truth.time_ns,
    };
    Ok(Sample {
        error: std::array::from_fn(|i| error[i]),
        sd: std::array::from_fn(|i| covariance[(i, i)].sqrt()),
        nees: nees(&covariance, &error, 0, DIM).ok_or_else(indefinite)?,
        nees_velocity_attitude: nees(&covariance, &error, ATTITUDE, ATTITUDE + 6).ok_or_else(indefinite)?,
    })
}

/// The true state with the true biases behind the streams.
fn full_truth(batch: &Batch<'_>, streams: &Streams, k: usize) -> NavState {
    let mut truth = true_state(&batch.truth, k);
    truth.accel_bias_p_mps2 = Vec3::from_array(streams.accel_bias_p_mps2[k]);
    truth.gyro_bias_p_radps = Vec3::from_array(streams.gyro_bias_p_radps[k]);
    let pings = streams.pings.partition_point(|ping| ping.time_ns <= truth.time_ns);
    let (bias, scale) = match pings.checked_sub(1) {
        Some(last) => (streams.beam_bias_mps[last], streams.scale_factor[last]),
        None => streams.first_dvl,
    };
    truth.dvl_bias_mps = nalgebra::Vector4::from_fn(|beam, _| bias[beam]);
    truth.dvl_scale_factor = scale;
    truth
}

//! One run: its sensors, and every arm beside it, led along a truth; the whole of it, or as it unfolds.

use crate::bank::Guide;
use crate::batch::Arm;
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample};
use crate::error::NavError;
use crate::events::Event;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM};
use crate::model::{Model, Options};
use crate::report::{Choice, Sensor, UpdateReport, nees};
use crate::sensors::{RunKey, Schedule};
use crate::state::NavState;
use crate::suite::{SensorSuite, drawn_start};
use crate::truth::{Truth, true_state};

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
    /// What was chosen at each ping, of an arm that chooses.
    pub choices: Vec<Choice>,
    /// How well the IMU's biases are known at the last sample; none without samples.
    pub biases: Option<BiasRecord>,
}

/// Errors of the biases of accelerometers (m/s²) and gyros (rad/s), x, y, z each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasRecord {
    /// True minus estimate.
    pub error: [f64; 6],
    /// Standard deviation claimed for each.
    pub sd: [f64; 6],
}

#[derive(Debug, Clone)]
struct Lane {
    arm: Arm,
    guide: Guide,
    record: ArmRecord,
    nis_sum: f64,
}

impl Lane {
    fn push(&mut self, event: &Event) -> Result<(), NavError> {
        let (record, nis_sum) = (&mut self.record, &mut self.nis_sum);
        self.guide.push(event, &mut |report: &UpdateReport| {
            record.choices.extend(report.choice);
            if report.sensor == Sensor::Beams && report.rows > 0 {
                *nis_sum += report.nis;
                if report.was_used() {
                    record.fixes_accepted += 1;
                } else {
                    record.fixes_rejected += 1;
                }
            }
        })
    }

    fn sample(&mut self, truth: &NavState) -> Result<(), NavError> {
        let error = truth.error_of(&self.guide.state());
        let covariance = self.guide.covariance();
        let nees_of = |from, to| {
            nees(&covariance, &error, from, to).ok_or(NavError::NotPositiveDefinite {
                matrix: "state covariance",
                time_ns: truth.time_ns,
            })
        };
        self.record.nees.push(nees_of(0, DIM)?);
        self.record
            .nees_velocity_attitude
            .push(nees_of(ATTITUDE, ATTITUDE + 6)?);
        self.record.error.push(std::array::from_fn(|i| error[i]));
        self.record.sd.push(std::array::from_fn(|i| covariance[(i, i)].sqrt()));
        self.record.biases = Some(BiasRecord {
            error: std::array::from_fn(|i| error[ACCEL_BIAS + i]),
            sd: std::array::from_fn(|i| covariance[(ACCEL_BIAS + i, ACCEL_BIAS + i)].sqrt()),
        });
        Ok(())
    }
}

/// A run under way.
#[derive(Debug, Clone)]
pub struct Voyage {
    run: u64,
    geometry: BeamGeometry,
    suite: SensorSuite,
    lanes: Vec<Lane>,
    started: bool,
}

impl Voyage {
    /// A run at its start: sensors as `simulated` says, filters that assume `assumed`, off by a drawn error.
    ///
    /// # Errors
    /// [`NavError`] for models and options that make no sense.
    pub fn new(
        start: &NavState,
        geometry: &BeamGeometry,
        simulated: &Model,
        assumed: &Model,
        options: &Options,
        arms: &[Arm],
        key: &RunKey,
    ) -> Result<Self, NavError> {
        let initial = drawn_start(start, simulated, key);
        let lanes = arms.iter().map(|&arm| {
            let guide = Guide::new(initial, geometry, arm.aiding, assumed, options)
                .map_err(|source| in_run(key.run, &arm, source))?;
            Ok(Lane {
                arm,
                guide,
                record: ArmRecord::default(),
                nis_sum: 0.0,
            })
        });
        Ok(Self {
            run: key.run,
            geometry: geometry.clone(),
            suite: SensorSuite::new(
                simulated,
                assumed,
                options.sampling,
                geometry.beams(),
                start.time_ns,
                key,
            ),
            lanes: lanes.collect::<Result<_, _>>()?,
            started: false,
        })
    }

    /// The estimate of an arm.
    #[must_use]
    pub fn state(&self, arm: usize) -> Option<NavState> {
        self.lanes.get(arm).map(|lane| lane.guide.state())
    }

    /// Leads sensors and filters along a stretch of the truth.
    ///
    /// The first stretch begins at the start; each later one begins with the last sample of the one before. Epochs lie after the
    /// stretch's first sample (the first stretch: at or after it). Errors are recorded at the first sample at or after each of
    /// `sample_time_ns`. However the truth is cut, the bits are the same.
    ///
    /// # Errors
    /// [`NavError`] for epochs outside the stretch or out of order; an error of an arm names run and arm.
    pub fn advance(
        &mut self,
        truth: &Truth<'_>,
        schedule: &Schedule<'_>,
        sample_time_ns: &[i64],
    ) -> Result<(), NavError> {
        schedule.validate()?;
        let mut epochs = Epochs::new(schedule);
        let mut samples = sample_time_ns.iter().peekable();
        for k in usize::from(self.started)..truth.time_ns.len() {
            let time_ns = truth.time_ns[k];
            // What falls between two samples waits inside the navigator for the later one.
            while let Some(epoch) = epochs.next_if(|epoch_ns| epoch_ns < time_ns) {
                self.measure(truth, schedule, epoch)?;
            }
            let reading = Event::Imu(self.suite.imu(truth, k));
            self.each(|lane| lane.push(&reading))?;
            while let Some(epoch) = epochs.next_if(|epoch_ns| epoch_ns <= time_ns) {
                self.measure(truth, schedule, epoch)?;
            }
            if samples.next_if(|&&sample_ns| sample_ns <= time_ns).is_some() {
                let mut state = true_state(truth, k);
                self.suite.errors_into(&mut state);
                self.each(|lane| lane.sample(&state))?;
            }
        }
        self.started = true;
        // Only epochs beyond the stretch are left, and the truth refuses them.
        while let Some(epoch) = epochs.next_if(|_| true) {
            self.measure(truth, schedule, epoch)?;
        }
        Ok(())
    }

    /// What the arms have yielded, in their order.
    #[must_use]
    pub fn records(&self) -> Vec<ArmRecord> {
        let of_lane = |lane: &Lane| {
            let fixes = lane.record.fixes_accepted + lane.record.fixes_rejected;
            ArmRecord {
                nis_mean: if fixes > 0 {
                    lane.nis_sum / fixes as f64
                } else {
                    f64::NAN
                },
                ..lane.record.clone()
            }
        };
        self.lanes.iter().map(of_lane).collect()
    }

    fn each(&mut self, mut work: impl FnMut(&mut Lane) -> Result<(), NavError>) -> Result<(), NavError> {
        let run = self.run;
        self.lanes
            .iter_mut()
            .try_for_each(|lane| work(lane).map_err(|source| in_run(run, &lane.arm, source)))
    }

    fn measure(&mut self, truth: &Truth<'_>, schedule: &Schedule<'_>, (sensor, k): Epoch) -> Result<(), NavError> {
        let offset = |offsets: &[f64]| offsets.get(k).copied().unwrap_or(0.0);
        let event = match sensor {
            Aid::Dvl => {
                let (time_ns, valid) = (schedule.dvl_time_ns[k], schedule.beam_valid[k]);
                Event::Beams(self.suite.ping(truth, &self.geometry, time_ns, valid)?)
            }
            Aid::Depth => {
                let time_ns = schedule.depth_time_ns[k];
                Event::Depth(self.suite.depth(truth, time_ns, offset(schedule.depth_offset_m))?)
            }
            Aid::Magnetometer => {
                let time_ns = schedule.magnetometer_time_ns[k];
                Event::Attitude(self.suite.attitude(truth, time_ns, offset(schedule.yaw_offset_rad))?)
            }
            Aid::Gps => Event::Gps(self.suite.gps(truth, schedule.gps_time_ns[k])?),
        };
        let all = BeamMask::all(self.geometry.beams());
        self.each(|lane| match event {
            Event::Beams(ping) if lane.arm.all_beams => lane.push(&Event::Beams(BeamSample { valid: all, ..ping })),
            _ => lane.push(&event),
        })
    }
}

fn in_run(run: u64, arm: &Arm, source: NavError) -> NavError {
    NavError::InRun {
        run,
        arm: arm.name,
        source: Box::new(source),
    }
}

#[derive(Debug, Clone, Copy)]
enum Aid {
    Dvl,
    Depth,
    Magnetometer,
    Gps,
}

type Epoch = (Aid, usize);

/// The epochs of all aiding sensors in order of time; at the same time DVL before depth before magnetometer before GPS.
struct Epochs<'a> {
    streams: [(Aid, &'a [i64], usize); 4],
}

impl<'a> Epochs<'a> {
    fn new(schedule: &Schedule<'a>) -> Self {
        Self {
            streams: [
                (Aid::Dvl, schedule.dvl_time_ns, 0),
                (Aid::Depth, schedule.depth_time_ns, 0),
                (Aid::Magnetometer, schedule.magnetometer_time_ns, 0),
                (Aid::Gps, schedule.gps_time_ns, 0),
            ],
        }
    }

    fn next_if(&mut self, wanted: impl Fn(i64) -> bool) -> Option<Epoch> {
        let (sensor, times, next) = self
            .streams
            .iter_mut()
            .filter(|(_, times, next)| *next < times.len())
            .min_by_key(|(_, times, next)| times[*next])?;
        let k = *next;
        wanted(times[k]).then(|| {
            *next += 1;
            (*sensor, k)
        })
    }
}

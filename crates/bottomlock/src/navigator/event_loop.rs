//! A filter with its beam aiding, pushed one event at a time; many of them side by side are in `run_events.rs`.

#[path = "admission.rs"]
mod admission;
#[path = "every_filter.rs"]
mod every_filter;
#[path = "motion_aiding.rs"]
mod motion_aiding;
#[path = "own_aiding.rs"]
mod own_aiding;
#[path = "ping_aiding.rs"]
mod ping_aiding;
#[path = "restored.rs"]
mod restored;

use std::collections::VecDeque;

use nalgebra::Matrix3;

use crate::aiding;
use crate::aiding::closure::push_closure;
use crate::aiding::registry::Measurement;
use crate::aiding::thrust::HELD_NS;
use crate::aiding::{InformationPort, Innovation};
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample};
use crate::dvl::partial::{FixEstimator, PartialMethod, fix_estimator};
use crate::error::NavError;
use crate::filter::Eskf;
use crate::filter::options::Options;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::filter::water_block::WaterBlock;
use crate::layout::VELOCITY;
use crate::mechanisation::{ImuSample, Sampling};
use crate::model::Model;
use crate::navigator::dual_filter::DualFilter;
use crate::navigator::events::{Event, STREAMS};
use crate::navigator::own_method::OwnMethod;
use crate::state::{Covariance, NavState};

/// Aiding by beams of the navigator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum BeamAiding {
    /// Nothing.
    None,
    /// A row per valid beam (TC).
    Tight,
    /// A velocity solved from the beams (LC and ELC).
    Loose(PartialMethod),
    /// A row per valid beam, then sway and heave through the water with the current as states.
    SwayCurrent,
    /// What a method from outside the kernel makes of the beams.
    Own(OwnMethod),
}

impl BeamAiding {
    /// Returns true if each row of an update is a beam, in the order of the beams.
    #[must_use]
    pub fn rows_are_beams(self) -> bool {
        matches!(self, Self::Tight | Self::SwayCurrent)
    }
}

/// A filter with its beam aiding, fed in order of time.
///
/// A measurement between two IMU samples waits for the later one; the step is then split at the measurement's own time.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Navigator {
    filters: DualFilter,
    geometry: BeamGeometry,
    aiding: BeamAiding,
    options: Options,
    last_imu: Option<ImuSample>,
    waiting: VecDeque<Event>,
    last_ns: [Option<i64>; STREAMS],
    /// Time of the last ping that the filters have taken; `last_ns` also has those that wait.
    last_ping_ns: Option<i64>,
    /// Time of the last of which the accepted beams determine the whole velocity.
    last_whole_ns: Option<i64>,
    /// Time from which on the next epoch of the prior of the motion is due.
    next_motion_ns: Option<i64>,
    /// Beams that were accepted at least once.
    confirmed: BeamMask,
}

impl Navigator {
    /// A navigator at an initial state.
    ///
    /// # Errors
    /// As [`Eskf::new`]; [`NavError::OutOfRange`] for a calibration with a method from outside the kernel.
    pub fn new(
        initial: NavState,
        geometry: BeamGeometry,
        aiding: BeamAiding,
        model: &Model,
        options: &Options,
    ) -> Result<Self, NavError> {
        own_aiding::check(aiding, options)?;
        let filter = Eskf::new(initial, model, options)?.with_beams(geometry.beams(), model, options.estimate_dvl);
        let water = (aiding == BeamAiding::SwayCurrent).then(|| WaterBlock::new(&options.water));
        Ok(Self {
            filters: DualFilter::new(filter.with_water(measured_water(options)), water),
            geometry,
            aiding,
            options: *options,
            last_imu: None,
            waiting: VecDeque::new(),
            last_ns: [None; STREAMS],
            last_ping_ns: None,
            last_whole_ns: None,
            next_motion_ns: None,
            confirmed: BeamMask::NONE,
        })
    }

    /// The estimate at the time of the last IMU sample.
    #[must_use]
    pub fn state(&self) -> NavState {
        self.filters.best().state()
    }

    /// Its covariance; asking changes nothing.
    #[must_use]
    pub fn covariance(&self) -> Covariance {
        self.filters.best().covariance()
    }

    /// The filter that makes no assumption: the only one but in the method [`BeamAiding::SwayCurrent`].
    pub fn filter_mut(&mut self) -> &mut Eskf {
        &mut self.filters.measurements_only
    }

    /// The filter whose estimate is reported.
    #[must_use]
    pub fn filter(&self) -> &Eskf {
        self.filters.best()
    }

    /// The filters, for a smoother.
    pub(crate) fn filters(&mut self) -> &mut DualFilter {
        &mut self.filters
    }

    /// Every filter.
    pub(crate) fn each_filter(&self) -> impl Iterator<Item = &Eskf> {
        self.filters.each()
    }

    /// Every filter.
    pub(crate) fn filters_mut(&mut self) -> impl Iterator<Item = &mut Eskf> {
        self.filters.each_mut()
    }

    /// The beams.
    #[must_use]
    pub fn geometry(&self) -> &BeamGeometry {
        &self.geometry
    }

    /// The last inertial reading.
    pub(crate) fn last_imu(&self) -> Option<ImuSample> {
        self.last_imu
    }

    /// Takes note that the filters have taken inertial readings up to `last`.
    pub(crate) fn has_taken(&mut self, last: &ImuSample) {
        self.last_imu = Some(*last);
        self.last_ns[0] = Some(last.time_ns);
    }

    /// Replaces the covariance; the estimate of the motion through the water is reset to its prior.
    ///
    /// # Errors
    /// As [`Eskf::set_covariance`].
    pub fn set_covariance(&mut self, covariance: &Covariance) -> Result<(), NavError> {
        let filter = &mut self.filters.measurements_only;
        filter.set_covariance(covariance)?;
        filter.set_water(measured_water(&self.options));
        if self.aiding == BeamAiding::SwayCurrent {
            self.filters.start_constrained(WaterBlock::new(&self.options.water));
        }
        Ok(())
    }

    /// The current, where it is estimated, and the slip through the water.
    #[must_use]
    pub fn water(&self) -> Option<&WaterBlock> {
        self.filters.best().water()
    }

    /// Takes an event; `report` is called with every measurement that it completes.
    ///
    /// # Errors
    /// [`NavError`] for bad numbers and for time that does not increase within a stream or lies before the filter's time; the
    /// event is then not taken and the navigator is as before, unless the numerics themselves have failed.
    pub fn push(&mut self, event: &Event, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        self.admit(event)?;
        let (time_ns, (_, index)) = (event.time_ns(), event.stream());
        match event {
            Event::Imu(sample) => self.advance(sample, report)?,
            _ if self.last_imu.is_some_and(|last| last.time_ns == time_ns) => self.aid(event, report)?,
            _ => {
                // Sensors that wait for the same IMU sample need not arrive in order.
                let place = self.waiting.partition_point(|other| other.time_ns() <= time_ns);
                self.waiting.insert(place, *event);
            }
        }
        self.last_ns[index] = Some(time_ns);
        Ok(())
    }

    fn advance(&mut self, sample: &ImuSample, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        // Before the first sample the motion is taken as that of the first sample.
        let mut last = self.last_imu.unwrap_or_else(|| ImuSample {
            time_ns: self.filters.measurements_only.time_ns(),
            ..*sample
        });
        if self.last_imu.is_none() {
            self.filters.note_rate(&last);
        }
        let interval_s = (sample.time_ns - last.time_ns) as f64 * 1e-9;
        while let Some(event) = self
            .waiting
            .front()
            .copied()
            .filter(|event| event.time_ns() <= sample.time_ns)
        {
            let time_ns = event.time_ns();
            if time_ns > last.time_ns {
                let middle = match self.options.imu_sampling {
                    Sampling::Instantaneous => ImuSample::between(&last, sample, time_ns),
                    Sampling::Averaged => ImuSample { time_ns, ..*sample },
                };
                self.filters.predict(&last, &middle)?;
                self.filters.note_interval(interval_s);
                last = middle;
            }
            self.waiting.pop_front();
            self.aid(&event, report)?;
        }
        if sample.time_ns > last.time_ns {
            self.filters.predict(&last, sample)?;
            self.filters.note_interval(interval_s);
        }
        self.last_imu = Some(*sample);
        self.keep_to_motion(sample.time_ns, report)
    }

    fn aid(&mut self, event: &Event, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        let levers = self.options.levers;
        let filters = &mut self.filters;
        match event {
            Event::Imu(_) => {}
            Event::Beams(ping) => {
                let used = self.aid_with_ping(ping, report)?;
                self.bound_speed(ping.time_ns, report)?;
                let before_ns = self.last_ping_ns.replace(ping.time_ns);
                let is_whole = self.geometry.rank_of(used) == 3;
                self.filters.assume(&mut *report)?;
                if is_whole {
                    self.last_whole_ns = Some(ping.time_ns);
                    return self.learn_motion(ping.time_ns, before_ns, report);
                }
            }
            Event::WaterTrack(_) if self.aiding == BeamAiding::None => {}
            Event::WaterTrack(sample) => {
                let geometry = &self.geometry;
                filters
                    .each_mut()
                    .for_each(|filter| filter.prepare_for_water(Some((geometry, sample))));
                let innovation_of = |filter: &Eskf| filter.water_track_innovation(geometry, sample);
                let outcome = filters.update_or_inflate(Sensor::WaterTrack, &innovation_of)?;
                if matches!(outcome.verdict, Verdict::Accepted | Verdict::AcceptedInPart { .. }) {
                    filters
                        .each_mut()
                        .for_each(|filter| filter.note_water(geometry, sample));
                    self.note_water_velocity(&sample.ping);
                }
                report(&outcome);
            }
            Event::Aiding(measurement) => {
                if let Measurement::Thrust(_) = measurement {
                    filters.each_mut().for_each(Eskf::prepare_for_thrust);
                }
                let is_held = self
                    .last_whole_ns
                    .is_some_and(|last_ns| event.time_ns() - last_ns <= HELD_NS);
                let corrects = self.options.thrust.corrects(is_held);
                for sensor in measurement.reports() {
                    let innovation_of =
                        |filter: &Eskf| filter.aiding_innovation(measurement, sensor, &levers, corrects);
                    report(&filters.update_or_inflate(sensor, &innovation_of)?);
                }
            }
        }
        self.keep_to_motion(event.time_ns(), report)
    }

    /// The innovation of a velocity solved from the beams, and how it is solved.
    fn loose_innovation(
        &mut self,
        method: PartialMethod,
        ping: &BeamSample,
    ) -> Result<(Innovation, FixEstimator), NavError> {
        let filter = &mut self.filters.measurements_only;
        let terms = filter.beam_terms(&self.geometry, ping);
        let geometry = &filter.calibrated_geometry(&self.geometry);
        let p_xv = filter.velocity_covariance();
        let prior_cov: Matrix3<f64> = p_xv.fixed_rows::<3>(VELOCITY).into_owned();
        let state = filter.state();
        // The gain works on readings divided by 1 + SF.
        let noise = terms.noise / (1.0 + state.dvl_scale_factor).powi(2);
        let interval_s = self.last_ping_ns.map(|last_ns| (ping.time_ns - last_ns) as f64 * 1e-9);
        let (valid, assumptions) = (ping.valid, self.options.assumptions.of_ping(interval_s));
        let fix = fix_estimator(method, geometry, valid, &noise, Some(&prior_cov), &assumptions)?;
        let port = match method {
            PartialMethod::Information => self.options.information_port,
            _ => InformationPort::Axes,
        };
        let cross = (self.is_exact(method) && fix.virtual_beams[0].is_some()).then_some(&p_xv);
        let mut innovation = aiding::loosely_coupled(&state, geometry, &terms, &fix, port, cross);
        if self.is_lossless(method) {
            push_closure(&mut innovation, &terms, valid, geometry.rank_of(valid));
        }
        Ok((innovation, fix))
    }

    fn aid_with_beams(&mut self, ping: &BeamSample) -> Result<Option<UpdateReport>, NavError> {
        let geometry = &self.geometry;
        let method = match self.aiding {
            BeamAiding::None => return Ok(None),
            BeamAiding::Tight | BeamAiding::SwayCurrent => {
                let innovation_of = |filter: &Eskf| tight_innovation(filter, geometry, ping);
                return self.filters.update(Sensor::Beams, &innovation_of).map(Some);
            }
            BeamAiding::Own(own) => return self.aid_by_own(own, ping).map(Some),
            BeamAiding::Loose(method) => method,
        };
        let (innovation, fix) = self.loose_innovation(method, ping)?;
        let virtual_count = fix.virtual_beams.iter().flatten().count();
        let is_exact = self.is_exact(method) && virtual_count > 0;
        let filter = &mut self.filters.measurements_only;
        if is_exact {
            return filter
                .update_correlated(&innovation, 3 - virtual_count, Sensor::Beams)
                .map(Some);
        }
        let mut report = filter.update(&innovation, Sensor::Beams)?;
        if method == PartialMethod::Selector {
            let source = |k: usize| fix.is_solved(k).then_some(fix.sources[k]);
            report.choice = Some(std::array::from_fn(source));
        }
        Ok(Some(report))
    }

    /// Whether a method passes on all that the beams measure: in a filter it is tight coupling by another name.
    fn is_lossless(&self, method: PartialMethod) -> bool {
        method == PartialMethod::Information || self.is_exact(method)
    }

    /// Whether a method keeps the correlation of its virtual beams with the filter.
    fn is_exact(&self, method: PartialMethod) -> bool {
        self.options.assumptions.exact_virtual_beams && method == PartialMethod::VirtualBeam
    }
}

/// A row for each valid beam, for one filter.
fn tight_innovation(filter: &Eskf, geometry: &BeamGeometry, ping: &BeamSample) -> Innovation {
    aiding::tightly_coupled(&filter.beam_terms(geometry, ping), ping)
}

/// The water states of the filter on the measurements alone, where a reading tells of the current.
fn measured_water(options: &Options) -> Option<WaterBlock> {
    let water = || WaterBlock::new(&options.water).with_layers(&options.current_layers);
    options.measures_current().then(water)
}

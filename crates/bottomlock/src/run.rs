//! The one event loop: campaign, replay and live use are the same [`Navigator`] fed an event at a time.

use std::collections::VecDeque;

use nalgebra::Matrix3;

use crate::aiding;
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::dvl::partial::{FixPlan, Method, plan};
use crate::error::NavError;
use crate::events::Event;
use crate::filter::Eskf;
use crate::imu::{ImuSample, Sampling};
use crate::layout::VELOCITY;
use crate::model::{InformationPort, Model, Options};
use crate::report::{Sensor, UpdateReport};
use crate::state::{Covariance, NavState};

/// What the navigator makes of the beams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BeamAiding {
    /// Nothing.
    None,
    /// A row per valid beam (TC).
    Tight,
    /// A velocity solved from the beams (LC and ELC).
    Loose(Method),
}

/// A filter with its beam aiding, fed in order of time.
///
/// A measurement between two IMU samples waits for the later one; the step is then split at the measurement's own time.
#[derive(Debug, Clone)]
pub struct Navigator {
    filter: Eskf,
    geometry: BeamGeometry,
    aiding: BeamAiding,
    options: Options,
    last_imu: Option<ImuSample>,
    waiting: VecDeque<Event>,
    last_ns: [Option<i64>; 7],
}

impl Navigator {
    /// A navigator at an initial state.
    ///
    /// # Errors
    /// As [`Eskf::new`].
    pub fn new(
        initial: NavState,
        geometry: BeamGeometry,
        aiding: BeamAiding,
        model: &Model,
        options: &Options,
    ) -> Result<Self, NavError> {
        let filter = Eskf::new(initial, model, options)?;
        Ok(Self {
            filter,
            geometry,
            aiding,
            options: *options,
            last_imu: None,
            waiting: VecDeque::new(),
            last_ns: [None; 7],
        })
    }

    /// The estimate at the time of the last IMU sample.
    #[must_use]
    pub fn state(&self) -> NavState {
        self.filter.state()
    }

    /// Its covariance; asking changes nothing.
    #[must_use]
    pub fn covariance(&self) -> Covariance {
        self.filter.covariance()
    }

    /// The filter, to set a covariance.
    pub fn filter_mut(&mut self) -> &mut Eskf {
        &mut self.filter
    }

    /// Takes an event; `report` hears of every measurement that is worked off by it.
    ///
    /// # Errors
    /// [`NavError`] for bad numbers and for time that does not increase within a stream or lies before the filter's time; the
    /// event is then not taken and the navigator is as before, unless the numerics themselves have failed.
    pub fn push(&mut self, event: &Event, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        event.validate(&self.geometry)?;
        let (time_ns, (stream, index)) = (event.time_ns(), event.stream());
        let now_ns = self.filter.state().time_ns;
        let newest_waiting = self.waiting.back().map(Event::time_ns);
        if let Some(previous_ns) = self.last_ns[index].filter(|&previous_ns| time_ns <= previous_ns) {
            return Err(NavError::TimeNotIncreasing {
                stream,
                time_ns,
                previous_ns,
            });
        }
        if time_ns < now_ns {
            return Err(NavError::TimeNotIncreasing {
                stream,
                time_ns,
                previous_ns: now_ns,
            });
        }
        match event {
            Event::Imu(sample) => self.advance(sample, report)?,
            _ if self.last_imu.is_some_and(|last| last.time_ns == time_ns) => self.aid(event, report)?,
            _ => {
                if let Some(previous_ns) = newest_waiting.filter(|&previous_ns| time_ns < previous_ns) {
                    return Err(NavError::TimeNotIncreasing {
                        stream,
                        time_ns,
                        previous_ns,
                    });
                }
                self.waiting.push_back(*event);
            }
        }
        self.last_ns[index] = Some(time_ns);
        Ok(())
    }

    fn advance(&mut self, sample: &ImuSample, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        // Before the first sample the motion is taken as that of the first sample.
        let now_ns = self.filter.state().time_ns;
        let mut last = self.last_imu.unwrap_or(ImuSample {
            time_ns: now_ns,
            ..*sample
        });
        while let Some(event) = self
            .waiting
            .front()
            .copied()
            .filter(|event| event.time_ns() <= sample.time_ns)
        {
            let time_ns = event.time_ns();
            if time_ns > last.time_ns {
                let middle = match self.options.sampling {
                    Sampling::Instantaneous => ImuSample::between(&last, sample, time_ns),
                    Sampling::Averaged => ImuSample { time_ns, ..*sample },
                };
                self.filter.predict(&last, &middle)?;
                last = middle;
            }
            self.waiting.pop_front();
            self.aid(&event, report)?;
        }
        if sample.time_ns > last.time_ns {
            self.filter.predict(&last, sample)?;
        }
        self.last_imu = Some(*sample);
        Ok(())
    }

    fn aid(&mut self, event: &Event, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        let filter = &mut self.filter;
        let state = filter.state();
        match event {
            Event::Imu(_) => {}
            Event::Beams(ping) => {
                if let Some(outcome) = self.aid_with_beams(ping)? {
                    report(&outcome);
                }
            }
            Event::Velocity(sample) => {
                let innovation = aiding::velocity(&state, &sample.velocity_p_mps, &sample.cov_m2ps2);
                report(&filter.update(&innovation, Sensor::Velocity)?);
            }
            Event::Depth(sample) => {
                let innovation = aiding::depth(&state, sample.depth_m, sample.sd_m, &self.options.depth_lever_p_m);
                report(&filter.update(&innovation, Sensor::Depth)?);
            }
            Event::Attitude(sample) => {
                let innovation = aiding::attitude(
                    &state,
                    &sample.attitude_t_p,
                    sample.roll_pitch_sd_rad,
                    sample.yaw_sd_rad,
                );
                report(&filter.update(&innovation, Sensor::Attitude)?);
            }
            Event::Heading(sample) => {
                let innovation = aiding::heading(&state, sample.yaw_rad, sample.sd_rad);
                report(&filter.update(&innovation.unwrap_or_else(aiding::Innovation::empty), Sensor::Heading)?);
            }
            Event::Gps(sample) => {
                let lever = self.options.gps_lever_p_m;
                let position = aiding::gps_position(&state, &sample.position_t_m, &sample.position_sd_m, &lever);
                report(&filter.update(&position, Sensor::GpsPosition)?);
                let velocity = filter.with_motion(|motion| {
                    aiding::gps_velocity(motion, &sample.velocity_t_mps, &sample.velocity_sd_mps, &lever)
                });
                report(&filter.update(&velocity, Sensor::GpsVelocity)?);
            }
        }
        Ok(())
    }

    fn aid_with_beams(&mut self, ping: &BeamSample) -> Result<Option<UpdateReport>, NavError> {
        let BeamAiding::Loose(method) = self.aiding else {
            if self.aiding == BeamAiding::None {
                return Ok(None);
            }
            let terms = self
                .filter
                .with_motion(|motion| aiding::beam_terms(motion, &self.geometry, ping));
            return self
                .filter
                .update(&aiding::tightly_coupled(&terms, ping), Sensor::Beams)
                .map(Some);
        };
        let terms = self
            .filter
            .with_motion(|motion| aiding::beam_terms(motion, &self.geometry, ping));
        let p_xv = self.filter.velocity_covariance();
        let prior_cov: Matrix3<f64> = p_xv.fixed_rows::<3>(VELOCITY).into_owned();
        let state = self.filter.state();
        // The gain works on readings divided by 1 + SF.
        let noise = terms.noise / (1.0 + state.dvl_scale_factor).powi(2);
        let fix: FixPlan = plan(
            method,
            &self.geometry,
            ping.valid,
            &noise,
            Some(&prior_cov),
            &self.options.assumptions,
        )?;
        let exact = method == Method::VirtualBeamExact && fix.virtual_beams[0].is_some();
        let port = if method == Method::Information {
            self.options.information_port
        } else {
            InformationPort::Axes
        };
        let cross = exact.then_some(&p_xv);
        let innovation = aiding::loosely_coupled(&state, &self.geometry, &terms, &fix, port, cross);
        if exact {
            let virtual_count = fix.virtual_beams.iter().flatten().count();
            return self
                .filter
                .update_correlated(&innovation, 3 - virtual_count, Sensor::Beams)
                .map(Some);
        }
        self.filter.update(&innovation, Sensor::Beams).map(Some)
    }
}

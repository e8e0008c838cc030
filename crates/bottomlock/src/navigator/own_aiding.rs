//! The step of the event loop for a method from outside the kernel.

use super::{BeamAiding, Navigator};
use crate::aiding;
use crate::aiding::Innovation;
use crate::dvl::geometry::BeamSample;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::filter::report::{Sensor, UpdateReport};
use crate::navigator::own_method::{OwnMethod, PingBeams, PingPrior};

/// Checks that a method from outside the kernel, which sees the beams as stated, is not asked to estimate their mounting.
pub(super) fn check(aiding: BeamAiding, options: &Options) -> Result<(), NavError> {
    let calibration = &options.calibration;
    if matches!(aiding, BeamAiding::Own(_)) && !calibration.is_off() {
        return Err(NavError::OutOfRange {
            field: "calibration",
            value: calibration
                .mounting_sd_rad
                .into_iter()
                .fold(calibration.clock_sd_s, f64::max),
            expected: "0 (none) with a method of one's own, which sees the beams as stated",
        });
    }
    Ok(())
}

impl Navigator {
    /// What the method makes of a ping.
    ///
    /// # Errors
    /// As [`OwnMethod::innovation`].
    pub(super) fn own_innovation(&mut self, own: OwnMethod, ping: &BeamSample) -> Result<Innovation, NavError> {
        let (geometry, filter) = (&self.geometry, &mut self.filters.measurements_only);
        let (terms, omega_tp_p_radps) =
            filter.with_motion(|motion| (aiding::beam_terms(motion, geometry, ping), motion.rate_tp()));
        let covariance = filter.propagated_covariance();
        let beams = PingBeams {
            ping,
            geometry,
            terms: &terms,
        };
        let prior = PingPrior {
            state: &filter.state(),
            covariance: &covariance,
            omega_tp_p_radps,
        };
        own.innovation(&beams, &prior)
    }

    /// The update with what the method makes of a ping.
    ///
    /// # Errors
    /// As [`OwnMethod::innovation`] and [`crate::filter::Eskf::update`].
    pub(super) fn aid_by_own(&mut self, own: OwnMethod, ping: &BeamSample) -> Result<UpdateReport, NavError> {
        let innovation = self.own_innovation(own, ping)?;
        self.filters.measurements_only.update(&innovation, Sensor::Beams)
    }
}

//! What a push reports of measurements and inertial readings, and whether it corrects an earlier report.

use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::mechanisation::ImuFault;

/// What became of a measurement or of an inertial reading.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// An update with a measurement, or with an assumption on the motion.
    Update(Box<UpdateReport>),
    /// An inertial reading that was rejected.
    Rejected {
        /// Its time, ns.
        time_ns: i64,
        /// Why.
        fault: ImuFault,
    },
}

/// Whether a finding corrects an earlier report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Nothing was reported of it before.
    New,
    /// It replaces what was reported, which a late measurement has changed.
    Revised,
}

/// A finding and whether it corrects an earlier report.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// The finding.
    pub finding: Finding,
    /// How it stands.
    pub standing: Standing,
}

impl Notice {
    /// The name of the sensor; the report, which of an inertial reading has no rows; and why that was rejected, else nothing.
    #[must_use]
    pub fn parts(&self) -> (&'static str, UpdateReport, Option<String>) {
        match &self.finding {
            Finding::Update(report) => (report.sensor.name(), **report, None),
            Finding::Rejected { time_ns, fault } => {
                let mut report = UpdateReport::empty(Sensor::Beams, *time_ns);
                report.verdict = Verdict::Rejected;
                ("imu", report, Some(fault.to_string()))
            }
        }
    }
}

/// Time of validity, and what it is of: at one time there is at most one finding of each sensor.
pub(super) type FindingKey = (i64, Option<Sensor>);

impl Finding {
    pub(super) fn key(&self) -> FindingKey {
        match self {
            Self::Update(report) => (report.time_ns, Some(report.sensor)),
            Self::Rejected { time_ns, .. } => (*time_ns, None),
        }
    }

    /// Whether both say the same; weights of lost beams, which are NaN, are the same.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Update(one), Self::Update(two)) => {
                let bits = |report: &UpdateReport| report.beam_weight.map(|weight| weight.map(f64::to_bits));
                let unweighted = |report: &UpdateReport| UpdateReport {
                    beam_weight: None,
                    ..*report
                };
                bits(one) == bits(two) && unweighted(one) == unweighted(two)
            }
            _ => self == other,
        }
    }
}

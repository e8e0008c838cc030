//! What became of a measurement.

use nalgebra::{SMatrix, SVector};

use crate::aiding::MAX_ROWS;
use crate::dvl::geometry::MAX_BEAMS;
use crate::dvl::partial::PartialMethod;

pub use crate::aiding::registry::Sensor;

/// What became of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// All rows were used.
    Accepted,
    /// The gate rejected some rows (bit per row) and the others were used.
    AcceptedInPart {
        /// Bit k is set where row k was rejected.
        rejected_rows: u8,
    },
    /// The gate rejected the whole.
    Rejected,
    /// It carried no information: no row to use.
    NoInformation,
}

/// What a method that chooses has chosen at a ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// Where surge, sway and heave come from; none where a component is not solved.
    Components([Option<PartialMethod>; 3]),
    /// Which filter leads.
    Method {
        /// Its place in [`crate::navigator::SELECTOR_METHODS`].
        method: usize,
        /// The reason.
        reason: SelectionReason,
        /// Hausman's statistic of the assumption that decided.
        statistic: f64,
        /// What it was compared with.
        threshold: f64,
    },
}

/// SelectionReason a filter leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SelectionReason {
    /// No assumption adds anything to the beams.
    NoGain,
    /// It knows the velocity best, and the beams do not contradict it.
    SmallestVariance,
    /// The beams contradict every assumption that would add to them.
    BeamsContradict,
}

/// The record of one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpdateReport {
    /// Which sensor.
    pub sensor: Sensor,
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Number of rows.
    pub rows: usize,
    /// Degrees of freedom of the normalised innovation squared.
    pub degrees: usize,
    /// Innovation.
    pub residual: SVector<f64, MAX_ROWS>,
    /// Its covariance S.
    pub covariance: SMatrix<f64, MAX_ROWS, MAX_ROWS>,
    /// Normalised innovation squared zᵀS⁻¹z of all rows.
    pub nis: f64,
    /// What the gate compared it with (infinite without a joint gate).
    pub threshold: f64,
    /// What became of it.
    pub verdict: Verdict,
    /// By what the covariance of the inertial states was multiplied after it, where the gate had refused one fix too many.
    pub inflation: Option<f64>,
    /// What was chosen, where the method chooses.
    pub choice: Option<Choice>,
    /// Weight of each beam where outliers are looked for: 0 for one that was taken out, NaN for one that was lost.
    pub beam_weight: Option<[f64; MAX_BEAMS]>,
}

impl UpdateReport {
    pub(crate) fn empty(sensor: Sensor, time_ns: i64) -> Self {
        Self {
            sensor,
            time_ns,
            rows: 0,
            degrees: 0,
            residual: SVector::zeros(),
            covariance: SMatrix::zeros(),
            nis: 0.0,
            threshold: f64::INFINITY,
            verdict: Verdict::NoInformation,
            inflation: None,
            choice: None,
            beam_weight: None,
        }
    }

    /// True where the measurement, or a part of it, corrected the state.
    #[must_use]
    pub fn was_used(&self) -> bool {
        matches!(self.verdict, Verdict::Accepted | Verdict::AcceptedInPart { .. })
    }
}

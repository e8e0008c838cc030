//! Report of one measurement update.

use nalgebra::{SMatrix, SVector};

use crate::aiding::MAX_ROWS;
use crate::dvl::geometry::MAX_BEAMS;
use crate::dvl::partial::PartialMethod;

pub use crate::aiding::registry::Sensor;

/// Outcome of the gate for one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// All rows were used.
    Accepted,
    /// The gate rejected some rows; the others were used.
    AcceptedInPart {
        /// Bit k is set where row k was rejected.
        rejected_rows: u8,
    },
    /// The gate rejected all rows.
    Rejected,
    /// The measurement has no row.
    NoInformation,
    /// A yaw near the vertical, where it is no linear function of the attitude error; it was not used.
    Withheld,
}

/// Method that surge, sway and heave come from at one ping; `None` for a component that is not solved.
pub type Choice = [Option<PartialMethod>; 3];

/// Report of one measurement update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpdateReport {
    /// Sensor.
    pub sensor: Sensor,
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Number of rows.
    pub rows: usize,
    /// Degrees of freedom of the NIS.
    pub degrees: usize,
    /// Innovation z, in the unit of each row.
    pub residual: SVector<f64, MAX_ROWS>,
    /// Innovation covariance S.
    pub covariance: SMatrix<f64, MAX_ROWS, MAX_ROWS>,
    /// Normalised innovation squared (NIS) zᵀS⁻¹z of all rows.
    pub nis: f64,
    /// Threshold of the NIS; infinite without a joint gate.
    pub threshold: f64,
    /// Outcome of the gate.
    pub verdict: Verdict,
    /// Factor by which variances grew after consecutive rejections, or by the mean of what was accepted.
    pub inflation: Option<f64>,
    /// Part of what those rejections showed that was charged to slow errors of the sensor; the rest to inertial states.
    pub charged_to_sensor: f64,
    /// True where the velocity was so uncertain before the update that the linear model no longer holds in the tangent
    /// frame ([`LINEAR_RANGE_MPS`](crate::filter::linear_range::LINEAR_RANGE_MPS)).
    pub is_beyond_linear_range: bool,
    /// Selection, of the covariance selector `elc`.
    pub choice: Option<Choice>,
    /// Weight of each beam, with outlier detection on: 0 for a rejected beam, NaN for a lost one.
    pub beam_weight: Option<[f64; MAX_BEAMS]>,
}

impl UpdateReport {
    /// A report without rows.
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
            charged_to_sensor: 0.0,
            is_beyond_linear_range: false,
            choice: None,
            beam_weight: None,
        }
    }

    /// Returns true if at least one row corrected the state.
    #[must_use]
    pub fn was_used(&self) -> bool {
        matches!(self.verdict, Verdict::Accepted | Verdict::AcceptedInPart { .. })
    }
}

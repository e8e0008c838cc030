//! Record of a ping by method.

use crate::dvl::geometry::{BeamSample, MAX_BEAMS};
use crate::filter::report::{Choice, UpdateReport, Verdict};

/// Outcome of a ping.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum FixStatus {
    /// No filter used it: it came before the start, or the method uses no beams.
    #[default]
    None,
    /// All of it was used.
    Accepted,
    /// The gate rejected some rows.
    AcceptedInPart,
    /// The gate rejected it.
    Rejected,
    /// The method could make nothing of the beams that were left.
    NoInformation,
}

/// The names of [`FixStatus`] in order.
pub const FIX_STATUS: [&str; 5] = ["none", "accepted", "accepted_in_part", "rejected", "no_information"];

/// Record of one ping by one method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PingRecord {
    /// Its outcome.
    pub status: FixStatus,
    /// Normalised innovation squared; NaN without a fix.
    pub nis: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Innovation of each beam, m/s; NaN where the beam was not a row of the update.
    pub innovation_mps: [f64; MAX_BEAMS],
    /// Its standard deviation by the filter, m/s.
    pub innovation_sd_mps: [f64; MAX_BEAMS],
    /// Weight of each beam: 1 where its reading counted in full, less where it was weighted, 0 where it was taken out, NaN where it
    /// was lost or reached no filter.
    pub beam_weight: [f64; MAX_BEAMS],
    /// The selection, for the selector of the paper.
    pub choice: Option<Choice>,
}

impl Default for PingRecord {
    fn default() -> Self {
        Self {
            status: FixStatus::None,
            nis: f64::NAN,
            degrees: 0,
            innovation_mps: [f64::NAN; MAX_BEAMS],
            innovation_sd_mps: [f64::NAN; MAX_BEAMS],
            beam_weight: [f64::NAN; MAX_BEAMS],
            choice: None,
        }
    }
}

impl PingRecord {
    pub(super) fn new(report: &UpdateReport, ping: &BeamSample, rows_are_beams: bool) -> Self {
        let mut record = Self {
            status: match report.verdict {
                Verdict::Accepted => FixStatus::Accepted,
                Verdict::AcceptedInPart { .. } => FixStatus::AcceptedInPart,
                Verdict::Rejected => FixStatus::Rejected,
                Verdict::NoInformation | Verdict::Withheld => FixStatus::NoInformation,
            },
            choice: report.choice,
            ..Self::default()
        };
        if report.rows > 0 {
            record.nis = report.nis;
            record.degrees = report.degrees;
        }
        match report.beam_weight {
            Some(weight) => record.beam_weight = weight,
            None => ping.valid.iter().for_each(|beam| record.beam_weight[beam] = 1.0),
        }
        if rows_are_beams {
            let left = ping.valid.iter().filter(|&beam| record.beam_weight[beam] > 0.0);
            let left: Vec<usize> = left.collect();
            for (row, &beam) in left.iter().enumerate().take(report.rows) {
                record.innovation_mps[beam] = report.residual[row];
                record.innovation_sd_mps[beam] = report.covariance[(row, row)].sqrt();
            }
        }
        record
    }
}

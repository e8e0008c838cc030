//! Reports of the last push: innovation, its covariance, NIS, verdict.

use std::ffi::c_char;

use bottomlock::aiding::MAX_ROWS;
use bottomlock::dvl::fix_row::source_code;
use bottomlock::dvl::geometry::MAX_BEAMS;
use bottomlock::filter::report::Verdict as Outcomes;
use bottomlock::navigator::{Notice, Standing};

use crate::calls::{Failure, Status, call};
use crate::names::c_name;
use crate::navigator::Navigator;
use crate::pointers::{at, put};

/// Most rows of a measurement.
pub const ROWS: usize = 8;
/// Most beams of an instrument.
pub const BEAMS: usize = 8;
/// Letters of the reason of a rejected inertial reading, with the NUL at its end.
pub const REASON: usize = 160;
const _: () = assert!(ROWS == MAX_ROWS && BEAMS == MAX_BEAMS);

/// What became of a measurement or of an inertial reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum Verdict {
    /// All rows were used.
    Accepted = 0,
    /// The gate rejected some rows; the others were used.
    AcceptedInPart = 1,
    /// It was not used.
    Rejected = 2,
    /// It had no row.
    NoInformation = 3,
    /// A yaw near the vertical; it was not used.
    Withheld = 4,
}

/// Report of one measurement, or of an inertial reading that was rejected.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Report {
    /// Name of the sensor: "beams", "depth", "imu" and so on. It lives as long as the library.
    pub sensor: *const c_char,
    /// Time of validity, ns.
    pub time_ns: i64,
    /// What became of it.
    pub verdict: Verdict,
    /// 1 where it corrects an earlier report, which a late reading has changed.
    pub revised: u8,
    /// 1 where the velocity was so uncertain before the update that the linear model no longer holds.
    pub beyond_linear_range: u8,
    /// 1 for every row that was rejected.
    pub rejected_rows: [u8; ROWS],
    /// Number of rows; further entries are 0.
    pub rows: u32,
    /// Degrees of freedom of the NIS.
    pub degrees: u32,
    /// Innovation, in the unit of each row.
    pub residual: [f64; ROWS],
    /// Its covariance, row by row: entry (i, j) is `covariance[i][j]`.
    pub covariance: [[f64; ROWS]; ROWS],
    /// Normalised innovation squared.
    pub nis: f64,
    /// Its threshold; infinite without one.
    pub threshold: f64,
    /// Factor by which variances grew after rejections, or by the mean of what was accepted; 1 for none.
    pub inflation: f64,
    /// Part of what those rejections showed that was charged to slow errors of the sensor, 0 to 1; the rest to inertial states.
    pub charged_to_sensor: f64,
    /// 1 where `beam_weight` is set.
    pub has_beam_weight: u8,
    /// Weight of each beam with outlier detection: 0 for a rejected beam, NaN for a lost one.
    pub beam_weight: [f64; BEAMS],
    /// Methods that surge, sway and heave come from with the selector of the paper, by the codes of `bl_velocity`; 0 for none.
    pub component_source: [u8; 3],
    /// Why an inertial reading was rejected; empty otherwise.
    pub reason: [c_char; REASON],
}

impl Report {
    fn of(notice: &Notice) -> Self {
        let (sensor, update, why) = notice.parts();
        let (verdict, rejected) = match update.verdict {
            Outcomes::Accepted => (Verdict::Accepted, 0),
            Outcomes::AcceptedInPart { rejected_rows } => (Verdict::AcceptedInPart, rejected_rows),
            Outcomes::Rejected => (Verdict::Rejected, u8::MAX),
            Outcomes::NoInformation => (Verdict::NoInformation, 0),
            Outcomes::Withheld => (Verdict::Withheld, 0),
        };
        let rows = update.rows;
        let mut reason = [0; REASON];
        for (letter, byte) in reason[..REASON - 1].iter_mut().zip(why.unwrap_or_default().bytes()) {
            *letter = byte as c_char;
        }
        let mut report = Self {
            sensor: c_name(sensor),
            time_ns: update.time_ns,
            verdict,
            revised: u8::from(notice.standing != Standing::New),
            beyond_linear_range: u8::from(update.is_beyond_linear_range),
            rejected_rows: std::array::from_fn(|i| u8::from(i < rows) & (rejected >> i)),
            rows: rows as u32,
            degrees: update.degrees as u32,
            residual: std::array::from_fn(|i| if i < rows { update.residual[i] } else { 0.0 }),
            covariance: [[0.0; ROWS]; ROWS],
            nis: update.nis,
            threshold: update.threshold,
            inflation: update.inflation.unwrap_or(1.0),
            charged_to_sensor: update.charged_to_sensor,
            has_beam_weight: u8::from(update.beam_weight.is_some()),
            beam_weight: update.beam_weight.unwrap_or([0.0; BEAMS]),
            component_source: update.choice.unwrap_or_default().map(source_code),
            reason,
        };
        for (i, row) in report.covariance[..rows].iter_mut().enumerate() {
            row[..rows].copy_from_slice(&update.covariance.row(i).transpose().as_slice()[..rows]);
        }
        report
    }
}

/// Number of reports of the last push: of the measurements that it processed, and of those before whose reports it changed. 0 for
/// an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_report_count(navigator: *const Navigator) -> usize {
    call!(count, Ok(at("navigator", navigator)?.locked()?.notices.len()))
}

/// A report of the last push by its number from 0; the order is that in which they were processed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_report_get(navigator: *const Navigator, number: usize, report: *mut Report) -> Status {
    call!(status, {
        let held = at("navigator", navigator)?.locked()?;
        let notice = held.notices.get(number).ok_or_else(|| {
            let count = held.notices.len();
            Failure::new(
                Status::NotAvailable,
                format!("report {number} of {count}: they are counted from 0"),
            )
        })?;
        put("report", report, Report::of(notice))
    })
}

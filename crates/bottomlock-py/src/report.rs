//! What a push tells, as Python sees it.

use bottomlock::dvl::fix_row::source_code;
use bottomlock::filter::report::{Choice, Verdict};
use bottomlock::navigator::{Notice, Standing};

use crate::prelude::*;
use crate::results::entries;

/// What became of a measurement, or of an inertial reading that was rejected.
///
/// `sensor`, `time_ns`: what was measured, and its time of validity.
/// `residual` (m,), `covariance` (m, m): measured minus expected, and the covariance of that, by rows.
/// `degrees`, `nis`, `threshold`: normalised innovation squared, its degrees of freedom, and what the gate accepts.
/// `verdict`: "accepted", "accepted_in_part", "rejected", "no_information" or "withheld".
/// `revised`: whether it replaces an earlier report, since data came late.
/// `reason`: why an inertial reading was rejected; else None.
/// `inflation`: factor on variances after a row of rejections, or by the mean of what was accepted; None without one.
/// `charged_to_sensor`: part of what those rejections showed that was charged to slow errors of the sensor, 0 to 1.
/// `beyond_linear_range`: whether the correction is larger than linearisation allows.
/// `rejected_rows` (m,): rows of a measurement accepted in part that were not used.
/// `beam_weight` (beams,): weights of a robust update; None without one.
/// `choice`: of the selector of the paper: sources of surge, sway and heave; None without one.
#[pyclass(module = "bottomlock", frozen, get_all)]
pub struct Report {
    sensor: &'static str,
    time_ns: i64,
    residual: Py<PyAny>,
    covariance: Py<PyAny>,
    degrees: usize,
    nis: f64,
    threshold: f64,
    verdict: &'static str,
    revised: bool,
    reason: Option<String>,
    inflation: Option<f64>,
    charged_to_sensor: f64,
    beyond_linear_range: bool,
    rejected_rows: Py<PyAny>,
    beam_weight: Option<Py<PyAny>>,
    choice: Option<Py<PyDict>>,
}

#[pymethods]
impl Report {
    fn __repr__(&self) -> String {
        let Self {
            sensor,
            time_ns,
            verdict,
            ..
        } = self;
        match &self.reason {
            Some(reason) => format!("<Report of {sensor} at {time_ns} ns: {verdict}, {reason}>"),
            None => format!(
                "<Report of {sensor} at {time_ns} ns: {verdict}, NIS {:.2} of {}>",
                self.nis, self.degrees
            ),
        }
    }
}

impl Report {
    /// The report of what a push tells, for an instrument with `beams` beams.
    pub fn of(py: Python<'_>, notice: &Notice, beams: usize) -> PyResult<Self> {
        let (sensor, report, reason) = notice.parts();
        let (verdict, rejected) = match report.verdict {
            Verdict::Accepted => ("accepted", 0),
            Verdict::AcceptedInPart { rejected_rows } => ("accepted_in_part", rejected_rows),
            Verdict::Rejected => ("rejected", u8::MAX),
            Verdict::NoInformation => ("no_information", 0),
            Verdict::Withheld => ("withheld", 0),
        };
        let rows = report.rows;
        let entry = |k: usize| report.covariance[(k / rows, k % rows)];
        let flags = (0..rows).map(|k| rejected & (1 << k) != 0);
        let weight = report
            .beam_weight
            .map(|weight| entries(py, &[beams], weight.into_iter().take(beams)));
        let choice = report.choice.map(|choice| choice_dict(py, &choice));
        Ok(Self {
            sensor,
            time_ns: report.time_ns,
            residual: entries(py, &[rows], report.residual.iter().copied().take(rows))?.into(),
            covariance: entries(py, &[rows, rows], (0..rows * rows).map(entry))?.into(),
            degrees: report.degrees,
            nis: report.nis,
            threshold: report.threshold,
            verdict,
            revised: notice.standing != Standing::New,
            reason,
            inflation: report.inflation,
            charged_to_sensor: report.charged_to_sensor,
            beyond_linear_range: report.is_beyond_linear_range,
            rejected_rows: entries(py, &[rows], flags)?.into(),
            beam_weight: weight.transpose()?.map(Into::into),
            choice: choice.transpose()?.map(Into::into),
        })
    }
}

/// The dict of a selection: source codes of surge, sway and heave.
fn choice_dict<'py>(py: Python<'py>, choice: &Choice) -> Dict<'py> {
    let out = PyDict::new(py);
    for (axis, source) in ["surge", "sway", "heave"].into_iter().zip(choice) {
        out.set_item(axis, source_code(*source))?;
    }
    Ok(out)
}

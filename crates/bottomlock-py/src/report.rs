//! Update reports as Python dicts.

use bottomlock::filter::report::{Choice, SelectionReason, UpdateReport, Verdict};
use bottomlock::navigator::{Finding, Notice, SELECTOR_METHODS, Standing};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::imu_faults::rejected_report;
use crate::velocity::source_code;

/// The dict of what a push tells, for an instrument with `beams` beams.
pub fn notice_dict<'py>(py: Python<'py>, notice: &Notice, beams: usize) -> PyResult<Bound<'py, PyDict>> {
    let out = match &notice.finding {
        Finding::Update(report) => report_dict(py, report, beams)?,
        Finding::Rejected { time_ns, fault } => rejected_report(py, *time_ns, fault)?,
    };
    out.set_item("revised", notice.standing != Standing::New)?;
    if notice.standing == Standing::Withdrawn {
        out.set_item("verdict", "withdrawn")?;
    }
    Ok(out)
}

/// The dict of a report, for an instrument with `beams` beams.
fn report_dict<'py>(py: Python<'py>, report: &UpdateReport, beams: usize) -> PyResult<Bound<'py, PyDict>> {
    let (verdict, rejected) = match report.verdict {
        Verdict::Accepted => ("accepted", 0),
        Verdict::AcceptedInPart { rejected_rows } => ("accepted_in_part", rejected_rows),
        Verdict::Rejected => ("rejected", u8::MAX),
        Verdict::NoInformation => ("no_information", 0),
        Verdict::Withheld => ("withheld", 0),
    };
    let rows = report.rows;
    let covariance = (0..rows * rows)
        .map(|k| report.covariance[(k / rows, k % rows)])
        .collect();
    let out = PyDict::new(py);
    out.set_item("sensor", report.sensor.name())?;
    out.set_item("time_ns", report.time_ns)?;
    out.set_item(
        "residual",
        array::<f64>(py, report.residual.as_slice()[..rows].to_vec(), &[rows])?,
    )?;
    out.set_item("covariance", array::<f64>(py, covariance, &[rows, rows])?)?;
    out.set_item("degrees", report.degrees)?;
    out.set_item("nis", report.nis)?;
    out.set_item("threshold", report.threshold)?;
    out.set_item("verdict", verdict)?;
    out.set_item("reason", py.None())?;
    out.set_item("inflation", report.inflation)?;
    out.set_item("beyond_linear_range", report.is_beyond_linear_range)?;
    let flags = (0..rows).map(|k| rejected & (1 << k) != 0).collect();
    out.set_item("rejected_rows", array::<bool>(py, flags, &[rows])?)?;
    let weight = report
        .beam_weight
        .map(|weight| array::<f64>(py, weight[..beams].to_vec(), &[beams]));
    out.set_item("beam_weight", weight.transpose()?)?;
    out.set_item(
        "choice",
        report.choice.map(|choice| choice_dict(py, &choice)).transpose()?,
    )?;
    Ok(out)
}

/// The dict of a selection: source codes of surge, sway and heave, or the selected method with its reason.
fn choice_dict<'py>(py: Python<'py>, choice: &Choice) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    match choice {
        Choice::Components(sources) => {
            for (axis, source) in ["surge", "sway", "heave"].into_iter().zip(sources) {
                out.set_item(axis, source.map_or(0, source_code))?;
            }
        }
        Choice::Method {
            method,
            reason,
            statistic,
            threshold,
        } => {
            let reason = match reason {
                SelectionReason::NoGain => "no_gain",
                SelectionReason::SmallestVariance => "smallest_variance",
                SelectionReason::BeamsContradict => "beams_contradict",
            };
            out.set_item("method", SELECTOR_METHODS[*method].0)?;
            out.set_item("reason", reason)?;
            out.set_item("statistic", *statistic)?;
            out.set_item("threshold", *threshold)?;
        }
    }
    Ok(out)
}

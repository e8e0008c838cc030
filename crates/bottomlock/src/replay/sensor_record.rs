//! What a method made of the measurements of each sensor, in numbers.

use std::collections::BTreeMap;

use crate::filter::report::{Sensor, UpdateReport, Verdict};

/// Numbers of the measurements of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorRecord {
    /// Measurements that had a row.
    pub measured: usize,
    /// Those of which the gate rejected every row.
    pub rejected: usize,
    /// Those that were left out near the vertical.
    pub left_out: usize,
    /// How often the covariance grew after rejections in a row.
    pub inflated: usize,
    /// Sum of the NIS over all measurements, rejected ones among them.
    pub nis: f64,
    /// Sum of its degrees of freedom.
    pub degrees: usize,
}

/// The records of the sensors that measured.
pub type SensorRecords = BTreeMap<Sensor, SensorRecord>;

/// Adds a report to the record of its sensor.
pub(super) fn count(records: &mut SensorRecords, report: &UpdateReport) {
    if report.verdict == Verdict::NoInformation {
        return;
    }
    let record = records.entry(report.sensor).or_default();
    record.measured += 1;
    record.rejected += usize::from(report.verdict == Verdict::Rejected);
    record.inflated += usize::from(report.inflation.is_some());
    if report.verdict == Verdict::Withheld {
        record.left_out += 1;
        return;
    }
    record.nis += report.nis;
    record.degrees += report.degrees;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rejected reading counts in the NIS; one that was left out near the vertical, or had no row, does not.
    #[test]
    fn reports_are_counted_by_sensor() {
        let report = |sensor, verdict, inflation| UpdateReport {
            nis: 3.0,
            degrees: 2,
            inflation,
            verdict,
            ..UpdateReport::empty(sensor, 0)
        };
        let mut records = SensorRecords::new();
        for report in [
            report(Sensor::Depth, Verdict::Accepted, None),
            report(Sensor::Heading, Verdict::Withheld, None),
            report(Sensor::Depth, Verdict::Rejected, Some(2.0)),
            report(Sensor::Beams, Verdict::NoInformation, None),
            report(Sensor::Depth, Verdict::AcceptedInPart { rejected_rows: 1 }, None),
        ] {
            count(&mut records, &report);
        }
        let depth = SensorRecord {
            measured: 3,
            rejected: 1,
            left_out: 0,
            inflated: 1,
            nis: 9.0,
            degrees: 6,
        };
        let heading = SensorRecord {
            measured: 1,
            left_out: 1,
            ..SensorRecord::default()
        };
        assert_eq!(
            records.into_iter().collect::<Vec<_>>(),
            [(Sensor::Depth, depth), (Sensor::Heading, heading)]
        );
    }
}

//! The verdict of the gate on either side of its threshold.

use super::*;
use crate::aiding::depth::depth;
use crate::filter::options::Options;
use crate::frames::Vec3;
use crate::model::Model;
use crate::state::NavState;

/// The verdict on a depth whose residual has the given square over its variance; σ of the state is 2 m, of the sensor 0.5 m.
fn verdict(gate: Gate, nis: f64) -> (Verdict, f64) {
    let options = Options {
        gate,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let depth_m = (nis * 4.25).sqrt();
    let innovation = depth(&filter.state(), depth_m, 0.5, &Vec3::zeros());
    let report = filter.update(&innovation, Sensor::Depth).unwrap();
    (report.verdict, report.nis)
}

/// The tabulated 99 % quantile of chi-squared with one degree of freedom, 6.6349, and the three sigma of the papers.
#[test]
fn the_gate_begins_at_its_threshold() {
    for (gate, threshold) in [(Gate::Joint { probability: 0.99 }, 6.634_896_6), (Gate::PerRow, 9.0)] {
        for (factor, expected) in [(0.999, Verdict::Accepted), (1.001, Verdict::Rejected)] {
            let (verdict, nis) = verdict(gate, factor * threshold);
            assert_eq!(verdict, expected, "{gate:?}, {factor} of the threshold");
            assert!((nis / (factor * threshold) - 1.0).abs() < 1e-12);
        }
    }
    assert_eq!(verdict(Gate::Off, 1e6).0, Verdict::Accepted);
}

//! Which filter the selector takes, by hand: limits of the test are tabulated quantiles of chi-squared at 99.73 %.

use super::*;
use crate::dvl::geometry::Janus;
use crate::filter::slip_test::Alarm;
use crate::filter::water_block::WaterBlock;
use crate::frames::Vec3;
use crate::navigator::{Aiding, NavigatorSet};
use crate::replay::tests::{Recording, steady_turn};

/// σ of each axis of the velocity on the beams alone, m/s, and of one that an assumption improves.
const SD: f64 = 0.5;
const REDUCED: f64 = 0.1;
/// The difference of the variances, with the floor.
const REDUCTION: f64 = SD * SD - REDUCED * REDUCED + 0.005 * 0.005;

/// Velocity of a member, m/s, with its standard deviations.
type Member = ([f64; 3], [f64; 3]);
/// No assumption changes anything.
const ALONE: Member = ([2.0, 0.0, 0.0], [SD; 3]);

/// A bank of such members; the attitude is known to `attitude_sd_rad`.
fn bank(members: [Member; 3], attitude_sd_rad: f64) -> Bank {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let options = Options::default();
    let mut bank = Bank::new(NavState::at_rest(0), &geometry, &Model::table_2(), &options).unwrap();
    for (k, (velocity_mps, velocity_sd_mps)) in members.into_iter().enumerate() {
        let (mut state, mut model) = (NavState::at_rest(0), Model::table_2());
        state.velocity_p_mps = Vec3::from_array(velocity_mps);
        model.initial.velocity_sd_mps = velocity_sd_mps;
        model.initial.attitude_sd_rad = [attitude_sd_rad; 3];
        bank.members[k] = Navigator::new(state, geometry.clone(), SELECTOR_METHODS[k].1, &model, &options).unwrap();
    }
    bank
}

/// A member that is off by `squares` of Hausman's statistic in each of the first `axes` of sway, heave and surge, which it has
/// improved.
fn off_by(squares: f64, axes: usize) -> Member {
    let (mut velocity_mps, mut sd_mps) = ALONE;
    for axis in [1, 2, 0].into_iter().take(axes) {
        velocity_mps[axis] += (squares * REDUCTION).sqrt();
        sd_mps[axis] = REDUCED;
    }
    (velocity_mps, sd_mps)
}

/// The selected method, the reason, the statistic and the threshold.
fn selected(bank: &mut Bank) -> (usize, SelectionReason, f64, f64) {
    let choice = bank.select();
    let Choice::Method {
        method,
        reason,
        statistic,
        threshold,
    } = choice
    else {
        panic!("{choice:?}")
    };
    assert_eq!(bank.selected, method);
    (method, reason, statistic, threshold)
}

const KNOWN: f64 = 1e-3;
use SelectionReason::{BeamsContradict, NoGain, SmallestVariance};

/// Of one, two and three directions with less variance, just within the quantile and just beyond it: 8.9999, 11.829, 14.156. Each
/// is less than the next number of degrees would allow.
#[test]
fn the_statistic_is_tested_with_as_many_degrees_as_directions() {
    for (degrees, quantile) in [(1, 8.99986), (2, 11.82901), (3, 14.15625)] {
        for (factor, expected) in [(0.999, (1, SmallestVariance)), (1.001, (0, BeamsContradict))] {
            let squares = factor * quantile / degrees as f64;
            let mut bank = bank([ALONE, off_by(squares, degrees), ALONE], KNOWN);
            let (method, reason, statistic, threshold) = selected(&mut bank);
            assert_eq!((method, reason), expected, "{degrees} degrees, {factor}");
            assert!((statistic - factor * quantile).abs() < 1e-9, "{statistic}");
            assert!((threshold - quantile).abs() < 1e-4, "{threshold}");
        }
    }
}

/// Beyond the linear range the beams contradict nothing, wherever the assumption leads.
#[test]
fn nothing_is_contradicted_beyond_the_linear_range() {
    for (attitude_sd_rad, expected) in [(KNOWN, (0, BeamsContradict)), (1.0, (1, SmallestVariance))] {
        let mut bank = bank([ALONE, off_by(100.0, 1), ALONE], attitude_sd_rad);
        let (method, reason, statistic, _) = selected(&mut bank);
        assert_eq!((method, reason), expected);
        assert!((statistic - 100.0).abs() < 1e-9);
    }
}

/// Of those that are not contradicted the one with the smallest variance, whichever comes first; without a gain the beams alone.
/// Statistic and threshold are those of the selected one, or of the last that is contradicted.
#[test]
fn the_smallest_variance_is_selected() {
    let (small, smaller, wrong) = (off_by(1.0, 1), off_by(1.0, 2), off_by(20.0, 2));
    let (one, two) = (8.99986, 11.82901);
    let cases = [
        ([small, smaller], (2, SmallestVariance, 2.0, two)),
        ([smaller, small], (1, SmallestVariance, 2.0, two)),
        ([small, small], (1, SmallestVariance, 1.0, one)),
        ([small, wrong], (1, SmallestVariance, 1.0, one)),
        ([wrong, small], (2, SmallestVariance, 1.0, one)),
        ([wrong, ALONE], (0, BeamsContradict, 40.0, two)),
        ([wrong, off_by(30.0, 1)], (0, BeamsContradict, 30.0, one)),
        ([ALONE, ALONE], (0, NoGain, 0.0, 0.0)),
        ([(ALONE.0, [2.0 * SD; 3]), ALONE], (0, NoGain, 0.0, 0.0)),
    ];
    for ([first, second], expected) in cases {
        let (method, reason, statistic, threshold) = selected(&mut bank([ALONE, first, second], KNOWN));
        assert_eq!((method, reason), (expected.0, expected.1));
        assert!((statistic - expected.2).abs() < 1e-9, "{statistic}");
        assert!((threshold - expected.3).abs() < 1e-4, "{threshold}");
    }
}

/// After an alarm of a slip no filter is selected that assumes little sway over ground.
#[test]
fn a_vehicle_that_sways_has_no_weak_sway() {
    let (small, smaller) = (off_by(1.0, 1), off_by(1.0, 2));
    for (alarms, expected) in [(0, 1), (1, 2), (2, 2)] {
        let mut bank = bank([ALONE, smaller, small], KNOWN);
        let mut water = WaterBlock::new(&Options::default().water);
        (0..alarms).for_each(|_| water = water.widened([Some(Alarm::Larger), None]));
        bank.members[2].filters().start_constrained(water);
        assert_eq!(selected(&mut bank).0, expected, "{alarms} alarms");
    }
}

/// By hand: a sway difference of 0.3 m/s where the variance fell by 0.04 (m/s)²; surge, without reduction, is left
/// out.
#[test]
fn only_directions_with_variance_reduction_are_tested() {
    let reduction = Matrix3::from_diagonal(&Vector3::new(0.0, 0.04, -1e-9));
    let (statistic, degrees) = hausman(&Vector3::new(5.0, 0.3, 0.0), &reduction);
    assert_eq!(degrees, 1);
    assert!((statistic - 0.09 / 0.040_025).abs() < 1e-12);
    assert_eq!(hausman(&Vector3::zeros(), &Matrix3::zeros()), (0.0, 0));
    // The floor is (5 mm/s)².
    for (variance, expected) in [(2.4e-5, 0), (2.6e-5, 1)] {
        assert_eq!(
            hausman(&Vector3::x(), &(Matrix3::identity() * variance)).1,
            3 * expected
        );
    }
    // Along (0.6, 0.8, 0) alone, of which 0.5 m/s forwards and 0.1 m/s to starboard have 0.38 m/s.
    let along = Vector3::new(0.6, 0.8, 0.0);
    let (statistic, degrees) = hausman(&Vector3::new(0.5, 0.1, 9.0), &(along * along.transpose() * 0.04));
    assert_eq!(degrees, 1);
    assert!((statistic - 0.38 * 0.38 / 0.040_025).abs() < 1e-9, "{statistic}");
}

/// The water states are those of the selected filter; where that has none there is no answer, whatever the others estimate.
#[test]
fn the_water_is_that_of_the_selected_filter() {
    let mut bank = bank([ALONE; 3], KNOWN);
    for (k, (_, aiding)) in SELECTOR_METHODS.into_iter().enumerate() {
        bank.selected = k;
        let set = NavigatorSet::Consistent(Box::new(bank.clone()));
        let estimates = aiding == BeamAiding::SwayCurrent;
        assert_eq!(set.water().is_some(), estimates);
        assert_eq!(set.selected().filter().current().is_some(), estimates);
    }
}

/// The navigators at the end of a turn with all sensors, and their reports.
fn run(aiding: Aiding, turn: &Recording) -> (NavigatorSet, Vec<UpdateReport>) {
    let mut set = NavigatorSet::new(turn.start, &turn.geometry, aiding, &turn.model, &Options::default()).unwrap();
    let beams = turn.pings.iter().map(|ping| Event::Beams(*ping));
    let sensors = turn.sensors.iter().flatten().map(|one| Event::Aiding(*one));
    let mut events: Vec<_> = beams.chain(sensors).collect();
    events.sort_by_key(Event::time_ns);
    let mut reports = Vec::new();
    let mut events = events.into_iter().peekable();
    for sample in &turn.imu {
        while let Some(event) = events.next_if(|event| event.time_ns() <= sample.time_ns) {
            set.push(&event, &mut |report| reports.push(*report)).unwrap();
        }
        set.push(&Event::Imu(*sample), &mut |report| reports.push(*report))
            .unwrap();
    }
    (set, reports)
}

/// Every member is its method alone; the reports are those of the filter on the beams, and pings have a choice beside.
#[test]
fn members_are_the_methods_alone() {
    let turn = steady_turn(20);
    let (set, reports) = run(Aiding::Consistent, &turn);
    let NavigatorSet::Consistent(bank) = &set else {
        panic!("{set:?}")
    };
    for (k, (_, aiding)) in SELECTOR_METHODS.into_iter().enumerate() {
        let (alone, own) = run(Aiding::One(aiding), &turn);
        assert_eq!(bank.members[k].state(), alone.state());
        assert_eq!(bank.members[k].covariance(), alone.covariance());
        if k == 0 {
            let told = |report: &UpdateReport| (report.sensor, report.time_ns, report.nis, report.verdict);
            let ([got, expected], beams) = ([&reports, &own].map(|all| all.iter().map(told)), Sensor::Beams);
            assert!(got.eq(expected) && own.iter().any(|report| report.sensor != beams));
        }
    }
    for report in reports {
        assert_eq!(report.choice.is_some(), report.sensor == Sensor::Beams, "{report:?}");
    }
    assert!(bank.selected > 0);
}

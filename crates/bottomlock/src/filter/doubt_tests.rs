//! Doubt by hand: a filter with σ 0.05 m/s that velocities of σ 0.05 m/s contradict.

use super::*;
use crate::testing::*;

const S: i64 = 1_000_000_000;

/// With the third of agreeing rejections, after a velocity was accepted.
fn filter() -> Eskf {
    let options = Options {
        gate: Gate::Joint,
        inflate_after_rejections: 3,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    filter.measured.velocity_ns = Some(0);
    filter
}

/// A reading at a time; the verdict, and the factor of an inflation.
fn judged(filter: &mut Eskf, at_s: i64, sensor: Sensor, of: impl Fn(&Eskf) -> Innovation) -> (Verdict, Option<f64>) {
    filter.state.time_ns = at_s * S;
    let report = filter.update(&of(filter), sensor).unwrap();
    if report.verdict != Verdict::Rejected {
        filter.note_accepted(sensor);
        return (report.verdict, None);
    }
    let is_confirmed = sensor == Sensor::Velocity;
    let charge = filter.note_rejected(&of(filter), sensor, is_confirmed).unwrap();
    (report.verdict, charge.and_then(|charge| charge.factor))
}

/// A velocity, judged.
fn push(filter: &mut Eskf, at_s: i64, reading_mps: [f64; 3]) -> (Verdict, Option<f64>) {
    judged(filter, at_s, Sensor::Velocity, |filter| {
        let noise = Matrix3::identity() * 0.0025;
        velocity(&filter.state(), &Vec3::from_array(reading_mps), &noise)
    })
}

fn velocity_covariance(filter: &Eskf) -> Matrix3<f64> {
    filter.covariance().fixed_view::<3, 3>(VELOCITY, VELOCITY).into_owned()
}

/// The third reading 2 m/s off adds d dᵀ; those that follow change nothing until the first is 30 s old, and are then believed.
#[test]
fn the_covariance_holds_both_until_the_readings_are_believed() {
    let mut filter = filter();
    let (off, before) = ([0.0, 2.0, 0.0], velocity_covariance(&filter));
    for at_s in [1, 2] {
        assert_eq!(push(&mut filter, at_s, off), (Verdict::Rejected, None));
        assert_eq!(velocity_covariance(&filter), before);
    }
    for at_s in [3, 10, 30] {
        assert_eq!(push(&mut filter, at_s, off), (Verdict::Rejected, None));
        let added = velocity_covariance(&filter) - before;
        let expected = Vector3::y() * Vector3::y().transpose() * 4.0;
        assert!((added - expected).amax() < 1e-12, "{added}");
        assert_eq!(filter.state().velocity_p_mps.to_array(), [0.0; 3]);
    }
    let (verdict, factor) = push(&mut filter, 31, off);
    // By hand as for inflation: 4 / (0.0025 (1 + f)) = 3 + 4 / 2500.
    assert_eq!(verdict, Verdict::Rejected);
    assert!((factor.unwrap() / 532.0 - 1.0).abs() < 1e-2, "{factor:?}");
    assert!(!filter.run(Sensor::Velocity).is_held);
    assert_eq!(push(&mut filter, 31, off).0, Verdict::Accepted);
    assert!((filter.state().velocity_p_mps.to_array()[1] - 2.0).abs() < 0.01);
}

/// Velocities that contradict one that was accepted alone are believed with the second; those after two that were accepted 3 s apart
/// once they have lasted 3 s, whatever their number.
#[test]
fn velocities_are_believed_once_they_have_lasted_as_long_as_those_before() {
    for (accepted_s, believed_s) in [(vec![1], 3), (vec![1, 4], 8)] {
        let mut filter = filter();
        for &at_s in &accepted_s {
            assert_eq!(push(&mut filter, at_s, [0.0; 3]).0, Verdict::Accepted);
        }
        for at_s in accepted_s[accepted_s.len() - 1] + 1..=believed_s {
            let (verdict, factor) = push(&mut filter, at_s, [0.0, 2.0, 0.0]);
            assert_eq!(
                (verdict, factor.is_some()),
                (Verdict::Rejected, at_s == believed_s),
                "{at_s}"
            );
        }
        assert_eq!(push(&mut filter, believed_s, [0.0, 2.0, 0.0]).0, Verdict::Accepted);
    }
}

/// A reading nearer to the filter than to the others is used, and ends the doubt; where three such readings follow from the other
/// side it begins again.
#[test]
fn a_reading_on_the_side_of_the_filter_ends_the_doubt() {
    for (side_mps, is_used) in [(0.99, true), (1.01, false)] {
        let mut filter = filter();
        for at_s in 1..=3 {
            push(&mut filter, at_s, [0.0, 2.0, 0.0]);
        }
        assert_eq!(filter.run(Sensor::Velocity).correction, Vector3::new(0.0, 2.0, 0.0));
        assert!(filter.run(Sensor::Velocity).is_held);
        assert_eq!(
            push(&mut filter, 4, [0.0, side_mps, 0.0]).0 == Verdict::Accepted,
            is_used
        );
        assert_eq!(!filter.run(Sensor::Velocity).is_held, is_used);
    }
}

/// One that is an outlier on the filter's side is rejected, and changes nothing.
#[test]
fn an_outlier_is_no_word_on_the_doubt() {
    let mut filter = filter();
    for at_s in 1..=3 {
        push(&mut filter, at_s, [0.0, 2.0, 0.0]);
    }
    let before = filter.run(Sensor::Velocity).correction;
    assert_eq!(push(&mut filter, 40, [5.0, 0.0, 0.0]), (Verdict::Rejected, None));
    assert_eq!(filter.run(Sensor::Velocity).correction, before);
}

/// Where other sensors have made the velocity known again, the readings are those of a gate as before, and count anew.
#[test]
fn what_other_sensors_show_ends_the_doubt() {
    let mut filter = filter();
    for at_s in 1..=3 {
        push(&mut filter, at_s, [0.0, 2.0, 0.0]);
    }
    assert!(filter.is_in_doubt(Sensor::Velocity));
    for (part, is_in_doubt) in [(0.26, true), (0.24, false)] {
        let mut updated = filter.clone();
        updated.covariance[(VELOCITY + 1, VELOCITY + 1)] = part * 4.0;
        assert_eq!(updated.is_in_doubt(Sensor::Velocity), is_in_doubt);
    }
}

/// Beams never widen the covariance; those that say the same for 30 s inflate it.
#[test]
fn beams_are_believed_after_half_a_minute() {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let mut filter = filter();
    let mut ping = ping_of(0, [1.0; MAX_BEAMS], 0.04, BeamMask::all(3));
    ping.velocity_mps[1] = -1.0;
    let before = velocity_covariance(&filter);
    let mut factors = Vec::new();
    for at_s in [0, 10, 20, 29, 30] {
        filter.state.time_ns = at_s * S;
        let innovation =
            filter.with_motion(|motion: &Motion<'_>| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping));
        assert_eq!(velocity_covariance(&filter), before);
        factors.push(
            filter
                .note_rejected(&innovation, Sensor::Beams, true)
                .unwrap()
                .and_then(|charge| charge.factor),
        );
    }
    assert_eq!(factors[..4], [None; 4]);
    assert!(factors[4].is_some_and(|factor| factor > 25.0));
    assert!(filter.run(Sensor::Beams).is_empty());
}

/// Of a run that is doubted one outlier is no end, and two in a row are.
#[test]
fn an_outlier_does_not_end_a_doubt() {
    let (off, outlier) = (Vector3::x(), -Vector3::x());
    let mut run = Run::default();
    for (time_ns, correction) in [off, off, outlier, off, outlier, off].into_iter().enumerate() {
        run.push(true, 4.0, correction, time_ns as i64, 2);
    }
    assert_eq!((run.doubtful, run.since_ns, run.correction), (4, 0, off));
    run.push(true, 4.0, outlier, 6, 2);
    run.push(true, 4.0, outlier, 7, 2);
    assert_eq!((run.doubtful, run.since_ns), (1, 7));
    // Before it is doubted every outlier is.
    run.push(true, 4.0, off, 8, 2);
    assert_eq!((run.doubtful, run.since_ns), (1, 8));
}

/// A fix with noise of 1 m, beside a velocity accepted then, judged.
fn push_fix(filter: &mut Eskf, at_s: i64, reading_m: [f64; 3]) -> (Verdict, Option<f64>) {
    filter.measured.velocity_ns = Some(at_s * S);
    judged(filter, at_s, Sensor::AcousticPosition, |filter| {
        let fix = Vec3::from_array(reading_m);
        position(&Motion::still(&filter.state()), &fix, &[1.0; 3], &Vec3::zeros())
    })
}

/// Fixes 50 m off are believed once they have lasted as long as those accepted before, the third of them at the earliest, and after
/// five minutes at the latest; until then the covariance stays. Where as much time had passed without any, the third is.
#[test]
fn fixes_are_believed_once_they_have_lasted_as_long_as_those_before() {
    // Fixes were accepted from 0 s to `until_s`; the first one off comes at `from_s`.
    for (until_s, from_s, believed_s) in [
        (0, 5, 7),
        (1, 2, 4),
        (20, 25, 45),
        (20, 39, 59),
        (20, 40, 42),
        (299, 300, 599),
        (1000, 1001, 1301),
    ] {
        let mut filter = filter();
        for at_s in [0, until_s] {
            assert_eq!(push_fix(&mut filter, at_s, [0.0; 3]).0, Verdict::Accepted);
        }
        let before = filter.covariance();
        let mut off = (from_s..).map(|at_s| (at_s, push_fix(&mut filter, at_s, [0.0, 50.0, 0.0])));
        let believed = off.find(|(_, (_, factor))| factor.is_some());
        assert_eq!(believed.unwrap().0, believed_s, "{until_s} {from_s}");
        assert!((filter.covariance() - before).view((POSITION, POSITION), (3, 3)).amax() > 100.0);
        assert_eq!(push_fix(&mut filter, believed_s, [0.0, 50.0, 0.0]).0, Verdict::Accepted);
        // Those that follow are confirmed from here on, not from 0 s.
        let since = filter.run(Sensor::AcousticPosition).accepted_ns;
        assert_eq!(since, Some([believed_s * S; 2]));
    }
}

/// A fix that agrees with the filter ends the doubt of those before it.
#[test]
fn a_fix_that_agrees_ends_the_doubt() {
    let mut filter = filter();
    for at_s in [0, 20] {
        push_fix(&mut filter, at_s, [0.0; 3]);
    }
    let before = filter.covariance();
    for at_s in 21..40 {
        assert_eq!(push_fix(&mut filter, at_s, [0.0, 50.0, 0.0]), (Verdict::Rejected, None));
    }
    assert_eq!(filter.covariance(), before);
    assert_eq!(push_fix(&mut filter, 40, [0.0; 3]).0, Verdict::Accepted);
    let run = filter.run(Sensor::AcousticPosition);
    assert!(run.is_empty());
    assert_eq!(run.accepted_ns, Some([0, 40 * S]));
}

//! Gaps, stuck readings and counts, by hand.

use super::*;
use crate::frames::Vec3;
use crate::model::Model;
use crate::testing::*;

const MS: i64 = 1_000_000;

fn reading(time_ms: i64, force_x: f64) -> ImuSample {
    imu(time_ms * MS, [0.0; 3], [force_x, 0.0, -9.8])
}

/// Judges readings one after another from a start at 0; 'g' good, 'b' good after a bridged interval, 'r' rejected, 'e' an
/// error, which leaves the check as it was.
fn verdicts(check: &mut ImuCheck, readings: &[ImuSample]) -> String {
    let mut good_ns = 0;
    let one = |sample: &ImuSample| {
        let before = check.clone();
        let Ok(judged) = check.judge(sample, good_ns) else {
            assert_eq!(*check, before);
            return 'e';
        };
        check.note(sample, good_ns, &judged);
        if let Judged::Good(_) = judged {
            good_ns = sample.time_ns;
        }
        match judged {
            Judged::Good(None) => 'g',
            Judged::Good(Some(_)) => 'b',
            Judged::Rejected(_) => 'r',
        }
    };
    readings.iter().map(one).collect()
}

fn check(change: impl Fn(&mut ImuLimits)) -> ImuCheck {
    let mut limits = ImuLimits::default();
    change(&mut limits);
    ImuCheck::new(&limits, &Model::table_2().imu)
}

/// The good reading after rejected ones carries the interval; the next one is an ordinary one.
#[test]
fn rejected_readings_are_bridged_by_the_next_good_one() {
    let mut check = check(|_| {});
    let forces = [0.1, 1000.0, 100.0, 0.2, 0.3];
    let readings: Vec<_> = (0..).zip(forces).map(|(k, force)| reading(10 * k, force)).collect();
    assert_eq!(verdicts(&mut check, &readings), "grrbg");
    assert_eq!(check.counts(), &[1, 1, 0, 0, 0]);
}

/// A gap of exactly the limit is none; a nanosecond more is refused, and so is a bad reading that late.
#[test]
fn gaps_are_refused_beyond_the_limit() {
    let late = |force_x| ImuSample {
        time_ns: 1_000 * MS + 1,
        ..reading(0, force_x)
    };
    assert_eq!(
        verdicts(&mut check(|_| {}), &[reading(0, 0.0), reading(1_000, 0.0)]),
        "gg"
    );
    assert_eq!(
        verdicts(&mut check(|_| {}), &[reading(0, 0.0), late(0.0), late(1000.0)]),
        "gee"
    );
    // The interval before the first reading is one too.
    assert_eq!(verdicts(&mut check(|_| {}), &[reading(1_001, 0.0)]), "e");
}

/// Where it is asked for, a longer gap is inflated and counted, up to a radian of attitude.
#[test]
fn gaps_are_inflated_where_asked() {
    let mut check = check(|limits| limits.gap = LongGap::Inflate);
    let readings = [0, 2_000, 2_010, 13_000, 12_010].map(|time_ms| reading(time_ms, 0.0));
    assert_eq!(verdicts(&mut check, &readings), "gbgeb");
    assert_eq!(check.counts(), &[0, 0, 0, 0, 2]);
}

/// The third of three equal readings is rejected, and what follows until they differ; negative and positive zero are equal. The
/// departure by 0.5 m/s² is doubted.
#[test]
fn stuck_readings_are_rejected() {
    let mut check = check(|limits| limits.stuck_after = 3);
    let forces = [0.0, -0.0, 0.0, 0.0, 0.5, 0.5, 0.4, 0.4, 0.4];
    let readings: Vec<_> = (0..).zip(forces).map(|(k, force)| reading(10 * k, force)).collect();
    assert_eq!(verdicts(&mut check, &readings), "ggrrbbbbr");
    assert_eq!(check.counts(), &[0, 0, 3, 0, 0]);
}

/// An axis stands still alone where its readings have seldom repeated; one that has always stood still does not.
#[test]
fn an_axis_that_stops_is_stuck() {
    let mut check = check(|limits| limits.stuck_after = 20);
    let scatter = |k: i64| 1e-3 * f64::from((k * k % 7) as i32);
    let at = |k: i64, force_x: f64| ImuSample {
        rate_p_radps: Vec3::new(0.0, 0.0, scatter(k + 3)),
        ..reading(10 * k, force_x)
    };
    let mut readings: Vec<_> = (0..100).map(|k| at(k, scatter(k))).collect();
    readings.extend((100..130).map(|k| at(k, 0.5e-3)));
    readings.push(at(130, scatter(130)));
    let expected = format!("{}{}b", "g".repeat(119), "r".repeat(11));
    assert_eq!(verdicts(&mut check, &readings), expected);
    assert_eq!(check.counts(), &[0, 0, 11, 0, 0]);
}

/// Without noise in the model equal readings are those of a simulation.
#[test]
fn readings_without_noise_are_not_stuck() {
    let limits = ImuLimits {
        stuck_after: 2,
        ..ImuLimits::default()
    };
    let mut quiet = Model::table_2().imu;
    quiet.gyro_noise_rad_rts = 0.0;
    let readings = [0, 10, 20, 30].map(|time_ms| reading(time_ms, 0.0));
    assert_eq!(verdicts(&mut ImuCheck::new(&limits, &quiet), &readings), "gggg");
    assert_eq!(
        verdicts(&mut ImuCheck::new(&limits, &Model::table_2().imu), &readings),
        "grrr"
    );
}

/// Within 10 ms a force changes by up to 3 m/s²; more is a jump, twice in a row, and the third reading is taken, in doubt. The first
/// change is always taken, and where readings usually change by 1 m/s² one of 14 m/s² is none.
#[test]
fn readings_that_jump_are_rejected() {
    let judged = |forces: &[f64]| {
        let mut check = check(|_| {});
        let readings: Vec<_> = (0..).zip(forces).map(|(k, &force)| reading(10 * k, force)).collect();
        (verdicts(&mut check, &readings), check.counts()[3])
    };
    assert_eq!(judged(&[0.0, 0.0, 2.9, 0.0]), ("ggbb".into(), 0));
    assert_eq!(judged(&[0.0, 0.0, 3.1, 0.0]), ("ggrb".into(), 1));
    assert_eq!(judged(&[0.0, 40.0, 40.0]), ("ggg".into(), 0));
    // Two readings later it is 30 ms since the last good one: 9 m/s².
    assert_eq!(judged(&[0.0, 0.0, 40.0, 40.0, 40.0, 40.0]), ("ggrrbb".into(), 2));
    let shaken = |jump: f64| {
        let mut forces: Vec<f64> = (0..500).map(|k| f64::from(k % 2)).collect();
        forces.push(jump);
        judged(&forces).1
    };
    assert_eq!((shaken(14.5), shaken(16.5)), (0, 1));
}

/// The noise of each interval of a check at readings of a force every 10 ms: of the last one alone, over it.
fn noise_after(forces: &[f64]) -> (Option<BridgeNoise>, ImuCheck) {
    let mut check = check(|_| {});
    let readings: Vec<_> = (0..).zip(forces).map(|(k, &force)| reading(10 * k, force)).collect();
    let (last, before) = readings.split_last().unwrap();
    verdicts(&mut check, before);
    let good_ns = check.course.good.unwrap().time_ns;
    let Ok(Judged::Good(noise)) = check.judge(last, good_ns) else {
        panic!("the last reading is not good");
    };
    (noise, check)
}

/// A vehicle changes its force by 5 m/s³ by itself. What departs by more is doubted for as long as it lasts, half a second at most,
/// and once more as it goes back; the velocity is then uncertain by all of it.
#[test]
fn a_departure_is_doubted_while_it_lasts() {
    let judged = |forces: &[f64]| {
        let readings: Vec<_> = (0..).zip(forces).map(|(k, &force)| reading(10 * k, force)).collect();
        verdicts(&mut check(|_| {}), &readings)
    };
    assert_eq!(judged(&[0.0, 0.0, 0.04, 0.0, 0.06, 0.0]), "ggggbb");
    let mut forces = [1.0; 62];
    forces[..2].fill(0.0);
    assert_eq!(judged(&forces), format!("gg{}{}", "b".repeat(50), "g".repeat(10)));
    assert_eq!(judged(&[0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), "ggbbbbgg");
    // A blow on several axes is none.
    let mut check = check(|_| {});
    let mut readings: Vec<_> = (0..6).map(|k| reading(10 * k, f64::from(k > 2))).collect();
    assert_eq!(verdicts(&mut check.clone(), &readings), "gggbbb");
    for reading in &mut readings[3..] {
        reading.rate_p_radps = Vec3::new(0.0, 0.0, 0.005);
    }
    assert_eq!(verdicts(&mut check, &readings), "gggggg");
    // The k-th interval adds 1² ((k + 1)² − k²) of its length to the square of the velocity: over ten, one hundred.
    for k in 0..10_u8 {
        let (noise, _) = noise_after(&forces[..3 + usize::from(k)]);
        let sd = f64::from(2 * k + 1).sqrt();
        assert_eq!(noise, Some(BridgeNoise::of_constant([0.0, sd], 0.01)), "{k}");
    }
}

/// Where usual readings change by 0.02 m/s² in 10 ms, and thirty are missing, the force is uncertain by 0.02 · 30 / 8; by 0.5 m/s², and
/// the rate by 0.1 rad/s, however long the gap.
#[test]
fn missing_readings_are_bridged_by_the_usual_change() {
    let forces: Vec<f64> = (0..200).map(|k| 0.02 * f64::from(k % 2)).collect();
    let (noise, check) = noise_after(&forces);
    assert_eq!(noise, None);
    let good_ns = check.course.good.unwrap().time_ns;
    let after = |gap_ms: i64| match check.judge(&reading(good_ns / MS + gap_ms, 0.0), good_ns).unwrap() {
        Judged::Good(noise) => noise,
        Judged::Rejected(fault) => panic!("{fault}"),
    };
    assert_eq!(after(25), None);
    let close = |found: Option<BridgeNoise>, force: f64, gap_s: f64| {
        let expected = BridgeNoise::of_constant([0.0, force], gap_s);
        assert!(
            format!("{found:.12?}") == format!("{:.12?}", Some(expected)),
            "{found:?}, {expected:?}"
        );
    };
    close(after(300), 0.02 * 30.0 / 8.0, 0.3);
    close(after(1_000), 0.02 * 100.0 / 8.0, 1.0);
    let mut lively = check.clone();
    lively.course.usual.as_mut().unwrap().change = [1.0, 1.0];
    let noise = BridgeNoise::of_constant([0.1, 0.5], 0.5);
    let judged = lively.judge(&reading(good_ns / MS + 500, 0.0), good_ns).unwrap();
    assert_eq!(judged, Judged::Good(Some(noise)));
}

/// A rate that jumps is named with how far.
#[test]
fn a_jump_is_named() {
    let mut check = check(|_| {});
    verdicts(&mut check, &[0, 10, 20].map(|time_ms| reading(time_ms, 0.0)));
    let mut jumped = reading(30, 0.0);
    jumped.rate_p_radps = Vec3::new(0.0, -0.6, 0.0);
    let text = check.fault(&jumped).unwrap().to_string();
    assert_eq!(
        text,
        "angular rate changes by 0.600 rad/s in 0.010 s, more than any vehicle's: a flipped bit?"
    );
    assert!(!check.is_plain(&jumped, 20 * MS) && check.is_plain(&reading(30, 0.0), 20 * MS));
    let mut spoilt = check.clone();
    spoilt.course.usual.as_mut().unwrap().step_s = f64::NAN;
    assert!(check.check_restored().is_ok() && spoilt.check_restored().is_err());
    check.repeats[5] = f64::NAN;
    assert!(check.check_restored().is_err());
}

//! A filter predicted along a slice against the same filter step by step: bits, failures and tapes.

use crate::error::NavError;
use crate::mechanisation::Sampling;
use crate::testing::*;

const PERIODS_NS: [i64; 3] = [0, 20_000_000, 100_000_000];

fn filter(period_ns: i64, sampling: Sampling, water: bool) -> Eskf {
    let options = Options {
        imu_sampling: sampling,
        covariance_period_ns: period_ns,
        ..Options::default()
    };
    let mut start = NavState::at_rest(0);
    start.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    start.attitude_t_p = Rot::from_euler_rad(0.1, -0.2, 0.7);
    start.gyro_bias_p_radps = Vec3::new(1e-5, 0.0, -2e-5);
    let Ok(filter) = Eskf::new(start, &Model::table_2(), &options) else {
        unreachable!("the model of the paper is a good one");
    };
    filter.with_water(water.then(|| WaterBlock::new(&WaterPrior::default())))
}

fn samples(count: usize) -> Vec<ImuSample> {
    let sample = |at: usize| {
        imu(
            at as i64 * 6_666_667,
            [0.01, 0.2 * (0.1 * at as f64).cos(), 0.02],
            [(at as f64).sin(), 0.1, -9.8],
        )
    };
    (0..count).map(sample).collect()
}

fn step_by_step(filter: &mut Eskf, samples: &[ImuSample]) -> Result<(), (usize, NavError)> {
    for (k, step) in samples.windows(2).enumerate() {
        filter.predict(&step[0], &step[1]).map_err(|error| (k + 1, error))?;
    }
    Ok(())
}

/// All that a filter holds, NaN included.
fn held(filter: &Eskf) -> Vec<u64> {
    let mut numbers = filter.covariance().as_slice().to_vec();
    numbers.extend(filter.kinematics.to_array());
    numbers.extend(filter.last_rate_p_radps.iter());
    numbers.extend([filter.last_step_s, filter.interval.duration_s()]);
    numbers.extend(filter.velocity().1.iter());
    if let Some(water) = filter.water_states() {
        numbers.extend(water.estimate.iter());
        let further = filter.extensions.further();
        numbers.extend(further.covariance().iter().chain(further.cross()));
    }
    // Which of many NaN it is, is nobody's.
    let bits = |x: f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
    numbers
        .into_iter()
        .map(bits)
        .chain([filter.state.time_ns as u64])
        .collect()
}

fn every_kind(check: impl Fn(Eskf)) {
    for period_ns in PERIODS_NS {
        for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
            for water in [false, true] {
                check(filter(period_ns, sampling, water));
            }
        }
    }
}

/// Slices of every length up to 25 steps, one after the other, so that intervals go on over their ends; and single steps between
/// them.
#[test]
fn slices_equal_steps() {
    every_kind(|start| {
        let all = samples(400);
        let (mut along, mut apart) = (start.clone(), start);
        let mut from = 0;
        for length in 0..=25 {
            let slice = &all[from..=from + length];
            assert_eq!(along.predict_along(slice), Ok(()));
            assert_eq!(step_by_step(&mut apart, slice), Ok(()));
            assert_eq!(held(&along), held(&apart), "{length} steps");
            from += length;
            let next = &all[from..=from + 1];
            assert_eq!(step_by_step(&mut along, next), Ok(()));
            assert_eq!(step_by_step(&mut apart, next), Ok(()));
            from += 1;
        }
    });
}

/// Readings that are no numbers, forces beyond all numbers and times that stand still, at every place.
#[test]
fn failures_are_those_of_steps() {
    every_kind(|start| {
        for at in 1..20 {
            for what in 0..4 {
                let mut broken = samples(20);
                match what {
                    0 => broken[at].force_p_mps2 = Vec3::new(0.0, f64::NAN, 0.0),
                    1 => broken[at].rate_p_radps = Vec3::new(0.0, f64::NAN, 0.0),
                    2 => broken[at].force_p_mps2 = Vec3::new(f64::MAX, f64::MAX, f64::MAX),
                    _ => broken[at].time_ns = broken[at - 1].time_ns,
                }
                let (mut along, mut apart) = (start.clone(), start.clone());
                let outcome = along.predict_along(&broken);
                assert!(outcome.is_err());
                assert_eq!(outcome, step_by_step(&mut apart, &broken));
                assert_eq!(held(&along), held(&apart), "{what} at {at}");
            }
        }
    });
}

/// A tape has every transition, and changes no bit.
#[test]
fn a_tape_sees_every_step() {
    every_kind(|start| {
        let all = samples(40);
        let (mut along, mut apart, mut without) = (start.clone(), start.clone(), start);
        along.begin_tape();
        apart.begin_tape();
        assert_eq!(along.predict_along(&all), Ok(()));
        assert_eq!(step_by_step(&mut apart, &all), Ok(()));
        assert_eq!(without.predict_along(&all), Ok(()));
        assert_eq!(held(&along), held(&without));
        let tape = along.take_tape();
        assert!(tape.is_some());
        assert_eq!(tape, apart.take_tape());
    });
}

/// With a period an interval holds many steps, to second order; without, one step of the first order.
#[test]
fn the_period_decides_the_order() {
    use crate::error_model::Interval;
    for (period_ns, many) in [(0, false), (20_000_000, true)] {
        let mut filter = filter(period_ns, Sampling::Instantaneous, false);
        filter.begin_interval();
        assert_eq!(matches!(filter.interval, Interval::SecondOrder(_)), many);
        assert_eq!(matches!(filter.interval, Interval::FirstOrder(_)), !many);
    }
}

/// Within an interval the states beside the others are brought up to date with the covariance.
#[test]
fn others_are_brought_up_to_date() {
    let mut filter = filter(100_000_000, Sampling::Instantaneous, true);
    let samples = samples(4);
    let water = filter.water_states().unwrap().estimate;
    let assumed = filter.with_motion(|motion| crate::aiding::water::sway_row(motion, &water));
    filter.assume(&assumed, crate::filter::report::Sensor::Sway).unwrap();
    filter.predict_along(&samples).unwrap();
    let before = filter.water_covariance().unwrap();
    let last = samples[3].time_ns as f64 * 1e-9;
    filter.propagate_covariance();
    let (after, prior) = (filter.water_covariance().unwrap(), WaterPrior::default());
    let processes = prior.processes();
    let (left, variance) = (
        processes.map(|process| process.left(last)),
        processes.map(|process| process.variance),
    );
    assert!(before[(5, 5)] != variance[5] || before[(0, 0)] != variance[0]);
    for k in 0..variance.len() {
        let expected = before[(k, k)] * left[k] * left[k] + (1.0 - left[k] * left[k]) * variance[k];
        assert!((after[(k, k)] - expected).abs() < 1e-15);
    }
    filter.propagate_covariance();
    assert_eq!(filter.water_covariance().unwrap(), after, "no time has passed");
}

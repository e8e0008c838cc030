//! Filters propagated together in SIMD lanes: each has the results of a filter propagated alone, bit for bit.

use crate::common::*;
use bottomlock::aiding::water::WaterPrior;
use bottomlock::filter::Eskf;
use bottomlock::filter::filter_group::{FilterSpan, predict_together, width};
use bottomlock::filter::water_block::WaterBlock;
use proptest::prelude::*;

const STEP_NS: i64 = 6_666_667;

fn filter(k: usize, options: &Options) -> Eskf {
    let mut start = NavState::at_rest(0);
    start.velocity_p_mps = Vec3::new(2.0, 0.1 * k as f64, -0.05);
    start.attitude_t_p = Rot::from_euler_rad(0.1, -0.2, 0.7 * k as f64);
    start.gyro_bias_p_radps = Vec3::new(1e-5 * k as f64, 0.0, -2e-5);
    let water = (k % 3 == 1).then(|| WaterBlock::new(&WaterPrior::default()));
    Eskf::new(start, &Model::table_2(), options).unwrap().with_water(water)
}

/// Readings of filter k. Every fifth filter spins fast, so that its rotation does not converge in the series of the
/// others.
fn stream(k: usize, from: usize, to: usize) -> Vec<ImuSample> {
    let spin = if k % 5 == 4 { 180.0 } else { 0.2 };
    let sample = |at: usize| ImuSample {
        time_ns: at as i64 * STEP_NS,
        rate_p_radps: Vec3::new(0.01, spin * (0.1 * at as f64).cos(), 0.02 * k as f64),
        force_p_mps2: Vec3::new((at as f64).sin(), 0.1, -9.8 + 0.01 * k as f64),
    };
    (from..=to).map(sample).collect()
}

fn bits(filter: &Eskf) -> Vec<u64> {
    let state = filter.state();
    let mut numbers = filter.covariance().as_slice().to_vec();
    numbers.extend(state.position_t_m.to_array());
    numbers.extend(state.attitude_t_p.to_quaternion_wxyz());
    numbers.extend(state.velocity_p_mps.to_array());
    if let Some(water) = filter.water_states() {
        numbers.extend(water.estimate.iter().chain(&filter.water_covariance().unwrap()));
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

fn spans<'a>(filters: &'a mut [Eskf], streams: &'a [Vec<ImuSample>]) -> Vec<FilterSpan<'a>> {
    let pairs = filters.iter_mut().zip(streams);
    pairs.map(|(filter, own)| FilterSpan::new(filter, own)).collect()
}

fn alone(mut filter: Eskf, samples: &[ImuSample]) -> Eskf {
    for step in samples.windows(2) {
        filter.predict(&step[0], &step[1]).unwrap();
    }
    filter
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Any number of filters and segments, both IMU samplings, and any covariance interval, with filters that start one
    /// step later and whose covariance is therefore propagated at other times.
    #[test]
    fn filters_in_lanes_equal_filters_alone(
        count in 1_usize..20,
        stretches in prop::collection::vec(1_usize..40, 1..4),
        averaged in any::<bool>(),
        period_ms in prop::sample::select(vec![0_i64, 20, 33, 100]),
    ) {
        let options = Options {
            imu_sampling: if averaged { Sampling::Averaged } else { Sampling::Instantaneous },
            covariance_period_ns: period_ms * 1_000_000,
            ..Options::default()
        };
        let early = |k: usize| k % 4 == 3;
        let mut together: Vec<Eskf> = (0..count).map(|k| filter(k, &options)).collect();
        let mut apart = together.clone();
        for (k, filter) in together.iter_mut().enumerate().filter(|(k, _)| early(*k)) {
            *filter = alone(filter.clone(), &stream(k, 0, 1));
            apart[k] = filter.clone();
        }
        let mut from = 1;
        for length in stretches {
            let streams: Vec<_> = (0..count).map(|k| stream(k, from, from + length)).collect();
            let mut spans = spans(&mut together, &streams);
            predict_together(&mut spans);
            prop_assert!(spans.iter().all(|span| span.failure.is_none()));
            for (k, own) in streams.iter().enumerate() {
                apart[k] = alone(apart[k].clone(), own);
                prop_assert_eq!(bits(&together[k]), bits(&apart[k]), "filter {} of {}", k, count);
            }
            from += length;
        }
    }
}

/// A filter that overflows fails at the same step as alone; the others have the same results.
#[test]
fn a_failure_does_not_affect_other_filters() {
    let options = Options::default();
    let mut filters: Vec<Eskf> = (0..=width()).map(|k| filter(k, &options)).collect();
    let mut streams: Vec<_> = (0..filters.len()).map(|k| stream(k, 0, 50)).collect();
    streams[2][20].force_p_mps2 = Vec3::new(f64::MAX, f64::MAX, f64::MAX);
    let apart: Vec<_> = filters
        .iter()
        .zip(&streams)
        .enumerate()
        .filter(|(k, _)| *k != 2)
        .map(|(_, (f, s))| alone(f.clone(), s))
        .collect();
    let mut lonely = filters[2].clone();
    let failure = streams[2]
        .windows(2)
        .enumerate()
        .find_map(|(k, step)| Some((k + 1, lonely.predict(&step[0], &step[1]).err()?)));
    let mut spans = spans(&mut filters, &streams);
    predict_together(&mut spans);
    assert!(failure.is_some());
    for (k, span) in spans.iter().enumerate() {
        assert_eq!(span.failure, if k == 2 { failure.clone() } else { None });
    }
    filters.remove(2);
    for (own, other) in filters.iter().zip(&apart) {
        assert_eq!(bits(own), bits(other));
    }
}

/// Times that do not increase are rejected as by a filter alone, and a single sample is no step.
#[test]
fn times_that_do_not_increase_are_rejected() {
    let options = Options::default();
    let mut filters: Vec<Eskf> = (0..3).map(|k| filter(k, &options)).collect();
    let mut samples = stream(0, 0, 5);
    samples[3].time_ns = samples[2].time_ns;
    let mut spans: Vec<_> = filters
        .iter_mut()
        .map(|filter| FilterSpan::new(filter, &samples))
        .collect();
    predict_together(&mut spans);
    assert!(spans.iter().all(|span| matches!(&span.failure, Some((3, _)))));
    let before = bits(&filters[0]);
    predict_together(&mut [FilterSpan::new(&mut filters[0], &samples[..1])]);
    assert_eq!(bits(&filters[0]), before);
}

/// Filters whose sample times become different are propagated together up to there, and then each along its own.
#[test]
fn sample_times_may_become_different() {
    for period_ms in [0, 100] {
        let options = Options {
            covariance_period_ns: period_ms * 1_000_000,
            ..Options::default()
        };
        let mut together: Vec<Eskf> = (0..5).map(|k| filter(k, &options)).collect();
        let mut streams: Vec<_> = (0..5).map(|k| stream(k, 0, 60)).collect();
        streams[1][37].time_ns += 1_000_000;
        let apart: Vec<_> = together
            .iter()
            .zip(&streams)
            .map(|(f, s)| alone(f.clone(), s))
            .collect();
        let mut spans = spans(&mut together, &streams);
        predict_together(&mut spans);
        assert!(spans.iter().all(|span| span.failure.is_none()));
        for (own, other) in together.iter().zip(&apart) {
            assert_eq!(bits(own), bits(other));
        }
    }
}

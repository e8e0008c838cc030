//! Properties of the method with assumptions on sway and heave through the water, against tight coupling.

use crate::common::*;
use bottomlock::aiding::water::WaterPrior;
use bottomlock::filter::report::{Sensor, UpdateReport, Verdict};
use proptest::prelude::*;

const SECONDS: i64 = 40;
const STEP_NS: i64 = 20_000_000;

/// A level turn with constant sway and heave and a ping per second, with disturbances added to the beams.
#[derive(Debug, Clone)]
struct Track {
    sway_mps: f64,
    heave_mps: f64,
    rate_radps: f64,
    mask: BeamMask,
    /// The mask of the second half.
    mask_later: BeamMask,
    initial_velocity_sd_mps: f64,
    disturbance_mps: Vec<f64>,
    seconds: i64,
}

impl Track {
    fn calm(sway_mps: f64) -> Self {
        Self {
            sway_mps,
            heave_mps: 0.0,
            rate_radps: 0.05,
            mask: [0, 1].into_iter().collect(),
            mask_later: [0, 1].into_iter().collect(),
            initial_velocity_sd_mps: 0.05,
            disturbance_mps: vec![0.0],
            seconds: SECONDS,
        }
    }
}

struct Outcome {
    navigator: Navigator,
    reports: Vec<UpdateReport>,
}

impl Outcome {
    fn of(&self, sensor: Sensor) -> Vec<UpdateReport> {
        self.reports.iter().filter(|r| r.sensor == sensor).copied().collect()
    }
}

fn run(aiding: BeamAiding, track: &Track, options: &Options) -> Outcome {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let mut model = Model::table_2();
    model.initial.velocity_sd_mps = [track.initial_velocity_sd_mps; 3];
    let mut initial = NavState::at_rest(0);
    initial.velocity_p_mps = Vec3::new(2.0, track.sway_mps, track.heave_mps);
    let mut navigator = Navigator::new(initial, geometry.clone(), aiding, &model, options).unwrap();
    let mut reports = Vec::new();
    let mut collect = |report: &UpdateReport| reports.push(*report);
    let gravity = model.environment.gravity_mps2;
    let rate = track.rate_radps;
    for k in 0..=track.seconds * 1_000_000_000 / STEP_NS {
        let time_ns = k * STEP_NS;
        let imu = ImuSample {
            time_ns,
            rate_p_radps: Vec3::new(0.0, 0.0, rate),
            force_p_mps2: Vec3::new(-rate * track.sway_mps, rate * 2.0, -gravity),
        };
        navigator.push(&Event::Imu(imu), &mut collect).unwrap();
        if time_ns > 0 && time_ns % 1_000_000_000 == 0 {
            let epoch = (time_ns / 1_000_000_000) as usize;
            let mut ping = BeamSample {
                time_ns,
                velocity_mps: [0.0; MAX_BEAMS],
                sd_mps: [0.042; MAX_BEAMS],
                valid: if epoch as i64 * 2 > SECONDS {
                    track.mask_later
                } else {
                    track.mask
                },
            };
            for beam in 0..4 {
                let d = geometry.direction_p(beam);
                let disturbance = track.disturbance_mps[(epoch * 4 + beam) % track.disturbance_mps.len()];
                ping.velocity_mps[beam] = 2.0 * d.x + track.sway_mps * d.y + track.heave_mps * d.z + disturbance;
            }
            navigator.push(&Event::Beams(ping), &mut collect).unwrap();
        }
    }
    Outcome { navigator, reports }
}

fn with_prior(prior: WaterPrior) -> Options {
    Options {
        water: prior,
        robust: None,
        ..Options::default()
    }
}

/// With variances of 1e12 (m/s)² the assumptions have no weight, and the method equals tight coupling.
#[test]
fn infinite_variances_give_tight_coupling() {
    let prior = WaterPrior {
        current_sd_mps: 1e6,
        sway_gain_sd_m: 1e6,
        trim_sd_mps: 1e6,
        slip_sd_mps: 1e6,
        ..WaterPrior::default()
    };
    let track = Track::calm(0.2);
    let tight = run(BeamAiding::Tight, &track, &with_prior(prior));
    let method = run(BeamAiding::SwayCurrent, &track, &with_prior(prior));
    assert!(method.of(Sensor::Sway).iter().all(|r| r.verdict == Verdict::Accepted));
    let error = tight.navigator.state().error_of(&method.navigator.state());
    assert!(error.amax() < 1e-9, "{error}");
    let (p, q) = (tight.navigator.covariance(), method.navigator.covariance());
    for k in 0..p.nrows() {
        assert!((p[(k, k)] - q[(k, k)]).abs() <= 1e-9 * p[(k, k)], "state {k}");
    }
}

/// With rejected assumptions state and covariance equal those of tight coupling, bit for bit; the second ping raises the alarm, from
/// which on wider assumptions are accepted.
#[test]
fn a_rejected_assumption_changes_nothing() {
    let overconfident = WaterPrior {
        current_sd_mps: 0.0,
        sway_gain_m: 0.0,
        sway_gain_sd_m: 0.0,
        trim_sd_mps: 0.0,
        slip_sd_mps: 1e-4,
        ..WaterPrior::default()
    };
    // All beams, so that sway and heave over ground are known and far from the assumed values.
    let longer = Track {
        mask: BeamMask::all(4),
        mask_later: BeamMask::all(4),
        heave_mps: 0.5,
        rate_radps: 0.0,
        ..Track::calm(0.5)
    };
    let track = Track {
        seconds: 2,
        ..longer.clone()
    };
    for gate in [Gate::Joint, Gate::PerRow] {
        let options = Options {
            gate,
            ..with_prior(overconfident)
        };
        let tight = run(BeamAiding::Tight, &track, &options);
        let method = run(BeamAiding::SwayCurrent, &track, &options);
        for sensor in [Sensor::Sway, Sensor::Heave] {
            let verdicts = method.of(sensor);
            assert_eq!(verdicts.len(), 2);
            assert!(verdicts.iter().all(|report| report.verdict == Verdict::Rejected));
        }
        assert_eq!(tight.navigator.state(), method.navigator.state());
        assert_eq!(tight.navigator.covariance(), method.navigator.covariance());
        assert_eq!(method.navigator.water().unwrap().alarms(), 1);
        let later = run(BeamAiding::SwayCurrent, &longer, &options);
        assert_eq!(later.of(Sensor::Sway)[SECONDS as usize - 1].verdict, Verdict::Accepted);
    }
}

/// On a straight leg two beams cannot separate a current from a velocity error, so a wrong assumption of no current
/// is not detected. When all beams return and contradict it, the constrained filter is restarted and agrees with the beams.
#[test]
fn a_contradicted_assumption_is_restarted() {
    let none = WaterPrior {
        current_sd_mps: 1e-3,
        sway_gain_sd_m: 1e-3,
        ..WaterPrior::default()
    };
    let track = Track {
        rate_radps: 0.0,
        initial_velocity_sd_mps: 1.0,
        ..Track::calm(0.5)
    };
    let partial = run(BeamAiding::SwayCurrent, &track, &with_prior(none));
    assert!(partial.navigator.state().velocity_p_mps.0.y.abs() < 0.1);
    assert_eq!(partial.navigator.water().unwrap().restarts(), 0);

    let later = Track {
        mask_later: BeamMask::all(4),
        ..track
    };
    for gate in [Gate::Joint, Gate::PerRow] {
        let options = Options {
            gate,
            ..with_prior(none)
        };
        let method = run(BeamAiding::SwayCurrent, &later, &options);
        let tight = run(BeamAiding::Tight, &later, &options);
        assert!(method.navigator.water().unwrap().restarts() > 0);
        let difference = method.navigator.state().velocity_p_mps.0 - tight.navigator.state().velocity_p_mps.0;
        assert!(difference.norm() < 0.1, "{difference}");
        assert_eq!(method.of(Sensor::Beams), tight.of(Sensor::Beams));
    }
}

prop_compose! {
    fn prior()(exponents in prop::array::uniform5(-4.0_f64..2.0), gain in -3.0_f64..3.0,
               times in prop::array::uniform3(-1.0_f64..5.0)) -> WaterPrior {
        let ten = |x: f64| 10.0_f64.powf(x);
        WaterPrior {
            current_sd_mps: ten(exponents[0]),
            current_time_s: ten(times[0]),
            sway_gain_m: gain,
            sway_gain_sd_m: ten(exponents[1]),
            trim_sd_mps: ten(exponents[2]),
            trim_time_s: ten(times[1]),
            slip_sd_mps: ten(exponents[3]),
            slip_time_s: ten(times[2]),
        }
    }
}

prop_compose! {
    fn track()(sd_exponent in -2.0_f64..1.0, later_bits in 0_usize..16, sway_mps in -2.0_f64..2.0, heave_mps in -1.0_f64..1.0, rate_radps in -0.3_f64..0.3, bits in 0_usize..16,
                disturbance_mps in prop::collection::vec(-1.0_f64..1.0, 1..40)) -> Track {
        let mask_of = |bits: usize| (0..4).filter(|k| bits & (1 << k) != 0).collect();
        let (mask, mask_later) = (mask_of(bits), mask_of(later_bits));
        Track { sway_mps, heave_mps, rate_radps, mask, mask_later, initial_velocity_sd_mps: 10.0_f64.powf(sd_exponent), disturbance_mps, seconds: SECONDS }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// For any prior and any beams each ping has the report of tight coupling, bit for bit, so an assumption cannot
    /// make the gate reject beams; all numbers stay finite.
    #[test]
    fn assumptions_do_not_change_beam_reports(prior in prior(), track in track()) {
        let options = with_prior(prior);
        let tight = run(BeamAiding::Tight, &track, &options);
        let method = run(BeamAiding::SwayCurrent, &track, &options);
        prop_assert_eq!(tight.of(Sensor::Beams), method.of(Sensor::Beams));
        prop_assert!(method.navigator.state().validate().is_ok());
        prop_assert!(method.navigator.covariance().iter().all(|x| x.is_finite()));
        let water = method.navigator.water().unwrap();
        let filter = method.navigator.filter();
        let covariance = filter.water_covariance().unwrap();
        prop_assert!(filter.water_states().unwrap().estimate.iter().chain(covariance.iter()).all(|x| x.is_finite()));
        prop_assert!(water.processes().iter().all(|process| process.variance >= 0.0));
    }
}

//! Theorems of partial-beam aiding, over random priors, geometries of three to five beams and all masks.
//!
//! TC = VB with the exact cross-covariance = information form through its principal axes = information form through the full
//! covariance, for every mask: redundant beams close, and these methods pass the closure on beside the velocity. A velocity
//! alone (LC) leaves out what the closure says of the beam biases.

use std::f64::consts::TAU;

use crate::common::*;
use bottomlock::aiding::InformationPort;
use bottomlock::aiding::beams::DvlModel;
use bottomlock::aiding::outliers::Robust;
use bottomlock::aiding::registry::SensorModels;
use bottomlock::dvl::partial::{Assumptions, PartialMethod};
use bottomlock::earth::Environment;
use bottomlock::layout::DVL_BIAS;
use bottomlock::model::*;
use nalgebra::{Matrix3xX, Vector4};
use proptest::prelude::*;

fn model() -> Model {
    Model {
        environment: Environment::normal(0.57, 0.0),
        imu: ImuModel {
            gyro_noise_rad_rts: 1e-4,
            accel_noise_mps_rts: 1e-3,
            ..Default::default()
        },
        initial: InitialModel::default(),
        sensors: SensorModels {
            dvl: DvlModel {
                beam_noise_sd_mps: 0.042,
                ..Default::default()
            },
            ..Model::table_2().sensors
        },
    }
}

#[derive(Debug, Clone)]
struct Case {
    geometry: BeamGeometry,
    mask: BeamMask,
    covariance: Covariance,
    state: NavState,
    readings: [f64; MAX_BEAMS],
    sd: [f64; MAX_BEAMS],
    rate: [f64; 3],
}

/// Typical sizes of the states, so that a random correlation makes a plausible covariance.
const SIZES: [f64; DIM] = [
    2.0, 2.0, 2.0, 0.02, 0.02, 0.02, 0.3, 0.3, 0.3, 5e-3, 5e-3, 5e-3, 1e-3, 1e-3, 1e-3, 0.01, 0.01, 0.01, 0.01, 0.01,
];

fn covariance(seed: &[f64], dvl: bool) -> Covariance {
    let a = Covariance::from_fn(|i, j| seed[(i * DIM + j) % seed.len()] * ((i * 31 + j * 17) as f64).cos());
    let correlated = a * a.transpose() / DIM as f64 + Covariance::identity() * 0.1;
    Covariance::from_fn(|i, j| {
        let frozen = !dvl && (i >= DVL_BIAS || j >= DVL_BIAS);
        if frozen {
            0.0
        } else {
            0.5 * (correlated[(i, j)] + correlated[(j, i)]) * SIZES[i] * SIZES[j]
        }
    })
}

/// Random geometries with well separated azimuths, so that the rank is well conditioned.
fn geometry() -> impl Strategy<Value = BeamGeometry> {
    (
        3_usize..=5,
        prop::collection::vec((0.2_f64..0.7, -0.25_f64..0.25), 5),
        prop::collection::vec(-1.0_f64..1.0, 15),
        0.0_f64..TAU,
    )
        .prop_map(|(beams, angles, levers, turn)| {
            let tilts: Vec<f64> = angles.iter().take(beams).map(|a| a.0).collect();
            let azimuths: Vec<f64> = (0..beams)
                .map(|k| (turn + TAU * k as f64 / beams as f64 + angles[k].1).rem_euclid(TAU))
                .collect();
            let levers: Vec<_> = (0..beams)
                .map(|k| Vec3::new(levers[3 * k], levers[3 * k + 1], levers[3 * k + 2]))
                .collect();
            BeamGeometry::from_angles(&tilts, &azimuths)
                .unwrap()
                .with_lever_arms(&levers)
                .unwrap()
        })
}

prop_compose! {
    fn case(dvl: bool, levers: bool)(geometry in geometry(), bits in 1_usize..32, seed in prop::collection::vec(-1.0_f64..1.0, 37),
                       angles in prop::array::uniform3(-1.5_f64..1.5), velocity in prop::array::uniform3(-2.0_f64..2.0),
                       readings in prop::array::uniform8(-1.0_f64..1.0), sd in prop::array::uniform8(0.01_f64..0.1),
                       rate in prop::array::uniform3(-0.3_f64..0.3), scale in -0.02_f64..0.02) -> Case {
        let beams = geometry.beams();
        let geometry = if levers { geometry } else { geometry.with_lever_arms(&vec![Vec3::zeros(); beams]).unwrap() };
        let mut mask: BeamMask = (0..beams).filter(|k| bits & (1 << k) != 0).collect();
        if mask == BeamMask::NONE {
            mask = BeamMask::all(1);
        }
        let mut state = NavState::at_rest(0);
        state.attitude_t_p = Rot::from_euler_rad(angles[0], angles[1], angles[2]);
        state.velocity_p_mps = Vec3::from_array(velocity);
        state.dvl_scale_factor = scale;
        state.dvl_bias_mps = Vector4::new(0.01, -0.01, 0.02, 0.0);
        Case { geometry, mask, covariance: covariance(&seed, dvl), state, readings, sd, rate }
    }
}

fn update(case: &Case, aiding: BeamAiding, port: InformationPort, gate: Gate) -> (NavState, Covariance, f64) {
    let options = Options {
        gate,
        gate_probability: 0.9,
        assumptions: EXACT,
        information_port: port,
        robust: None,
        ..Options::default()
    };
    let mut navigator = Navigator::new(case.state, case.geometry.clone(), aiding, &model(), &options).unwrap();
    navigator.filter_mut().set_covariance(&case.covariance).unwrap();
    let imu = |time_ns| ImuSample {
        time_ns,
        rate_p_radps: Vec3::from_array(case.rate),
        force_p_mps2: Vec3::new(0.0, 0.0, -9.8),
    };
    navigator.push(&Event::Imu(imu(0)), &mut |_| {}).unwrap();
    navigator.push(&Event::Imu(imu(6_666_667)), &mut |_| {}).unwrap();
    let ping = BeamSample {
        time_ns: 6_666_667,
        velocity_mps: case.readings,
        sd_mps: case.sd,
        valid: case.mask,
    };
    let mut nis = 0.0;
    navigator
        .push(&Event::Beams(ping), &mut |report| nis = report.nis)
        .unwrap();
    (navigator.state(), navigator.covariance(), nis)
}

/// Largest difference in standard deviations (state) and relative to them (covariance).
fn gap(one: &(NavState, Covariance, f64), two: &(NavState, Covariance, f64)) -> f64 {
    let sd = |k: usize| one.1[(k, k)].sqrt();
    let error = one.0.error_of(&two.0);
    let mut worst = (one.2 - two.2).abs() / one.2.max(1.0);
    for i in (0..DIM).filter(|&i| sd(i) > 0.0) {
        worst = worst.max(error[i].abs() / sd(i));
        for j in (0..DIM).filter(|&j| sd(j) > 0.0) {
            worst = worst.max((one.1[(i, j)] - two.1[(i, j)]).abs() / (sd(i) * sd(j)));
        }
    }
    worst
}

/// Number of independent beams and their condition number, or `None` for a mask whose beams nearly lie in a plane or on a
/// line, where rounding dominates.
///
/// The bound of 30 on the condition number includes every real instrument (three beams at 20° have 3.9). A singular value of
/// 1e-7 of the largest is a direction that tight coupling reads and a fix leaves out, so only those of rounding are none.
fn rank_and_condition(geometry: &BeamGeometry, mask: BeamMask) -> Option<(usize, f64)> {
    let directions: Vec<_> = mask.iter().map(|beam| *geometry.direction_p(beam)).collect();
    if directions.is_empty() {
        return Some((0, 1.0));
    }
    let values = Matrix3xX::from_columns(&directions).singular_values();
    let largest = values.max();
    let seen: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| *value > 1e-13 * largest)
        .collect();
    let smallest = seen.iter().copied().fold(largest, f64::min);
    (smallest > largest / 30.0).then_some((seen.len(), largest / smallest))
}

fn rank(case: &Case) -> Option<usize> {
    Some(rank_and_condition(&case.geometry, case.mask)?.0)
}

const AXES: InformationPort = InformationPort::Axes;
/// The virtual beam with its correlation.
const EXACT: Assumptions = Assumptions {
    virtual_beam_factor: 1.0,
    exact_virtual_beams: true,
    nullified_sway_var_m2ps2: 1e-3,
    weak_sway_var_m2ps2: 2.0,
};

/// Random cases of a theorem, which is either right in nearly all of them or wrong in nearly all; twenty times as many
/// with `BOTTOMLOCK_LONG`, as `make test-long` sets it.
fn cases(quick: u32) -> u32 {
    if std::env::var_os("BOTTOMLOCK_LONG").is_some() {
        20 * quick
    } else {
        quick
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(5_000), max_global_rejects: 10_000_000, ..ProptestConfig::default() })]

    /// Any mask, redundant ones included, with DVL states and lever arms: the four updates are equal.
    #[test]
    fn four_names_for_one_update(case in case(true, true)) {
        prop_assume!(rank(&case).is_some());
        let tight = update(&case, BeamAiding::Tight, AXES, Gate::Off);
        let exact = update(&case, BeamAiding::Loose(PartialMethod::VirtualBeam), AXES, Gate::Off);
        let axes = update(&case, BeamAiding::Loose(PartialMethod::Information), AXES, Gate::Off);
        let full = update(&case, BeamAiding::Loose(PartialMethod::Information), InformationPort::Full, Gate::Off);
        prop_assert!(gap(&tight, &exact) < 1e-9, "exact VB {}", gap(&tight, &exact));
        prop_assert!(gap(&tight, &axes) < 1e-9, "axes {}", gap(&tight, &axes));
        prop_assert!(gap(&tight, &full) < 1e-9, "full {}", gap(&tight, &full));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(5_000), max_global_rejects: 10_000_000, ..ProptestConfig::default() })]

    /// Redundant beams without DVL states and lever arms: LC is TC too, but for the NIS, which includes the closure.
    #[test]
    fn a_velocity_without_dvl_states(case in case(false, false)) {
        prop_assume!(rank(&case) == Some(3));
        let tight = update(&case, BeamAiding::Tight, AXES, Gate::Off);
        let loose = update(&case, BeamAiding::Loose(PartialMethod::LeastSquares), AXES, Gate::Off);
        prop_assert!(gap(&tight, &(loose.0, loose.1, tight.2)) < 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(1_000), max_global_rejects: 10_000_000, ..ProptestConfig::default() })]

    /// The NIS is equal, so the decision of the joint gate is equal too.
    #[test]
    fn the_joint_gate_treats_them_alike(case in case(true, true)) {
        prop_assume!(rank(&case).is_some());
        let tight = update(&case, BeamAiding::Tight, AXES, Gate::Joint);
        let exact = update(&case, BeamAiding::Loose(PartialMethod::VirtualBeam), AXES, Gate::Joint);
        let axes = update(&case, BeamAiding::Loose(PartialMethod::Information), AXES, Gate::Joint);
        let full = update(&case, BeamAiding::Loose(PartialMethod::Information), InformationPort::Full, Gate::Joint);
        prop_assert!(gap(&tight, &exact) < 1e-9 && gap(&tight, &axes) < 1e-9 && gap(&tight, &full) < 1e-9);
    }

    /// LC = TC for three independent beams, with DVL states and lever arms.
    #[test]
    fn loose_is_tight_for_three_beams(case in case(true, true)) {
        prop_assume!(case.mask.count() == 3 && rank(&case) == Some(3));
        let tight = update(&case, BeamAiding::Tight, AXES, Gate::Off);
        let loose = update(&case, BeamAiding::Loose(PartialMethod::LeastSquares), AXES, Gate::Off);
        prop_assert!(gap(&tight, &loose) < 1e-9, "{}", gap(&tight, &loose));
    }
}

/// Pings with masks, wild beams and noise that vary from one to the next, through outlier treatment, gate and inflation: the
/// methods stay one filter.
///
/// Beside it the largest variance of the velocity over that of the beams' noise, by which an update multiplies rounding.
fn sequence(
    case: &Case,
    pings: &[(usize, [f64; MAX_BEAMS])],
    aiding: BeamAiding,
    port: InformationPort,
) -> ((NavState, Covariance, f64), f64) {
    let options = Options {
        gate_probability: 0.9,
        assumptions: EXACT,
        information_port: port,
        robust: Some(Robust::default()),
        inflate_after_rejections: 2,
        ..Options::default()
    };
    let mut navigator = Navigator::new(case.state, case.geometry.clone(), aiding, &model(), &options).unwrap();
    navigator.filter_mut().set_covariance(&case.covariance).unwrap();
    let (mut nis, mut variance_m2ps2) = (0.0, 0.0_f64);
    for (number, (bits, readings)) in pings.iter().enumerate() {
        let time_ns = number as i64 * 200_000_000;
        let imu = ImuSample {
            time_ns,
            rate_p_radps: Vec3::from_array(case.rate),
            force_p_mps2: Vec3::new(0.0, 0.0, -9.8),
        };
        navigator.push(&Event::Imu(imu), &mut |_| {}).unwrap();
        let ping = BeamSample {
            time_ns,
            velocity_mps: *readings,
            sd_mps: case.sd,
            valid: (0..case.geometry.beams()).filter(|k| bits & (1 << k) != 0).collect(),
        };
        navigator
            .push(&Event::Beams(ping), &mut |report| {
                nis += report.nis;
                variance_m2ps2 = variance_m2ps2.max(report.covariance.diagonal().max());
            })
            .unwrap();
        let velocity = navigator.covariance().fixed_view::<3, 3>(6, 6).into_owned();
        variance_m2ps2 = variance_m2ps2.max(velocity.diagonal().max());
    }
    let least_sd_mps = case.sd[..case.geometry.beams()]
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    (
        (navigator.state(), navigator.covariance(), nis),
        variance_m2ps2 / least_sd_mps.powi(2),
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(500), max_global_rejects: 10_000_000, ..ProptestConfig::default() })]

    /// Twelve pings, each with a mask of its own and a beam in five wild: one filter under four names.
    ///
    /// After inflations the velocity's σ may be 1e5 times that of a beam. Of 600,000 comparisons 2,500 were above 1e-9, and none
    /// above a tenth of the bound.
    #[test]
    fn masks_that_vary_and_beams_that_are_weighted(
        case in case(true, true),
        pings in prop::collection::vec((1_usize..32, prop::array::uniform8((-1.0_f64..1.0, 0_u8..5))), 12),
    ) {
        let readings = |one: [(f64, u8); MAX_BEAMS]| one.map(|(value, draw)| if draw == 0 { 10.0 * value } else { 0.3 * value });
        let pings: Vec<_> = pings.into_iter().map(|(bits, one)| (bits, readings(one))).collect();
        let conditions: Option<Vec<f64>> = pings
            .iter()
            .map(|(bits, _)| {
                let mask = (0..case.geometry.beams()).filter(|k| bits & (1 << k) != 0).collect();
                Some(rank_and_condition(&case.geometry, mask)?.1)
            })
            .collect();
        prop_assume!(conditions.is_some());
        let of_beams = conditions.unwrap().into_iter().fold(1.0, f64::max);
        let (tight, of_update) = sequence(&case, &pings, BeamAiding::Tight, AXES);
        let rounding = 1e-9 + 1e3 * f64::EPSILON * of_update * of_beams.powi(2);
        for (method, port) in [
            (PartialMethod::VirtualBeam, AXES),
            (PartialMethod::Information, AXES),
            (PartialMethod::Information, InformationPort::Full),
        ] {
            let (other, _) = sequence(&case, &pings, BeamAiding::Loose(method), port);
            prop_assert!(gap(&tight, &other) < rounding, "{method:?} {port:?}: {}", gap(&tight, &other));
        }
    }
}

/// The closure b1 − b2 + b3 − b4 of the x-Janus observes the beam biases under tight coupling, but not under LC.
#[test]
fn the_fourth_beam_informs_the_biases_under_tight_coupling_only() {
    let case = Case {
        geometry: BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap(),
        mask: BeamMask::all(4),
        covariance: Covariance::from_fn(|i, j| if i == j { SIZES[i].powi(2) } else { 0.0 }),
        state: NavState {
            velocity_p_mps: Vec3::new(2.0, 0.0, 0.0),
            ..NavState::at_rest(0)
        },
        readings: [0.5, -0.5, -0.5, 0.5, 0.0, 0.0, 0.0, 0.0],
        sd: [0.042; MAX_BEAMS],
        rate: [0.0; 3],
    };
    let tight = update(&case, BeamAiding::Tight, AXES, Gate::Off);
    let loose = update(&case, BeamAiding::Loose(PartialMethod::LeastSquares), AXES, Gate::Off);
    let closure = |p: &Covariance| {
        let signs = Vector4::new(0.5, -0.5, 0.5, -0.5);
        (signs.transpose() * p.fixed_view::<4, 4>(DVL_BIAS, DVL_BIAS) * signs)[0]
    };
    let before = closure(&case.covariance);
    assert!(
        (closure(&loose.1) - before).abs() < 1e-12 * before,
        "LC does not change the closure of the biases"
    );
    // A scalar update reduces the variance by P²/(P + R).
    let expected = before - before * before / (before + 0.042_f64.powi(2));
    assert!((closure(&tight.1) - expected).abs() < 1e-9 * before);
    let velocity = |p: &Covariance| p.fixed_view::<3, 3>(6, 6).into_owned();
    assert!(
        (velocity(&tight.1) - velocity(&loose.1)).amax() < 1e-12,
        "the velocity covariance is equal"
    );
    assert!(Vector3::from(tight.0.velocity_p_mps.0 - loose.0.velocity_p_mps.0).norm() < 1e-9);
}

//! Beams beyond the fourth: their biases are like those of the first four, by the order of the beams and by hand.

use super::*;
use crate::filter::level_turn::advance;
use crate::layout::MAX_BEAMS;
use crate::testing::*;

const BEAMS: [usize; MAX_BEAMS] = [0, 1, 2, 3, 4, 5, 6, 7];
const REVERSED: [usize; MAX_BEAMS] = [7, 6, 5, 4, 3, 2, 1, 0];

/// Eight beams in an order.
fn geometry(order: [usize; MAX_BEAMS]) -> BeamGeometry {
    let of = |number: &dyn Fn(usize) -> f64| order.map(number);
    let (tilts, azimuths) = (of(&|k| 0.3 + 0.03 * k as f64), of(&|k| 0.7 * k as f64));
    BeamGeometry::from_angles(&tilts, &azimuths).unwrap()
}

/// A ping of all beams in an order, each with a reading of its own.
fn ping(order: [usize; MAX_BEAMS], time_ns: i64) -> BeamSample {
    ping_of(
        time_ns,
        order.map(|k| 0.01 * ((7 * k) % 5) as f64),
        0.02,
        BeamMask::all(MAX_BEAMS),
    )
}

fn filter(beams: usize) -> Eskf {
    let mut model = Model::table_2();
    model.sensors.dvl.beam_bias_walk_mps_rts = 1e-3;
    Eskf::new(NavState::at_rest(0), &model, &Options::default())
        .unwrap()
        .with_beams(beams, &model, true)
}

/// Whichever beams are the first four, the estimate is the same, and each beam's bias with its variance.
#[test]
fn the_order_of_the_beams_does_not_matter() {
    let run = |order: [usize; MAX_BEAMS]| {
        let (mut filter, geometry) = (filter(MAX_BEAMS), geometry(order));
        for _ in 0..20 {
            advance(&mut filter, 100);
            let ping = ping(order, filter.time_ns());
            let terms = filter.beam_terms(&geometry, &ping);
            filter.update(&tightly_coupled(&terms, &ping), Sensor::Beams).unwrap();
        }
        filter
    };
    let (one, other) = (run(BEAMS), run(REVERSED));
    let states = 0..DVL_BIAS;
    assert!((one.state().velocity_p_mps.0 - other.state().velocity_p_mps.0).norm() < 1e-12);
    for (i, j) in states.clone().flat_map(|i| states.clone().map(move |j| (i, j))) {
        let (a, b) = (one.covariance()[(i, j)], other.covariance()[(i, j)]);
        assert!(
            (a - b).abs() < 1e-9 * (one.covariance()[(i, i)] * one.covariance()[(j, j)]).sqrt(),
            "{i} {j}: {a} {b}"
        );
    }
    for beam in 0..BIASED_BEAMS {
        let (in_20, further) = (DVL_BIAS + beam, block::BEAM_BIAS.first + BIASED_BEAMS - 1 - beam);
        let of_others = other.extensions.further();
        let (a, b) = (one.state().dvl_bias_mps[beam], of_others.estimate()[further]);
        assert!(a != 0.0 && (a - b).abs() < 1e-12, "beam {beam}: {a} {b}");
        let (a, b) = (
            one.covariance()[(in_20, in_20)],
            of_others.covariance()[(further, further)],
        );
        assert!((a / b - 1.0).abs() < 1e-9, "beam {beam}: {a} {b}");
    }
}

/// A residual falls by the bias as it is estimated, whose row is its derivative; there are as many biases as beams.
#[test]
fn a_residual_is_less_the_bias() {
    let (mut own, geometry) = (filter(6), geometry(BEAMS));
    let terms = |filter: &Eskf| filter.beam_terms(&geometry, &ping(BEAMS, 0));
    let before = terms(&own);
    let mut error = crate::aiding::further::FurtherVector::zeros();
    error[block::BEAM_BIAS.first + 1] = 0.25;
    own.extensions.further.as_mut().unwrap().inject(0.0, &error);
    let change = terms(&own).residual - before.residual;
    let rows = before.by_further.unwrap();
    for beam in 0..MAX_BEAMS {
        let expected = if beam == 5 { -0.25 } else { 0.0 };
        assert!((change[beam] - expected).abs() < 1e-15);
        assert_eq!(rows.row(beam).dot(&error.transpose()), -expected);
    }
    let variances = own.extensions.further().variance();
    let known = variances.rows(block::BEAM_BIAS.first, 4).map(|variance| variance > 0.0);
    assert_eq!(known.as_slice(), [true, true, false, false]);
    assert!(!filter(4).extensions.further().has(block::BEAM_BIAS));
}

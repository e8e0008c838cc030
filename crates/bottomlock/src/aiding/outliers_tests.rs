//! The gates and the weights by hand, and what one wild beam may do.

use super::*;
use crate::dvl::geometry::BeamMotion;
use crate::testing::*;
use proptest::prelude::*;

const SD: f64 = 0.04;

struct Case {
    geometry: BeamGeometry,
    state: NavState,
    covariance: Covariance,
    ping: BeamSample,
}

/// A Janus at 2 m/s with the velocity's standard deviation `velocity_sd` and readings off by `error`.
fn case(velocity_sd: f64, error: [f64; 4]) -> Case {
    let geometry = BeamGeometry::janus(Janus::X, 30_f64.to_radians()).unwrap();
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, 0.0);
    let motion = BeamMotion {
        velocity_p_mps: state.velocity_p_mps.0,
        omega_tp_p_radps: Vector3::zeros(),
        beam_bias_mps: [0.0; 4],
        scale_factor: 0.0,
    };
    let mut covariance = Model::table_2().initial_covariance(false);
    (0..3).for_each(|k| covariance[(VELOCITY + k, VELOCITY + k)] = velocity_sd.powi(2));
    let mut ping = ping_of(0, [f64::NAN; MAX_BEAMS], SD, BeamMask::all(4));
    (0..4).for_each(|beam| ping.velocity_mps[beam] = geometry.beam_velocity_mps(beam, &motion) + error[beam]);
    Case {
        geometry,
        state,
        covariance,
        ping,
    }
}

impl Case {
    fn terms(&self, ping: &BeamSample) -> BeamTerms {
        let motion = Motion::still(&self.state);
        beam_terms(&motion, &self.geometry, ping)
    }

    fn rows(&self) -> Rows {
        Rows::new(&self.covariance, &self.terms(&self.ping), &self.ping)
    }

    fn screened(&self, robust: &Robust) -> Screened {
        screen(
            robust,
            &self.geometry,
            &self.covariance,
            &self.terms(&self.ping),
            &self.ping,
        )
        .unwrap()
    }

    /// The correction of the velocity by what is left of the ping.
    fn correction(&self, robust: &Robust) -> Vector3<f64> {
        let ping = self.screened(robust).ping;
        if ping.valid.iter().next().is_none() {
            return Vector3::zeros();
        }
        let rows = Rows::new(&self.covariance, &self.terms(&ping), &ping);
        let h = tightly_coupled(&self.terms(&ping), &ping)
            .jacobian
            .rows(0, rows.z.len())
            .into_owned();
        let x = self.covariance * h.transpose() * rows.weight(&rows.r, 0).unwrap() * &rows.z;
        Vector3::new(x[VELOCITY], x[VELOCITY + 1], x[VELOCITY + 2])
    }
}

/// By hand: in a Janus b₁ − b₂ + b₃ − b₄ = 0, so closure is (e₁ − e₂ + e₃ − e₄)² / 4σ², whatever the velocity is.
#[test]
fn closure_of_a_janus() {
    for velocity_sd in [1e-3, 0.1, 10.0] {
        let error = [0.05, -0.02, 0.03, 0.01];
        let one = case(velocity_sd, error);
        let (statistic, degrees) = one.rows().closure(&one.geometry, 0).unwrap();
        assert_eq!(degrees, 1);
        assert!((statistic - 0.09_f64.powi(2) / (4.0 * SD * SD)).abs() < 1e-9);
        let mut moved = case(velocity_sd, error);
        moved.state.velocity_p_mps = Vec3::new(-3.0, 1.0, 0.5);
        assert!((moved.rows().closure(&moved.geometry, 0).unwrap().0 - statistic).abs() < 1e-9);
    }
    let mut three = case(0.1, [0.1, 0.0, 0.0, 0.0]);
    three.ping.valid = [0, 1, 3].into_iter().collect();
    assert_eq!(three.rows().closure(&three.geometry, 0).unwrap(), (0.0, 0));
}

/// The statistic of a beam is by how much the NIS falls when that beam is left out, worked out by leaving it out.
#[test]
fn leave_one_out_is_leaving_one_out() {
    let whole = case(0.07, [0.05, -0.12, 0.03, 0.3]);
    let doubts = whole.rows().leave_one_out(0).unwrap();
    for beam in 0..4 {
        let mut without = case(0.07, [0.05, -0.12, 0.03, 0.3]);
        without.ping.valid = (0..4).filter(|&other| other != beam).collect();
        assert!((doubts[beam] - (whole.rows().nis(0).unwrap() - without.rows().nis(0).unwrap())).abs() < 1e-9);
    }
}

/// Four equal beams cannot say which of them is wild; the navigator's prediction can, and closure lets it.
#[test]
fn the_wild_beam_is_the_one_that_goes() {
    let gates = [
        Robust {
            closure_gate: Some(0.9973),
            ..Robust::OFF
        },
        Robust {
            beam_gate: Some(0.9973),
            ..Robust::OFF
        },
    ];
    for robust in gates {
        for wild in 0..4 {
            let mut error = [0.02, -0.01, 0.015, -0.02];
            error[wild] += 1.7;
            let out = case(0.1, error).screened(&robust);
            let weights: [f64; 4] = std::array::from_fn(|beam| if beam == wild { 0.0 } else { 1.0 });
            assert_eq!(out.weight[..4], weights, "beam {wild}");
            assert!(!out.ping.valid.contains(wild) && out.ping.valid.count() > 0);
        }
        assert_eq!(
            case(0.1, [0.02, -0.01, 0.015, -0.02]).screened(&robust).weight[..4],
            [1.0; 4]
        );
    }
    // A single beam that is rejected: no beam is left, and the result says so.
    let mut one = case(0.01, [1.7, 0.0, 0.0, 0.0]);
    one.ping.valid = [0].into_iter().collect();
    assert!(one.screened(&gates[1]).ping.valid.count() == 0);
    assert!(
        one.screened(&gates[0]).ping.valid.count() == 1,
        "one beam contradicts no other"
    );
}

/// Where the prediction cannot tell which of four beams is wild, all keep their readings with the noise of their closure; by hand
/// e²/4σ² times their variance.
#[test]
fn a_wild_beam_that_does_not_stand_out_widens_all() {
    let robust = Robust {
        closure_gate: Some(0.9973),
        beam_gate: Some(0.9973),
        ..Robust::OFF
    };
    for wild in 0..4 {
        let mut error = [0.0; 4];
        error[wild] = 0.5;
        let out = case(10.0, error).screened(&robust);
        assert_eq!(out.ping.valid.count(), 4);
        for beam in 0..4 {
            assert!((out.weight[beam] * 0.25 / (4.0 * SD * SD) - 1.0).abs() < 1e-9);
        }
    }
}

/// Beams that agree with each other and all contradict the prediction: none is left, since more would go than stay. Two that are wild
/// alike, as by fish, go alone.
#[test]
fn more_beams_wrong_than_right_is_a_prediction_that_is_wrong() {
    let robust = Robust {
        tail: Tail::Gaussian,
        ..Robust::default()
    };
    let mut moved = case(0.02, [0.0; 4]);
    moved.state.velocity_p_mps = Vec3::new(1.0, -0.9, 0.2);
    let out = moved.screened(&robust);
    assert_eq!((out.ping.valid.count(), out.weight[..4].to_vec()), (0, vec![0.0; 4]));

    let fish = case(0.02, [0.6, 0.6, 0.0, 0.0]).screened(&robust);
    assert_eq!(fish.weight[..4], [0.0, 0.0, 1.0, 1.0]);
}

/// A vertical beam alone, with velocity variance p: with D = σ² (ν + 3)/(ν + 1) the weight solves the scalar equation
/// w = (ν + 1) / (ν + E[n²]/D), n | z of mean z N / (p² + N) and variance p² N / (p² + N), N = D/w.
#[test]
fn student_weight_of_one_beam() {
    let (p, z, degrees) = (0.1, 0.9, 4.0);
    let mut one = case(p, [0.0; 4]);
    one.geometry = BeamGeometry::from_directions(&[Vec3::new(0.0, 0.0, 1.0)]).unwrap();
    one.ping.velocity_mps[0] = z;
    one.ping.valid = BeamMask::all(1);
    let robust = Robust {
        tail: Tail::StudentT,
        student_t_degrees: degrees,
        ..Robust::OFF
    };
    let screened = one.screened(&robust);
    let (scale, noise) = (SD * SD * 7.0 / 5.0, screened.ping.sd_mps[0].powi(2));
    let (mean, variance) = (z * noise / (p * p + noise), p * p * noise / (p * p + noise));
    let w = (degrees + 1.0) / (degrees + (mean * mean + variance) / scale);
    assert!((noise / (scale / w) - 1.0).abs() < 1e-7);
    assert!((screened.weight[0] - SD * SD / noise).abs() < 1e-12 && screened.weight[0] < 0.1);
}

/// The closure test has as many degrees of freedom as beams are redundant, and begins at the tabulated 99 % quantile.
#[test]
fn closure_begins_at_its_quantile() {
    let robust = Robust {
        closure_gate: Some(0.99),
        ..Robust::OFF
    };
    for (beams, quantile) in [(4, 6.634_897), (5, 9.210_340)] {
        for (factor, passes) in [(0.999_f64, true), (1.001, false)] {
            let mut one = case(0.1, [0.0; 4]);
            let azimuths: Vec<f64> = (0..beams).map(|k| 1.2 * f64::from(k)).collect();
            one.geometry = BeamGeometry::from_angles(&vec![0.4; azimuths.len()], &azimuths).unwrap();
            one.ping.valid = BeamMask::all(azimuths.len());
            // An error of the first beam, of the size that gives the statistic.
            let expected: Vec<f64> = (0..azimuths.len())
                .map(|beam| one.geometry.direction_p(beam).dot(&one.state.velocity_p_mps.0))
                .collect();
            one.ping.velocity_mps[..azimuths.len()].copy_from_slice(&expected);
            one.ping.velocity_mps[0] += 1.0;
            let (unit, degrees) = one.rows().closure(&one.geometry, 0).unwrap();
            assert_eq!(degrees, azimuths.len() - 3);
            one.ping.velocity_mps[0] = expected[0] + (factor * quantile / unit).sqrt();
            let kept = one.screened(&robust).ping.valid.count();
            assert_eq!(
                kept == azimuths.len(),
                passes,
                "{beams} beams, {factor} of the quantile"
            );
        }
    }
}

/// As ν grows, the ping is left as it was.
#[test]
fn thin_tails_are_the_kalman_update() {
    let one = case(0.1, [0.05, -0.12, 0.03, 0.3]);
    let plain = one.correction(&Robust::OFF);
    let student = one.correction(&Robust {
        tail: Tail::StudentT,
        student_t_degrees: 1e12,
        ..Robust::OFF
    });
    assert!((student - plain).norm() < 1e-10);
    assert!(Robust::OFF.is_off());
}

/// Off is no gate and no tail; the default is not.
#[test]
fn off_changes_nothing() {
    assert!(Robust::OFF.is_off() && !Robust::default().is_off());
}

proptest! {
    /// Full lock and one beam off by anything at all. The correction is P Hᵀ S⁻¹ z, so it is bounded where each entry of S⁻¹ z is:
    /// by less than (ν + 1)/(2√ν σ) for Student's t, by √c/σ for a beam's own gate and by 2√c/σ for closure with c the quantile. The Kalman update has no bound: it is linear.
    #[test]
    fn one_wild_beam_moves_the_estimate_by_a_bound(
        wild in 0_usize..4,
        size in -3.0..6.0_f64,
        sign in prop::bool::ANY,
        velocity_sd in 0.01..0.5_f64,
    ) {
        let mut error = [0.0; 4];
        error[wild] = 10_f64.powf(size) * if sign { 1.0 } else { -1.0 };
        let one = case(velocity_sd, error);
        let pull: f64 = (0..4).map(|beam| velocity_sd.powi(2) * one.geometry.direction_p(beam).norm() / SD).sum();
        let (gate, root) = (Some(0.9973), quantile(1, 0.9973).sqrt());
        for (robust, bound) in [
            (Robust { tail: Tail::StudentT, student_t_degrees: 4.0, ..Robust::OFF }, 1.25),
            (Robust { beam_gate: gate, ..Robust::OFF }, root),
            (Robust { closure_gate: gate, ..Robust::OFF }, 2.0 * root),
        ] {
            let moved = one.correction(&robust).norm();
            prop_assert!(moved <= bound * pull * (1.0 + 1e-6), "{robust:?} moves {moved}");
            let weights = one.screened(&robust).weight;
            prop_assert!(weights[..4].iter().all(|weight| (0.0..=1.0).contains(weight)), "{weights:?}");
        }
        let plain = one.correction(&Robust::OFF).norm() / error[wild].abs();
        let unit = case(velocity_sd, [1.0, 0.0, 0.0, 0.0]).correction(&Robust::OFF).norm();
        prop_assert!((plain / unit - 1.0).abs() < 1e-6);
    }
}

/// A sound speed that is wrong by a factor scales readings and their noise: the same beams go, with the same weights.
#[test]
fn the_sound_speed_scales_all() {
    let factor = 1.25;
    let plain = case(0.05, [0.0, 0.1, 1.5, -0.05]);
    let mut scaled = case(0.05, [0.0, 0.1, 1.5, -0.05]);
    scaled.geometry = scaled.geometry.with_sound_speed_scale(factor).unwrap();
    for beam in 0..4 {
        scaled.ping.velocity_mps[beam] *= factor;
        scaled.ping.sd_mps[beam] *= factor;
    }
    let robust = Robust::default();
    let (plain, scaled) = (plain.screened(&robust), scaled.screened(&robust));
    assert_eq!(plain.ping.valid, scaled.ping.valid);
    assert_eq!(plain.ping.valid.count(), 3);
    for beam in plain.ping.valid.iter() {
        assert!((scaled.weight[beam] / plain.weight[beam] - 1.0).abs() < 1e-9);
        assert!((scaled.ping.sd_mps[beam] / plain.ping.sd_mps[beam] - factor).abs() < 1e-9);
    }
}

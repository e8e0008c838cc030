//! Counts, factors and bounds of the covariance inflation, by hand.

use super::*;
use crate::aiding::depth::depth;
use crate::aiding::velocity::velocity;
use crate::aiding::{beam_terms, tightly_coupled};
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use crate::filter::options::Options;
use crate::frames::Vec3;
use crate::model::Model;
use crate::state::NavState;

/// By hand: factors 4, 9 and 6 have the geometric mean 6; the count then begins anew.
#[test]
fn factor_is_the_geometric_mean_over_consecutive_rejections() {
    let mut count = Count::default();
    let factors: Vec<_> = [4.0, 9.0, 6.0, 5.0]
        .map(|factor| count.rejection(factor, Vector3::x(), 3, 7))
        .into_iter()
        .map(|factor| factor.map(|factor| (factor * 1e9_f64).round() / 1e9))
        .collect();
    assert_eq!(factors, [None, None, Some(6.0), None]);
    assert_eq!((count.measurements, count.since_ns), (1, 7));
}

/// By hand: σ 2 m, noise 0.5 m, 10 m off: 100/(0.25 + 4 f) = 1 gives f = 24.9375.
///
/// Only the depth is inflated, which no other state notices.
#[test]
fn depth_inflates_itself_alone() {
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let before = filter.covariance();
    let innovation = depth(&filter.state(), 10.0, 0.5, &Vec3::from_array([0.0; 3]));
    assert_eq!(
        filter
            .note_rejected(&innovation, Sensor::Depth, BelievedError::Any)
            .unwrap(),
        None
    );
    let factor = filter
        .note_rejected(&innovation, Sensor::Depth, BelievedError::Any)
        .unwrap()
        .unwrap();
    assert!((factor - 24.9375).abs() < 2e-3, "{factor}");
    let mut expected = before;
    expected[(POSITION + 2, POSITION + 2)] *= factor;
    assert_eq!(filter.covariance(), expected);
}

/// A position where a velocity was accepted since the first rejection inflates the position alone, else all
/// inertial states.
#[test]
fn position_inflates_all_states_where_no_velocity_aids() {
    for has_velocity in [false, true] {
        let options = Options {
            inflate_after_rejections: 2,
            ..Options::default()
        };
        let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
        let far = crate::aiding::position::position(
            &filter.state(),
            &Vec3::from_array([50.0, 0.0, 0.0]),
            &[1.0; 3],
            &Vec3::from_array([0.0; 3]),
        );
        let before = filter.covariance();
        assert_eq!(
            filter
                .note_rejected(&far, Sensor::AcousticPosition, BelievedError::Any)
                .unwrap(),
            None
        );
        if has_velocity {
            filter.measured.velocity_ns = Some(0);
        }
        let factor = filter
            .note_rejected(&far, Sensor::AcousticPosition, BelievedError::Any)
            .unwrap()
            .unwrap();
        let after = filter.covariance();
        assert!(factor > 100.0 && after[(0, 0)] == before[(0, 0)] * factor);
        let kept = after[(ATTITUDE, ATTITUDE)] == before[(ATTITUDE, ATTITUDE)];
        assert_eq!(kept, has_velocity);
    }
}

/// A measurement within its gate resets the count, an assumption never counts.
#[test]
fn only_rejections_of_sensors_count() {
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let at = |filter: &Eskf, depth_m: f64| depth(&filter.state(), depth_m, 0.5, &Vec3::from_array([0.0; 3]));
    for depth_m in [10.0, 0.1, 10.0] {
        let innovation = at(&filter, depth_m);
        assert_eq!(
            filter
                .note_rejected(&innovation, Sensor::Depth, BelievedError::Any)
                .unwrap(),
            None,
            "{depth_m}"
        );
        assert_eq!(
            filter
                .note_rejected(&innovation, Sensor::Sway, BelievedError::Any)
                .unwrap(),
            None,
            "{depth_m}"
        );
    }
}

/// A filter that inflates after two rejections.
fn filter(model: &Model) -> Eskf {
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    Eskf::new(NavState::at_rest(0), model, &options).unwrap()
}

/// By hand: a velocity 5 m/s off with σ 0.05 m/s on both sides, 25/(0.0025 (1 + f)) = 3 + 25/2500 gives f = 3321. Five sigma of
/// it, 25 of the variance, go to all inertial states, the rest to the velocity alone; but no attitude sigma exceeds 1 rad and no
/// position sigma 1000 km, where a σ of a half then gets a factor of four.
#[test]
fn what_is_not_measured_is_inflated_to_a_bound() {
    let with = |attitude_sd_rad: f64, position_sd_m: f64| {
        let mut model = Model::table_2();
        model.initial.attitude_sd_rad = [attitude_sd_rad; 3];
        model.initial.position_sd_m = [position_sd_m; 3];
        let mut filter = filter(&model);
        let off = Vec3::new(3.0, 4.0, 0.0);
        let innovation = velocity(&filter.state(), &off, &(nalgebra::Matrix3::identity() * 0.0025));
        let before = filter.covariance();
        assert_eq!(
            filter
                .note_rejected(&innovation, Sensor::Velocity, BelievedError::Any)
                .unwrap(),
            None
        );
        let factor = filter
            .note_rejected(&innovation, Sensor::Velocity, BelievedError::Any)
            .unwrap()
            .unwrap();
        let after = filter.covariance();
        let ratio = |k: usize| after[(k, k)] / before[(k, k)];
        assert!((factor / 3321.0 - 1.0).abs() < 1e-3, "{factor}");
        assert!((ratio(VELOCITY) / factor - 1.0).abs() < 1e-12);
        assert!((ratio(ATTITUDE) / ratio(POSITION) - 1.0).abs() < 1e-12);
        ratio(ATTITUDE)
    };
    for (attitude_sd_rad, position_sd_m, expected) in [(0.02, 2.0, 25.0), (0.5, 2.0, 4.0), (0.02, 5e5, 4.0)] {
        let factor = with(attitude_sd_rad, position_sd_m);
        assert!((factor / expected - 1.0).abs() < 1e-12, "{factor} {expected}");
    }
}

/// By hand: a velocity with σ 0.05 m/s on both sides, of five sigma S = 0.0025 (1 + 25), whose 99.73 % reach to
/// √(0.065 · 14.156) = 0.959 m/s. What is further off does not count unless any error is believed.
#[test]
fn beyond_what_is_believed_nothing_counts() {
    let inflates = |off_mps: f64, believed: BelievedError| {
        let mut filter = filter(&Model::table_2());
        let off = Vec3::new(0.6 * off_mps, 0.8 * off_mps, 0.0);
        let innovation = velocity(&filter.state(), &off, &(nalgebra::Matrix3::identity() * 0.0025));
        let factors: [Option<f64>; 6] =
            std::array::from_fn(|_| filter.note_rejected(&innovation, Sensor::Beams, believed).unwrap());
        factors.iter().any(Option::is_some)
    };
    assert!(inflates(0.955, BelievedError::FiveSigma));
    assert!(!inflates(0.965, BelievedError::FiveSigma));
    assert!(inflates(0.965, BelievedError::Any) && inflates(5.0, BelievedError::Any));
}

/// Beams that contradict each other are explained by no covariance and never count; beams that agree do, and so do those
/// whose contradiction is within noise and bias: closure e has e²/(4 (0.04² + 0.005²)), 15.8 for 0.32 m/s and 16.8 for 0.33,
/// and the 99.73 % quantile of four degrees of freedom is 16.25.
#[test]
fn only_what_a_covariance_explains_counts() {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let inflates = |error: [f64; 4]| {
        let mut filter = filter(&Model::table_2());
        let mut ping = BeamSample {
            time_ns: 0,
            velocity_mps: [0.0; MAX_BEAMS],
            sd_mps: [0.04; MAX_BEAMS],
            valid: BeamMask::all(4),
        };
        ping.velocity_mps[..4].copy_from_slice(&error);
        let innovation = filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping));
        let factors: [Option<f64>; 6] = std::array::from_fn(|_| {
            filter
                .note_rejected(&innovation, Sensor::Beams, BelievedError::Any)
                .unwrap()
        });
        factors.iter().any(Option::is_some)
    };
    assert!(inflates([1.2, -1.2, -1.2, 1.2]), "surge alone");
    assert!(!inflates([1.2, -1.2, 1.2, -1.2]), "closure alone");
    assert!(inflates([1.2 + 0.32, -1.2, -1.2, 1.2]), "surge and a doubtful beam");
    assert!(!inflates([1.2 + 0.33, -1.2, -1.2, 1.2]), "surge and an outlier");
}

//! What the row of a yaw leaves out, against the nonlinear yaw; when it is withheld.

use nalgebra::Matrix2;

use super::*;
use crate::testing::*;

const YAW_RAD: f64 = -1.1;

/// A filter at a pitch whose tilt has the standard deviations `sd` about north and east, and a correlation.
fn filter(pitch_deg: f64, sd: [f64; 2], correlation: f64) -> Eskf {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.4, pitch_deg.to_radians(), YAW_RAD);
    let mut filter = Eskf::new(state, &Model::table_2(), &Options::default()).unwrap();
    let mut covariance = filter.covariance();
    let cross = correlation * sd[0] * sd[1];
    covariance
        .fixed_view_mut::<2, 2>(ATTITUDE, ATTITUDE)
        .copy_from(&Matrix2::new(sd[0] * sd[0], cross, cross, sd[1] * sd[1]));
    filter.set_covariance(&covariance).unwrap();
    filter
}

fn verdict(pitch_deg: f64, tilt_sd: f64, yaw_sd: f64) -> Verdict {
    let mut filter = filter(pitch_deg, [tilt_sd; 2], 0.0);
    let innovation = heading(&Motion::still(&filter.state()), YAW_RAD, yaw_sd);
    filter.update(&innovation, Sensor::Heading).unwrap().verdict
}

/// The root mean square of what the row leaves out of the yaw, over drawn tilts, is that of the third term.
#[test]
fn the_third_term_is_what_the_row_leaves_out() {
    for (pitch_deg, sd, correlation) in [(82.0, [0.01, 0.004], 0.6), (-84.0, [0.005, 0.005], 0.0)] {
        let filter = filter(pitch_deg, sd, correlation);
        let mut draws = Normals::new([7; 32], 1);
        let (mut sum, count) = (0.0, 4000);
        for _ in 0..count {
            let drawn = draws.each(&[1.0; 3]);
            let mut error = ErrorVector::zeros();
            error[ATTITUDE] = sd[0] * drawn.x;
            error[ATTITUDE + 1] = sd[1] * (correlation * drawn.x + (1.0 - correlation * correlation).sqrt() * drawn.y);
            let mut truth = filter.state();
            truth.inject(&error);
            let innovation = heading(
                &Motion::still(&filter.state()),
                truth.attitude_t_p.to_euler_rad()[2],
                0.02,
            );
            sum += (innovation.residual[0] - (innovation.jacobian.row(0) * error)[0]).powi(2);
        }
        let drawn = (sum / f64::from(count)).sqrt();
        let innovation = heading(&Motion::still(&filter.state()), YAW_RAD, 0.02);
        let stated = filter.neglected_yaw_variance(&innovation).sqrt();
        assert!(
            (drawn / stated - 1.0).abs() < 0.1,
            "pitch {pitch_deg}: {drawn} {stated}"
        );
    }
}

/// By hand: tilt of 1 mrad about both axes, so that the third term is 1e-6 tan²θ: 0.02 rad at tan θ = 141, θ = 89.59°.
#[test]
fn a_yaw_is_withheld_where_the_third_term_exceeds_its_noise() {
    for sign in [1.0, -1.0] {
        assert_eq!(verdict(sign * 89.58, 1e-3, 0.02), Verdict::Accepted);
        assert_eq!(verdict(sign * 89.61, 1e-3, 0.02), Verdict::Withheld);
        assert_eq!(verdict(sign * 90.0, 1e-3, 0.02), Verdict::Withheld);
        // A better tilt, or a worse compass, goes nearer.
        assert_eq!(verdict(sign * 89.61, 0.5e-3, 0.02), Verdict::Accepted);
        assert_eq!(verdict(sign * 89.61, 1e-3, 0.05), Verdict::Accepted);
    }
    // Level, the tilt does not matter at all.
    assert_eq!(verdict(0.0, 0.5, 1e-3), Verdict::Accepted);
}

/// A yaw that is withheld changes nothing and says so.
#[test]
fn a_withheld_yaw_changes_nothing() {
    let mut filter = filter(90.0, [1e-3; 2], 0.0);
    let (state, covariance) = (filter.state(), filter.covariance());
    let innovation = heading(&Motion::still(&filter.state()), 2.0, 0.02);
    let report = filter.update(&innovation, Sensor::Heading).unwrap();
    assert_eq!((report.verdict, report.rows), (Verdict::Withheld, 0));
    assert!(!report.was_used());
    assert_eq!((filter.state(), filter.covariance()), (state, covariance));
}

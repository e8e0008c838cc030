//! Methods from outside the kernel: what they give, and what is refused; `tests/laws/own_method.rs` copies a built-in one.

use super::*;
use crate::navigator::Snapshot;
use crate::replay::tests::Recording;
use crate::testing::*;

/// Returns what it holds.
struct Returns(Result<Measured, String>);

impl BeamMethod for Returns {
    fn ping(&self, _: &PingBeams<'_>, _: &PingPrior<'_>) -> Result<Measured, String> {
        self.0.clone()
    }
}

/// A fix of three components from the beams alone, with white errors.
struct WhiteFix;

impl BeamMethod for WhiteFix {
    fn ping(&self, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> Result<Measured, String> {
        let noise: BeamNoise = beams.terms.noise;
        let method = PartialMethod::LeastSquares;
        let fix = fix_estimator(
            method,
            beams.geometry,
            beams.ping.valid,
            &noise,
            None,
            &Assumptions::default(),
        );
        let fix = fix.map_err(|error| error.to_string())?;
        if !(0..3).all(|k| fix.is_solved(k)) {
            return Ok(Measured::Nothing);
        }
        let gain = fix.gain.fixed_columns::<MAX_ROWS>(0);
        Ok(Measured::Fix {
            velocity_p_mps: prior.state.velocity_p_mps.0 + gain * beams.terms.residual,
            cov_m2ps2: fix.covariance,
        })
    }
}

fn one_row() -> MeasuredRows {
    MeasuredRows {
        rows: 1,
        residual: SVector::zeros(),
        jacobian: RowJacobian::zeros(),
        noise: SMatrix::identity(),
    }
}

/// The navigator of a method along a recording.
fn run(method: &Method, turn: &Recording) -> Result<Navigator, NavError> {
    let options = Options::default();
    let mut navigator = Navigator::new(turn.start, turn.geometry.clone(), method.aiding, &turn.model, &options)?;
    let mut pings = turn.pings.iter().peekable();
    for sample in &turn.imu {
        while let Some(ping) = pings.next_if(|ping| ping.time_ns <= sample.time_ns) {
            navigator.push(&Event::Beams(*ping), &mut |_| {})?;
        }
        navigator.push(&Event::Imu(*sample), &mut |_| {})?;
    }
    Ok(navigator)
}

/// A fix goes in as a velocity, and a ping without one leaves the filter as it was.
#[test]
fn a_fix_is_a_velocity() {
    let turn = steady_turn(20);
    let fixed = run(&register("white_fix", Box::new(WhiteFix)).unwrap(), &turn).unwrap();
    let alone = run(&METHODS[0], &turn).unwrap();
    assert!(fixed.covariance()[(7, 7)] < 0.3 * alone.covariance()[(7, 7)]);
    let nothing = register("nothing", Box::new(Returns(Ok(Measured::Nothing)))).unwrap();
    assert_eq!(run(&nothing, &turn).unwrap().state(), alone.state());
}

/// What is no measurement ends the run, with the name and the time of the ping.
#[test]
fn what_is_no_measurement_is_refused() {
    let turn = steady_turn(3);
    let fix = |velocity: f64, variance: f64| Measured::Fix {
        velocity_p_mps: Vector3::repeat(velocity),
        cov_m2ps2: Matrix3::identity() * variance,
    };
    let rows = |change: fn(&mut MeasuredRows)| {
        let mut rows = one_row();
        change(&mut rows);
        Ok(Measured::Rows(rows))
    };
    let cases = [
        (Err("ValueError: no".into()), "ValueError: no"),
        (Ok(fix(f64::NAN, 1.0)), "Returns: velocity_p_mps at"),
        (Ok(fix(1.0, -1.0)), "Returns: cov_m2ps2 at"),
        (Ok(fix(1.0, f64::INFINITY)), "Returns: cov_m2ps2 at"),
        (rows(|rows| rows.rows = 9), "Returns: rows: got 9, expected at most 8"),
        (rows(|rows| rows.noise = SMatrix::zeros()), "Returns: noise at"),
        (
            rows(|rows| rows.residual = SVector::repeat(f64::NAN)),
            "Returns: residual at",
        ),
        (
            rows(|rows| rows.jacobian = RowJacobian::repeat(f64::NAN)),
            "Returns: jacobian at",
        ),
        (
            rows(|rows| (rows.rows, rows.noise[(0, 1)]) = (2, 0.5)),
            "Returns: noise at",
        ),
    ];
    for (returned, words) in cases {
        let method = register("refused", Box::new(Returns(returned))).unwrap();
        let text = run(&method, &turn).unwrap_err().to_string();
        assert!(text.starts_with("refused at ") && text.contains(words), "{text}");
    }
}

/// Names of built-in methods are taken, and odd ones refused.
#[test]
fn names_are_checked() {
    for name in ["tc", "", "My_method", "a:b", "a b", &"x".repeat(41)] {
        let refused = register(name, Box::new(Returns(Ok(Measured::Nothing))))
            .unwrap_err()
            .to_string();
        assert!(refused.contains("that are no built-in method"), "{refused}");
    }
    assert!(Method::named("never_registered").is_err());
}

/// A saved navigator knows its method by name, and is refused where there is none of that name.
#[test]
fn a_saved_navigator_needs_its_method() {
    let turn = steady_turn(3);
    let method = register("saved", Box::new(Returns(Ok(Measured::Nothing)))).unwrap();
    let live = || {
        let options = Options::default();
        crate::navigator::LiveNavigator::new(turn.start, &turn.geometry, method.aiding, &turn.model, &options, 0)
            .unwrap()
    };
    let bytes = Snapshot {
        live: live(),
        sensors: turn.model.sensors,
    }
    .to_bytes()
    .unwrap();
    assert_eq!(
        Snapshot::from_bytes(&bytes).unwrap().live.navigator().state(),
        live().navigator().state()
    );
    ENTRIES.write().unwrap().retain(|one| one.0.name != "saved");
    let refused = Snapshot::from_bytes(&bytes).unwrap_err().to_string();
    assert!(refused.contains("register it first"), "{refused}");
}

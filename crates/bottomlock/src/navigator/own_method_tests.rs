//! Methods from outside the kernel: copies of built-in ones, and what is refused.

use super::*;
use crate::navigator::Snapshot;
use crate::replay::tests::Recording;
use crate::testing::*;

/// The rows of tight coupling, as a user would write them.
struct TightCopy;

impl BeamMethod for TightCopy {
    fn ping(&self, beams: &PingBeams<'_>, _: &PingPrior<'_>) -> Result<Measured, String> {
        let mut rows = no_rows();
        for beam in beams.ping.valid.iter() {
            rows.residual[rows.rows] = beams.terms.residual[beam];
            let row = beams.terms.jacobian.row(beam).into_owned();
            rows.jacobian.set_row(rows.rows, &row);
            for (place, other) in beams.ping.valid.iter().enumerate() {
                rows.noise[(rows.rows, place)] = beams.terms.noise[(beam, other)];
            }
            rows.rows += 1;
        }
        Ok(Measured::Rows(rows))
    }
}

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

fn no_rows() -> MeasuredRows {
    MeasuredRows {
        rows: 0,
        residual: SVector::zeros(),
        jacobian: RowJacobian::zeros(),
        noise: SMatrix::zeros(),
    }
}

fn one_row() -> MeasuredRows {
    MeasuredRows {
        rows: 1,
        noise: SMatrix::identity(),
        ..no_rows()
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

/// The same rows are the same bits, under the method's own name.
#[test]
fn a_copy_of_tight_coupling_is_tight_coupling() {
    let turn = steady_turn(20);
    let own = register("tight_copy", Box::new(TightCopy)).unwrap();
    assert_eq!((own.name, Method::named("tight_copy").unwrap()), ("tight_copy", own));
    let (copy, built_in) = (run(&own, &turn).unwrap(), run(&METHODS[2], &turn).unwrap());
    assert_eq!(copy.state(), built_in.state());
    assert_eq!(copy.covariance(), built_in.covariance());
    assert_ne!(copy.state(), run(&METHODS[0], &turn).unwrap().state());
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
    let mut skew = one_row();
    skew.rows = 2;
    skew.noise[(0, 1)] = 0.5;
    let cases = [
        (Err("ValueError: no".into()), "ValueError: no"),
        (Ok(fix(f64::NAN, 1.0)), "Returns: velocity_p_mps at"),
        (Ok(fix(1.0, -1.0)), "Returns: cov_m2ps2 at"),
        (Ok(fix(1.0, f64::INFINITY)), "Returns: cov_m2ps2 at"),
        (
            Ok(Measured::Rows(MeasuredRows { rows: 9, ..one_row() })),
            "Returns: rows: got 9, expected at most 8",
        ),
        (
            Ok(Measured::Rows(MeasuredRows {
                noise: SMatrix::zeros(),
                ..one_row()
            })),
            "Returns: noise at",
        ),
        (
            Ok(Measured::Rows(MeasuredRows {
                residual: SVector::repeat(f64::NAN),
                ..one_row()
            })),
            "Returns: residual at",
        ),
        (
            Ok(Measured::Rows(MeasuredRows {
                jacobian: RowJacobian::repeat(f64::NAN),
                ..one_row()
            })),
            "Returns: jacobian at",
        ),
        (Ok(Measured::Rows(skew)), "Returns: noise at"),
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
        let refused = register(name, Box::new(TightCopy)).unwrap_err().to_string();
        assert!(refused.contains("that are no built-in method"), "{refused}");
    }
    assert!(Method::named("never_registered").is_err());
}

/// A saved navigator knows its method by name, and is refused where there is none of that name.
#[test]
fn a_saved_navigator_needs_its_method() {
    let turn = steady_turn(3);
    let method = register("saved", Box::new(TightCopy)).unwrap();
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

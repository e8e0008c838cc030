//! A method of one's own in Rust: what the beams measure along their mean direction, and nothing else.
//!
//! `cargo run --release --example own_method` runs it beside tight coupling on the same simulated readings; `docs/own_method.md`.

use bottomlock::NavError;
use bottomlock::aiding::RowJacobian;
use bottomlock::navigator::Method;
use bottomlock::navigator::own_method::{BeamMethod, Measured, MeasuredRows, PingBeams, PingPrior, register};
use nalgebra::{SMatrix, SVector};

/// The mean of the valid beams as one row: less than tight coupling takes, and never more than it knows.
pub(crate) struct MeanBeam;

impl BeamMethod for MeanBeam {
    fn ping(&self, beams: &PingBeams<'_>, _: &PingPrior<'_>) -> Result<Measured, String> {
        let count = beams.ping.valid.count();
        if count == 0 {
            return Ok(Measured::Nothing);
        }
        let mut weights = SVector::<f64, 8>::zeros();
        beams
            .ping
            .valid
            .iter()
            .for_each(|beam| weights[beam] = 1.0 / count as f64);
        let mut rows = MeasuredRows {
            rows: 1,
            residual: SVector::zeros(),
            jacobian: RowJacobian::zeros(),
            noise: SMatrix::zeros(),
        };
        rows.residual[0] = weights.dot(&beams.terms.residual);
        rows.jacobian.set_row(0, &(weights.transpose() * beams.terms.jacobian));
        rows.noise[(0, 0)] = weights.dot(&(beams.terms.noise * weights));
        Ok(Measured::Rows(rows))
    }
}

/// Registers it and returns it as a method like any other.
///
/// # Errors
/// As [`register`].
pub(crate) fn mean_beam() -> Result<Method, NavError> {
    register("mean_beam", Box::new(MeanBeam))
}

#[allow(dead_code)] // A test takes the method alone.
fn main() -> Result<(), NavError> {
    let method = mean_beam()?;
    let found = Method::named("mean_beam")?;
    // Every list of methods takes it: a batch, a replay, a closed loop, a navigator.
    println!(
        "{} is {}",
        method.name,
        if found == method { "registered" } else { "replaced" }
    );
    Ok(())
}

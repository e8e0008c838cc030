//! Laws of methods from outside the kernel, with the example as one: same readings as the others, same bits on any thread.

#[path = "../../examples/own_method.rs"]
mod example;

use crate::common::*;
use bottomlock::navigator::own_method::{BeamMethod, Measured, MeasuredRows, PingBeams, PingPrior, register};
use bottomlock::simulation::batch::run_batch;

/// Tight coupling, written again.
struct Tight;

impl BeamMethod for Tight {
    fn ping(&self, beams: &PingBeams<'_>, _: &PingPrior<'_>) -> Result<Measured, String> {
        let valid: Vec<usize> = beams.ping.valid.iter().collect();
        let mut rows = MeasuredRows {
            rows: valid.len(),
            residual: SVector::zeros(),
            jacobian: SMatrix::zeros(),
            noise: SMatrix::zeros(),
        };
        for (row, &beam) in valid.iter().enumerate() {
            rows.residual[row] = beams.terms.residual[beam];
            rows.jacobian.set_row(row, &beams.terms.jacobian.row(beam));
            for (column, &other) in valid.iter().enumerate() {
                rows.noise[(row, column)] = beams.terms.noise[(beam, other)];
            }
        }
        Ok(Measured::Rows(rows))
    }
}

/// Errors of the velocity at the end, RMS over runs, of each method.
fn velocity_rms(records: &[Vec<bottomlock::simulation::batch::MethodRecord>], method: usize) -> f64 {
    let squares = records.iter().map(|run| {
        let last = run[method].error.last().unwrap();
        last[6..9].iter().map(|part| part * part).sum::<f64>()
    });
    (squares.sum::<f64>() / records.len() as f64).sqrt()
}

/// A copy of a built-in method has its bits, also beside others and on several threads; the others do not notice it.
#[test]
fn a_copy_of_a_built_in_method_has_its_bits() {
    let (turn, epochs, model, options, geometry) = eight_seconds();
    let schedules = [epochs.schedule()];
    let own = register("tight_again", Box::new(Tight)).unwrap();
    let methods = [METHODS[0], own, METHODS[2]];
    let with_own = Batch {
        methods: &methods,
        ..batch(&turn, &epochs, &schedules, &model, &options, &geometry)
    };
    let records = run_batch(&with_own, 2).unwrap();
    let only = |k: usize| records.iter().map(|run| vec![run[k].clone()]).collect::<Vec<_>>();
    assert_eq!(bits(&only(1)), bits(&only(2)));
    assert_eq!(bits(&records), bits(&run_batch(&with_own, 1).unwrap()));
    let without = Batch {
        methods: &[METHODS[0], METHODS[2]],
        ..with_own
    };
    let built_in: Vec<_> = records.iter().map(|run| vec![run[0].clone(), run[2].clone()]).collect();
    assert_eq!(bits(&built_in), bits(&run_batch(&without, 2).unwrap()));
}

/// The example flies under its name: better than nothing, worse than all rows.
#[test]
fn the_example_flies() {
    let (turn, epochs, model, options, geometry) = eight_seconds();
    let schedules = [epochs.schedule()];
    let methods = [METHODS[0], example::mean_beam().unwrap(), METHODS[2]];
    assert_eq!(Method::named("mean_beam").unwrap(), methods[1]);
    let all = Batch {
        methods: &methods,
        runs: 32,
        ..batch(&turn, &epochs, &schedules, &model, &options, &geometry)
    };
    let records = run_batch(&all, 0).unwrap();
    assert!(velocity_rms(&records, 1) < velocity_rms(&records, 0));
    assert!(velocity_rms(&records, 2) < velocity_rms(&records, 1));
}

/// Fails at the third ping.
struct Fails;

impl BeamMethod for Fails {
    fn ping(&self, beams: &PingBeams<'_>, _: &PingPrior<'_>) -> Result<Measured, String> {
        if beams.ping.time_ns > 2_900_000_000 {
            return Err("no more".into());
        }
        Ok(Measured::Nothing)
    }
}

/// An error names run, method, time and type, and ends the batch.
#[test]
fn an_error_names_its_ping() {
    let (turn, epochs, model, options, geometry) = eight_seconds();
    let schedules = [epochs.schedule()];
    let methods = [register("fails", Box::new(Fails)).unwrap()];
    let all = Batch {
        methods: &methods,
        ..batch(&turn, &epochs, &schedules, &model, &options, &geometry)
    };
    let error = run_batch(&all, 1).unwrap_err().to_string();
    assert!(
        error.starts_with("run 0, method fails: fails at 2996858408 ns: "),
        "{error}"
    );
    assert!(error.ends_with("Fails: no more"), "{error}");
}

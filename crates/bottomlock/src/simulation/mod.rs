//! Monte Carlo simulation: truth, sensor errors, runs, batches of runs, and closed loops.

pub mod batch;
pub mod closed_loop;
mod epochs;
mod method_record;
pub mod monte_carlo_run;
pub mod owned_schedule;
mod run_group;
pub mod schedule;
pub mod sensor_errors;
pub mod sensor_streams;
pub mod truth;

//! Result arrays of a batch.

use std::iter::repeat;

use bottomlock::aiding::registry::SENSORS;
use bottomlock::dvl::fix_row::source_code;
use bottomlock::filter::report::Choice;
use bottomlock::simulation::monte_carlo_run::{BiasRecord, MethodRecord};
use bottomlock::simulation::schedule::Schedule;
use numpy::PyArrayMethods;

use crate::arrays::array;
use crate::memory::product;
use crate::prelude::*;

/// Code for a method that does not select.
pub const NO_CHOICE: u8 = u8::MAX;

/// Codes of a selection: the sources of surge, sway and heave.
pub fn choice_code(choice: &Choice) -> [u8; 3] {
    choice.map(source_code)
}

/// Number of recorded error states: position, misalignment and velocity.
const ERRORS: usize = 9;
/// Number of biases of accelerometers and gyros.
const BIASES: usize = 6;

/// The result arrays of a batch, filled while the runs are computed.
pub struct BatchArrays {
    /// Runs, methods and samples.
    shape: [usize; 3],
    /// Error state by error state, as the columns of a table.
    error: Vec<f64>,
    sd: Vec<f64>,
    nees: Vec<f64>,
    nees_velocity_attitude: Vec<f64>,
    /// What is stated once for each run and method.
    totals: Vec<MethodRecord>,
    /// The number of selections is known when the runs are finished.
    choices: Vec<Vec<[u8; 3]>>,
}

/// Memory of a batch, bytes: its arrays, its records, and what goes with each run.
pub fn batch_bytes(runs: usize, methods: usize, samples: usize) -> u128 {
    const NUMBER: usize = size_of::<f64>();
    // Of the arrays and of the records: errors, their standard deviations and two NEES a sample.
    let of_samples = product(&[runs, methods, samples, 2 * (2 * ERRORS + 2), NUMBER]);
    let of_method = size_of::<MethodRecord>() + size_of::<Vec<[u8; 3]>>();
    let of_run = size_of::<usize>() + size_of::<Schedule<'_>>() + 2 * SENSORS * size_of::<Vec<i64>>();
    of_samples
        .saturating_add(product(&[runs, methods, of_method]))
        .saturating_add(product(&[runs, of_run]))
}

impl BatchArrays {
    /// Arrays of zeros for so many runs, methods and samples.
    pub fn new(shape: [usize; 3]) -> Self {
        let (each, zeros) = (shape[0] * shape[1], |width: usize| {
            vec![0.0; shape.iter().product::<usize>() * width]
        });
        Self {
            shape,
            error: zeros(ERRORS),
            sd: zeros(ERRORS),
            nees: zeros(1),
            nees_velocity_attitude: zeros(1),
            totals: vec![MethodRecord::default(); each],
            choices: vec![Vec::new(); each],
        }
    }

    /// Takes the records of a run, method by method.
    pub fn store(&mut self, run: usize, records: impl IntoIterator<Item = MethodRecord>) {
        let [runs, methods, samples] = self.shape;
        for (place, record) in (run * methods..).zip(records) {
            for (sample, (error, sd)) in record.error.iter().zip(&record.sd).enumerate() {
                for k in 0..ERRORS {
                    let at = (k * runs * methods + place) * samples + sample;
                    (self.error[at], self.sd[at]) = (error[k], sd[k]);
                }
            }
            let part = place * samples..(place + 1) * samples;
            self.nees[part.clone()].copy_from_slice(&record.nees);
            self.nees_velocity_attitude[part].copy_from_slice(&record.nees_velocity_attitude);
            self.choices[place] = record.choices.iter().map(choice_code).collect();
            self.totals[place] = MethodRecord {
                error: Vec::new(),
                sd: Vec::new(),
                nees: Vec::new(),
                nees_velocity_attitude: Vec::new(),
                choices: Vec::new(),
                ..record
            };
        }
    }

    /// The arrays as a Python dict.
    pub fn into_dict(self, py: Python<'_>) -> Dict<'_> {
        let (shape @ [runs, methods, samples], out) = (self.shape, PyDict::new(py));
        for (name, numbers) in [("error", self.error), ("sd", self.sd)] {
            let by_number = array(py, numbers, &[ERRORS, runs, methods, samples])?;
            out.set_item(name, by_number.permute(Some([1_usize, 2, 3, 0].as_slice()))?)?;
        }
        out.set_item("nees", array(py, self.nees, &shape)?)?;
        let nees = array(py, self.nees_velocity_attitude, &shape)?;
        out.set_item("nees_velocity_attitude", nees)?;
        let (each, totals) = ([runs, methods], || self.totals.iter());
        columns! { out, &each, totals() => nis_mean, fixes_accepted, fixes_rejected, fixes_beyond_linear_range }
        let biases = |of: fn(&BiasRecord) -> [f64; BIASES]| {
            totals().map(move |record| record.biases.as_ref().map_or([f64::NAN; BIASES], of))
        };
        out.put("final_bias_error", &each, biases(|biases| biases.error))?;
        out.put("final_bias_sd", &each, biases(|biases| biases.sd))?;
        let pings = self.choices.iter().map(Vec::len).max().unwrap_or(0);
        let padded = |choices: Vec<[u8; 3]>| choices.into_iter().chain(repeat([NO_CHOICE; 3])).take(pings);
        out.put(
            "choice",
            &[runs, methods, pings],
            self.choices.into_iter().flat_map(padded),
        )?;
        Ok(out)
    }
}

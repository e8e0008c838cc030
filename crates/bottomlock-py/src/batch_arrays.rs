//! Result arrays of a batch, filled while the runs are computed.

use bottomlock::aiding::registry::SENSORS;
use bottomlock::dvl::fix_row::source_code;
use bottomlock::filter::report::Choice;
use bottomlock::simulation::monte_carlo_run::{BiasRecord, MethodRecord};
use bottomlock::simulation::schedule::Schedule;
use numpy::PyArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Dict, array};
use crate::memory::product;
use crate::results::Results;

/// Code for a method that does not select.
pub const NO_CHOICE: u8 = u8::MAX;

/// Codes of a selection: the sources of surge, sway and heave, or the selected method, the reason, and [`NO_CHOICE`].
pub fn choice_code(choice: &Choice) -> [u8; 3] {
    match choice {
        Choice::Components(sources) => sources.map(source_code),
        Choice::Method { method, reason, .. } => [*method as u8, *reason as u8, NO_CHOICE],
    }
}

/// Number of recorded error states: position, misalignment and velocity.
const ERRORS: usize = 9;
/// Number of biases of accelerometers and gyros.
const BIASES: usize = 6;

/// The result arrays of a batch.
pub struct BatchArrays {
    runs: usize,
    methods: usize,
    samples: usize,
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

/// The slices of the arrays for one run and method.
pub struct RecordSlices<'a> {
    error: [&'a mut [f64]; ERRORS],
    sd: [&'a mut [f64]; ERRORS],
    nees: &'a mut [f64],
    nees_velocity_attitude: &'a mut [f64],
    totals: &'a mut MethodRecord,
    choices: &'a mut Vec<[u8; 3]>,
}

impl RecordSlices<'_> {
    /// Copies the record of a method.
    pub fn store(&mut self, record: &MethodRecord) {
        for k in 0..ERRORS {
            put_column(self.error[k], &record.error, k);
            put_column(self.sd[k], &record.sd, k);
        }
        self.nees.copy_from_slice(&record.nees);
        self.nees_velocity_attitude
            .copy_from_slice(&record.nees_velocity_attitude);
        *self.totals = MethodRecord {
            error: Vec::new(),
            sd: Vec::new(),
            nees: Vec::new(),
            nees_velocity_attitude: Vec::new(),
            choices: Vec::new(),
            ..*record
        };
        self.choices.extend(record.choices.iter().map(choice_code));
    }
}

fn put_column(column: &mut [f64], rows: &[[f64; ERRORS]], k: usize) {
    for (number, row) in column.iter_mut().zip(rows) {
        *number = row[k];
    }
}

/// Splits an array into a column per error state.
fn columns(numbers: &mut [f64]) -> [&mut [f64]; ERRORS] {
    let (each, mut rest) = (numbers.len() / ERRORS, numbers);
    std::array::from_fn(|_| rest.split_off_mut(..each).unwrap_or_default())
}

/// Memory of a batch, bytes: its arrays, its records, and what goes with each run.
pub fn batch_bytes(runs: usize, methods: usize, samples: usize) -> u128 {
    const NUMBER: usize = size_of::<f64>();
    // Of the arrays and of the records: errors, their standard deviations and two NEES a sample.
    let of_samples = product(&[runs, methods, samples, 2 * (2 * ERRORS + 2), NUMBER]);
    let of_method = size_of::<MethodRecord>() + size_of::<Vec<[u8; 3]>>() + size_of::<RecordSlices<'_>>();
    let of_run = size_of::<Vec<RecordSlices<'_>>>() + size_of::<Schedule<'_>>() + 2 * SENSORS * size_of::<Vec<i64>>();
    of_samples
        .saturating_add(product(&[runs, methods, of_method]))
        .saturating_add(product(&[runs, of_run]))
}

impl BatchArrays {
    /// Arrays of zeros.
    pub fn new(runs: usize, methods: usize, samples: usize) -> Self {
        let zeros = |each: usize| vec![0.0; runs * methods * each];
        Self {
            runs,
            methods,
            samples,
            error: zeros(samples * ERRORS),
            sd: zeros(samples * ERRORS),
            nees: zeros(samples),
            nees_velocity_attitude: zeros(samples),
            totals: vec![MethodRecord::default(); runs * methods],
            choices: vec![Vec::new(); runs * methods],
        }
    }

    /// The slices of every run, method by method.
    pub fn slices(&mut self) -> Vec<Vec<RecordSlices<'_>>> {
        let samples = self.samples;
        let (mut error, mut sd) = (columns(&mut self.error), columns(&mut self.sd));
        let (mut nees, mut nees_velocity_attitude) = (&mut self.nees[..], &mut self.nees_velocity_attitude[..]);
        let (mut totals, mut choices) = (self.totals.iter_mut(), self.choices.iter_mut());
        let mut next = || {
            Some(RecordSlices {
                error: std::array::from_fn(|k| error[k].split_off_mut(..samples).unwrap_or_default()),
                sd: std::array::from_fn(|k| sd[k].split_off_mut(..samples).unwrap_or_default()),
                nees: nees.split_off_mut(..samples)?,
                nees_velocity_attitude: nees_velocity_attitude.split_off_mut(..samples)?,
                totals: totals.next()?,
                choices: choices.next()?,
            })
        };
        let methods = self.methods;
        (0..self.runs)
            .map(|_| std::iter::from_fn(&mut next).take(methods).collect())
            .collect()
    }

    /// The arrays as a Python dict.
    pub fn into_dict(self, py: Python<'_>) -> Dict<'_> {
        let (runs, methods, samples) = (self.runs, self.methods, self.samples);
        let pings = self.choices.iter().map(Vec::len).max().unwrap_or(0);
        let mut codes = vec![[NO_CHOICE; 3]; runs * methods * pings];
        for (padded, choices) in codes.chunks_mut(pings.max(1)).zip(&self.choices) {
            padded[..choices.len()].copy_from_slice(choices);
        }
        let out = PyDict::new(py);
        for (name, numbers) in [("error", self.error), ("sd", self.sd)] {
            let by_number = array(py, numbers, &[ERRORS, runs, methods, samples])?;
            out.set_item(name, by_number.permute(Some([1_usize, 2, 3, 0].as_slice()))?)?;
        }
        let (each, by_sample) = ([runs, methods], [runs, methods, samples]);
        out.set_item("nees", array(py, self.nees, &by_sample)?)?;
        out.set_item(
            "nees_velocity_attitude",
            array(py, self.nees_velocity_attitude, &by_sample)?,
        )?;
        let totals = || self.totals.iter();
        out.put("nis_mean", &each, totals().map(|record| record.nis_mean))?;
        out.put(
            "fixes_accepted",
            &each,
            totals().map(|record| record.fixes_accepted as i64),
        )?;
        out.put(
            "fixes_rejected",
            &each,
            totals().map(|record| record.fixes_rejected as i64),
        )?;
        let beyond = totals().map(|record| record.fixes_beyond_linear_range as i64);
        out.put("fixes_beyond_linear_range", &each, beyond)?;
        let biases = |of: fn(&BiasRecord) -> [f64; BIASES]| {
            totals().map(move |record| record.biases.as_ref().map_or([f64::NAN; BIASES], of))
        };
        out.put("final_bias_error", &each, biases(|biases| biases.error))?;
        out.put("final_bias_sd", &each, biases(|biases| biases.sd))?;
        out.put("choice", &[runs, methods, pings], codes)?;
        Ok(out)
    }
}

//! Velocities, flags and standard deviations of beams, where a masked beam is not valid.

use pyo3::prelude::*;

use crate::arrays::{Masked, booleans, floats};

/// Flat arrays of one shape.
pub struct BeamArrays {
    pub velocity_mps: Vec<f64>,
    pub valid: Vec<bool>,
    /// Empty where it was not given.
    pub sd_mps: Vec<f64>,
}

impl BeamArrays {
    /// Reads the arrays; `names` are those of velocity, flags and standard deviations.
    pub fn new(
        names: [&str; 3],
        velocity_mps: &Bound<'_, PyAny>,
        valid: &Bound<'_, PyAny>,
        sd_mps: Option<&Bound<'_, PyAny>>,
        shape: &[Option<usize>],
    ) -> PyResult<Self> {
        let velocity_mps = Masked::of(velocity_mps)?;
        let valid = Masked::of(valid)?;
        let sd_mps = sd_mps.map(Masked::of).transpose()?;
        let velocities = floats(names[0], &velocity_mps.data, shape)?;
        let shape: Vec<Option<usize>> = velocities.shape.iter().copied().map(Some).collect();
        let mut flags = booleans(names[1], &valid.data, &shape)?.values;
        for masked in [Some(&velocity_mps), Some(&valid), sd_mps.as_ref()]
            .into_iter()
            .flatten()
        {
            if let Some(mask) = &masked.mask {
                let mask = booleans(names[0], mask, &shape)?.values;
                flags
                    .iter_mut()
                    .zip(mask)
                    .for_each(|(flag, is_masked)| *flag &= !is_masked);
            }
        }
        Ok(Self {
            velocity_mps: velocities.values,
            valid: flags,
            sd_mps: match &sd_mps {
                Some(sd_mps) => floats(names[2], &sd_mps.data, &shape)?.values,
                None => Vec::new(),
            },
        })
    }
}

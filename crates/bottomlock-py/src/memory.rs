//! Refusal of calls whose results do not fit into memory, before anything is allocated.

use pyo3::prelude::*;

use crate::errors::invalid;

/// Checks that so many bytes can be had; `what` names the counts behind them.
///
/// # Errors
/// KernelError with the counts and the size.
pub fn require(bytes: u128, what: impl FnOnce() -> String) -> PyResult<()> {
    let mut block: Vec<u8> = Vec::new();
    let fits = usize::try_from(bytes).is_ok_and(|bytes| block.try_reserve_exact(bytes).is_ok());
    // The block must be asked for, though nothing uses it.
    std::hint::black_box(&block);
    if fits {
        return Ok(());
    }
    Err(invalid(format!(
        "{} need {:.3} GB ({bytes} bytes) of memory, more than there is: ask for fewer at a time",
        what(),
        bytes as f64 * 1e-9
    )))
}

/// A product of counts, the largest number where it has no room.
pub fn product(counts: &[usize]) -> u128 {
    counts
        .iter()
        .fold(1, |product: u128, &count| product.saturating_mul(count as u128))
}

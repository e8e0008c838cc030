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
        "{} need {} of memory, more than there is: ask for fewer at a time",
        what(),
        words(bytes)
    )))
}

/// A product of counts, the largest number where it has no room.
pub fn product(counts: &[usize]) -> u128 {
    counts
        .iter()
        .fold(1, |product: u128, &count| product.saturating_mul(count as u128))
}

/// A size with its unit.
fn words(bytes: u128) -> String {
    let units = ["bytes", "kB", "MB", "GB", "TB", "PB", "EB"];
    let mut scaled = bytes as f64;
    let mut unit = 0;
    while scaled >= 1000.0 && unit + 1 < units.len() {
        scaled /= 1000.0;
        unit += 1;
    }
    format!("{scaled:.3} {} ({bytes} bytes)", units[unit])
}

//! The exception for invalid input and numerical failure.

use bottomlock::NavError;
use pyo3::{PyErr, import_exception};

// The class is written in Python, among the other exceptions of the package; it is imported with the first error.
import_exception!(bottomlock.errors, KernelError);

/// The Python exception of a kernel error, with the messages of its sources.
pub fn raise(error: NavError) -> PyErr {
    let mut text = error.to_string();
    let mut source = std::error::Error::source(&error);
    while let Some(inner) = source {
        if !text.contains(&inner.to_string()) {
            text = format!("{text}: {inner}");
        }
        source = inner.source();
    }
    KernelError::new_err(text)
}

/// The same of numbers that have no time.
pub fn raise_timeless(error: NavError) -> PyErr {
    invalid(without_time(&error))
}

/// The message of an error without the time 0.
pub fn without_time(error: &NavError) -> String {
    error.to_string().replace(" at 0 ns", "")
}

/// The Python exception for an argument of the wrong shape, type or value.
pub fn invalid(message: impl Into<String>) -> PyErr {
    KernelError::new_err(message.into())
}

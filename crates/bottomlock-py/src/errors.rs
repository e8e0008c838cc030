//! The exception for invalid input and numerical failure.

use bottomlock::NavError;
use pyo3::import_exception;
use pyo3::prelude::*;

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
    with_parts(text, &error)
}

/// The same of numbers that have no time.
pub fn raise_timeless(error: NavError) -> PyErr {
    with_parts(error.timeless(), &error)
}

/// The exception with the key, the expectation and the hint of the error.
fn with_parts(text: String, error: &NavError) -> PyErr {
    let raised = KernelError::new_err(text);
    Python::attach(|py| {
        let value = raised.value(py);
        let parts = [
            ("key", error.key()),
            ("expected", error.expected()),
            ("hint", error.hint()),
        ];
        let set = parts.into_iter().try_for_each(|(name, part)| value.setattr(name, part));
        set.err().unwrap_or(raised)
    })
}

/// The Python exception for an argument of the wrong shape, type or value.
pub fn invalid(message: impl Into<String>) -> PyErr {
    KernelError::new_err(message.into())
}

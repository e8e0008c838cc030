//! One exception for everything that the kernel refuses.

use bottomlock::NavError;
use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, create_exception};

create_exception!(
    _kernel,
    KernelError,
    PyValueError,
    "Bad input to the kernel, in one line that names the field, row or time and what was expected."
);

/// Maps a kernel error to the Python exception.
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

/// An error of a shape or a type, in the user's words.
pub fn refuse(message: impl Into<String>) -> PyErr {
    KernelError::new_err(message.into())
}

//! What almost every file of the bindings uses.

pub(crate) use pyo3::prelude::*;
pub(crate) use pyo3::types::PyDict;

pub(crate) use crate::arrays::{Argument, Dict};
pub(crate) use crate::errors::{invalid, raise};
pub(crate) use crate::results::{Results, columns, fields};
pub(crate) use crate::{dvl, settings};

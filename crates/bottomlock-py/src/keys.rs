//! Settings from Python: each key that is given must be one that is read.

use std::cell::RefCell;

use bottomlock::settings::{hint, nearest};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::types::{PyBool, PyString};

use crate::prelude::*;

/// Characters of a value beyond which a message names its type alone.
const LINE: usize = 60;

/// Keys and values of a dict, or of an object of `bottomlock.kernel.models`, with the keys that were asked for.
pub struct Keys<'py> {
    dict: Bound<'py, PyDict>,
    owner: String,
    asked: RefCell<Vec<String>>,
}

/// Reads a dict or a settings object by its keys. A key that `of` does not ask for is an error, which names the nearest one.
pub fn read<'py, T>(owner: &str, value: &Bound<'py, PyAny>, of: impl FnOnce(&Keys<'py>) -> PyResult<T>) -> PyResult<T> {
    let dict = match value.cast::<PyDict>() {
        Ok(dict) => dict.clone(),
        Err(_) if value.hasattr("as_dict")? => value.call_method0("as_dict")?.cast_into()?,
        Err(_) => {
            return Err(invalid(format!(
                "{owner} is of type {}, expected a dict or an object of bottomlock.kernel.models",
                value.get_type().name()?
            )));
        }
    };
    let keys = Keys {
        dict,
        owner: owner.into(),
        asked: RefCell::default(),
    };
    let made = of(&keys)?;
    keys.no_other()?;
    Ok(made)
}

impl<'py> Keys<'py> {
    /// The value of a key, `None` without it.
    pub fn get(&self, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.asked.borrow_mut().push(key.into());
        self.dict.get_item(key)
    }

    /// Whether the key is given.
    pub fn has(&self, key: &str) -> PyResult<bool> {
        Ok(self.get(key)?.is_some())
    }

    /// The value of a key that must be there.
    pub fn item(&self, key: &str) -> PyResult<Bound<'py, PyAny>> {
        if let Some(value) = self.get(key)? {
            return Ok(value);
        }
        let unasked = self.unasked()?;
        let given = nearest(key, &unasked.iter().map(String::as_str).collect::<Vec<_>>());
        let hint = given.map_or(String::new(), |given| format!(", '{given}' is given in its place"));
        Err(invalid(format!("{} lacks the key '{key}'{hint}", self.owner)))
    }

    /// The path of a key, for messages.
    pub fn path(&self, key: &str) -> String {
        format!("{}.{key}", self.owner)
    }

    /// A number, or a default where the key is not given.
    pub fn number_or(&self, key: &str, default: f64) -> PyResult<f64> {
        let Some(value) = self.get(key)? else {
            return Ok(default);
        };
        let number = value.extract().ok().filter(|_| !value.is_instance_of::<PyBool>());
        number.ok_or_else(|| self.not(key, &value, "a number"))
    }

    /// A value of another type, which the message describes.
    pub fn extract<T: FromPyObjectOwned<'py>>(&self, key: &str, expected: &str) -> PyResult<T> {
        let value = self.item(key)?;
        value.extract().map_err(|_| self.not(key, &value, expected))
    }

    /// What `convert` makes of a key's path and its value, which must be there.
    pub fn with<T>(&self, key: &str, convert: impl FnOnce(&str, Argument<'_, 'py>) -> PyResult<T>) -> PyResult<T> {
        convert(&self.path(key), &self.item(key)?)
    }

    /// The same, and nothing where the key is not given.
    pub fn given<T>(
        &self,
        key: &str,
        convert: impl FnOnce(&str, Argument<'_, 'py>) -> PyResult<T>,
    ) -> PyResult<Option<T>> {
        self.get(key)?.map(|value| convert(&self.path(key), &value)).transpose()
    }

    fn not(&self, key: &str, value: Argument, expected: &str) -> PyErr {
        let of_type = || value.get_type().name().map_or("value".into(), |name| name.to_string());
        let text = value.repr().map_or_else(|_| of_type(), |text| text.to_string());
        let given = if text.len() > LINE || text.contains('\n') {
            format!("of type {}", of_type())
        } else {
            text
        };
        invalid(format!("{} is {given}, expected {expected}", self.path(key)))
    }

    /// The keys that are given and were not asked for.
    fn unasked(&self) -> PyResult<Vec<String>> {
        let asked = self.asked.borrow();
        let mut others = Vec::new();
        for key in self.dict.keys() {
            let text = match key.cast::<PyString>() {
                // Not its Display: that answers signals, and shows an interrupt as another text.
                Ok(text) => text.to_str()?.to_owned(),
                Err(_) => key.repr()?.to_str()?.to_owned(),
            };
            if !asked.contains(&text) {
                others.push(text);
            }
        }
        Ok(others)
    }

    fn no_other(&self) -> PyResult<()> {
        let Some(unknown) = self.unasked()?.into_iter().next() else {
            return Ok(());
        };
        let asked = self.asked.borrow();
        let mut known: Vec<&str> = asked.iter().map(String::as_str).collect();
        known.sort_unstable();
        known.dedup();
        let hint = hint(&unknown, &known);
        Err(invalid(format!("{} has no key '{unknown}' ({hint})", self.owner)))
    }
}

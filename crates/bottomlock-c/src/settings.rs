//! Settings as JSON: the keys are those of the kernel's structs, nested as they are.

use std::ffi::c_char;

use bottomlock::NavError;
use bottomlock::settings::read;
use serde::de::DeserializeOwned;
use serde::{Deserializer, Serialize};
use serde_json::Value;

use crate::calls::{Failure, Outcome};
use crate::pointers::put_all;

/// Settings that are read and written as JSON, and always valid.
pub(crate) trait Settings: Serialize + DeserializeOwned {
    /// Their name in messages.
    const NAME: &'static str;

    /// Checks their numbers.
    fn validate(&self) -> Result<(), NavError> {
        Ok(())
    }

    /// Reads and checks them.
    fn read<'de, D: Deserializer<'de, Error = serde_json::Error>>(source: D) -> Result<Self, NavError> {
        let made: Self = read(Self::NAME, source)?;
        made.validate()?;
        Ok(made)
    }

    fn from_json(text: &str) -> Outcome<Self> {
        let mut source = serde_json::Deserializer::from_str(text);
        let made = Self::read(&mut source)?;
        source.end().map_err(|error| no_json(&error))?;
        made.of_tables(&parsed(text)?)
    }

    /// The same with the values of an object of JSON; what it does not name stays.
    fn changed(&self, change: Value) -> Outcome<Self> {
        let mut value = serde_json::to_value(self).map_err(|error| no_json(&error))?;
        merge(&mut value, change);
        Self::read(value.clone())?.of_tables(&value)
    }

    /// Changes them by a text; an error changes nothing.
    fn change(&mut self, json: &str) -> Outcome<()> {
        *self = self.changed(parsed(json)?)?;
        Ok(())
    }

    /// The settings, made of tables alone: Serde takes a list for a struct, too, by the order of its fields.
    fn of_tables(self, given: &Value) -> Outcome<Self> {
        let made = serde_json::to_value(&self).map_err(|error| no_json(&error))?;
        match list_for_table(Self::NAME, given, &made) {
            Some(key) => Err(NavError::Setting {
                key,
                found: "is a list".into(),
                expected: "a table of settings".into(),
                hint: String::new(),
            }
            .into()),
            None => Ok(self),
        }
    }

    /// # Safety
    /// As the header asks.
    unsafe fn write(&self, text: *mut c_char, capacity: usize, size: *mut usize) -> Outcome<()> {
        let mut written = serde_json::to_vec(self).map_err(|error| no_json(&error))?;
        written.push(0);
        // SAFETY: as the caller promises.
        unsafe { put_all(("text", text.cast::<u8>(), capacity), ("size", size), &written) }
    }
}

/// The value of a text.
pub(crate) fn parsed(text: &str) -> Outcome<Value> {
    serde_json::from_str(text).map_err(|error| no_json(&error))
}

fn no_json(error: &serde_json::Error) -> Failure {
    Failure::invalid(format!("the text is no JSON: {error}"))
}

/// The key of the first table that is given as a list.
fn list_for_table(key: &str, given: &Value, made: &Value) -> Option<String> {
    match (given, made) {
        (Value::Array(_), Value::Object(_)) => Some(key.into()),
        (Value::Object(given), Value::Object(made)) => given
            .iter()
            .find_map(|(name, part)| list_for_table(&format!("{key}.{name}"), part, made.get(name)?)),
        _ => None,
    }
}

/// Replaces what a change names, section by section.
fn merge(value: &mut Value, change: Value) {
    match (value, change) {
        (Value::Object(value), Value::Object(change)) => {
            for (key, part) in change {
                merge(value.entry(key).or_insert(Value::Null), part);
            }
        }
        (value, change) => *value = change,
    }
}

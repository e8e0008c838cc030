//! Python values as Serde reads them: what settings are given as.

use pyo3::types::{PyBool, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde::de::value::{Error, MapDeserializer, SeqDeserializer};
use serde::de::{Deserializer, Error as _, IntoDeserializer, Unexpected, Visitor};
use serde::forward_to_deserialize_any;

use crate::prelude::*;

/// A dict, or an object of `bottomlock.kernel.models`, or a value in it: None, a bool, a number, a text, a list, a tuple or an array.
pub struct Given<'py>(pub Bound<'py, PyAny>);

impl<'py> Given<'py> {
    /// The object that has the values of this one: arrays and numpy's numbers are lists and plain numbers, settings are dicts.
    fn plain(self) -> Result<Self, Error> {
        for method in ["tolist", "as_dict"] {
            let found = self.0.getattr_opt(method).map_err(Error::custom)?;
            if let Some(method) = found {
                let plain = method.call0().map_err(Error::custom)?;
                // Numbers beyond double precision are lists of themselves.
                if plain.get_type().is(self.0.get_type()) {
                    break;
                }
                return Ok(Self(plain));
            }
        }
        let kind = self.0.get_type().name().map_err(Error::custom)?;
        let kind = format!("of type {kind}");
        Err(Error::invalid_type(
            Unexpected::Other(&kind),
            &"a dict or an object of bottomlock.kernel.models",
        ))
    }
}

fn entry<'py>((key, value): (Bound<'py, PyAny>, Bound<'py, PyAny>)) -> (String, Given<'py>) {
    // Not the Display of a text: that answers signals, and shows an interrupt as another text.
    let text = key.cast::<PyString>().ok().and_then(|text| text.to_str().ok());
    let text = text.map_or_else(|| format!("{key:?}"), str::to_owned);
    (text, Given(value))
}

impl<'de, 'py> Deserializer<'de> for Given<'py> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let value = &self.0;
        if value.is_none() {
            visitor.visit_unit()
        } else if let Ok(flag) = value.cast::<PyBool>() {
            visitor.visit_bool(flag.is_true())
        } else if value.is_instance_of::<PyInt>() {
            visitor.visit_i64(value.extract().map_err(Error::custom)?)
        } else if let Ok(number) = value.cast::<PyFloat>() {
            visitor.visit_f64(number.value())
        } else if let Ok(text) = value.cast::<PyString>() {
            visitor.visit_str(text.to_str().map_err(Error::custom)?)
        } else if let Ok(dict) = value.cast::<PyDict>() {
            visitor.visit_map(MapDeserializer::new(dict.iter().map(entry)))
        } else if let Ok(list) = value.cast::<PyList>() {
            visitor.visit_seq(SeqDeserializer::new(list.iter().map(Given)))
        } else if let Ok(tuple) = value.cast::<PyTuple>() {
            visitor.visit_seq(SeqDeserializer::new(tuple.iter().map(Given)))
        } else {
            self.plain()?.deserialize_any(visitor)
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        if self.0.is_none() {
            visitor.visit_none()
        } else {
            visitor.visit_some(self)
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self.0.cast::<PyString>() {
            Ok(text) => visitor.visit_enum(text.to_str().map_err(Error::custom)?.into_deserializer()),
            Err(_) => self.deserialize_any(visitor),
        }
    }

    /// Serde takes a list for a struct, too, by the order of its fields; here a table alone.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        if self.0.is_instance_of::<PyList>() || self.0.is_instance_of::<PyTuple>() {
            return Err(Error::invalid_type(Unexpected::Seq, &"struct"));
        }
        self.deserialize_any(visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _name: &'static str, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

impl IntoDeserializer<'_> for Given<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

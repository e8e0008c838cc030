//! Dicts of results: arrays by name, made from the kernel's numbers, vectors and matrices.

use bottomlock::frames::{Rot, Vec3};
use nalgebra::{DMatrix, SMatrix};
use numpy::{Element, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;

/// A value that is one entry of an array, or has axes of its own.
pub trait Entry {
    type Number: Element;

    /// Lengths of its axes.
    fn axes() -> Vec<usize> {
        Vec::new()
    }

    fn write(self, into: &mut Vec<Self::Number>);
}

macro_rules! number {
    ($($kind:ty as $number:ty),*) => {$(
        impl Entry for $kind {
            type Number = $number;

            fn write(self, into: &mut Vec<$number>) {
                into.push(self as $number);
            }
        }
    )*};
}

number!(f64 as f64, i64 as i64, u64 as i64, usize as i64, u8 as u8, bool as bool);

impl<T: Entry, const N: usize> Entry for [T; N] {
    type Number = T::Number;

    fn axes() -> Vec<usize> {
        [vec![N], T::axes()].concat()
    }

    fn write(self, into: &mut Vec<T::Number>) {
        self.into_iter().for_each(|entry| entry.write(into));
    }
}

macro_rules! as_array {
    ($($kind:ident<$($frame:ident),+>, $length:literal, $convert:ident);*) => {$(
        impl<$($frame),+> Entry for $kind<$($frame),+> {
            type Number = f64;

            fn axes() -> Vec<usize> {
                vec![$length]
            }

            fn write(self, into: &mut Vec<f64>) {
                self.$convert().write(into);
            }
        }
    )*};
}

as_array!(Vec3<F>, 3, to_array; Rot<To, From>, 4, to_quaternion_wxyz);

/// By columns, which are the rows of what is symmetric; of another matrix the transposed one is put.
impl<const R: usize, const C: usize> Entry for SMatrix<f64, R, C> {
    type Number = f64;

    fn axes() -> Vec<usize> {
        if C == 1 { vec![R] } else { vec![C, R] }
    }

    fn write(self, into: &mut Vec<f64>) {
        into.extend(self.iter());
    }
}

/// An array of entries, whose first axes are stated.
pub fn entries<'py, T: Entry>(
    py: Python<'py>,
    leading: &[usize],
    entries: impl IntoIterator<Item = T>,
) -> PyResult<Bound<'py, PyArrayDyn<T::Number>>> {
    let shape = [leading, &T::axes()].concat();
    let mut numbers = Vec::with_capacity(shape.iter().product());
    entries.into_iter().for_each(|entry| entry.write(&mut numbers));
    array(py, numbers, &shape)
}

/// A matrix of any size, by rows.
pub fn matrix<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array(py, m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])
}

/// Arrays of fields of entries, each under the field's name: `columns! { out, leading axes, entries => field, .. }`.
macro_rules! columns {
    ($out:expr, $leading:expr, $each:expr => $($field:ident),+) => {
        $($out.put(stringify!($field), $leading, $each.map(|entry| entry.$field))?;)+
    };
}

/// The fields of one value, each under its name: `fields! { out, value => field, .. }`.
macro_rules! fields {
    ($out:expr, $value:expr => $($field:ident),+) => {
        $($out.entry(stringify!($field), $value.$field)?;)+
    };
}

pub(crate) use {columns, fields};

/// A dict that is filled with results.
pub trait Results {
    /// An array of entries, whose first axes are stated.
    fn put<T: Entry>(&self, key: &str, leading: &[usize], values: impl IntoIterator<Item = T>) -> PyResult<()>;

    /// A number, or the array of the numbers of one entry.
    fn entry<T: Entry>(&self, key: &str, value: T) -> PyResult<()>;

    /// An array of one axis or more, an entry after the other.
    fn column<T: Entry>(
        &self,
        key: &str,
        values: impl IntoIterator<Item = T, IntoIter: ExactSizeIterator>,
    ) -> PyResult<()> {
        let values = values.into_iter();
        self.put(key, &[values.len()], values)
    }
}

impl Results for Bound<'_, PyDict> {
    fn put<T: Entry>(&self, key: &str, leading: &[usize], values: impl IntoIterator<Item = T>) -> PyResult<()> {
        self.set_item(key, entries(self.py(), leading, values)?)
    }

    fn entry<T: Entry>(&self, key: &str, value: T) -> PyResult<()> {
        let array = entries(self.py(), &[], [value])?;
        if T::axes().is_empty() {
            return self.set_item(key, array.call_method0("item")?);
        }
        self.set_item(key, array)
    }
}

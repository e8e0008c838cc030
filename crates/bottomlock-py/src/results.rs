//! Dicts of results: arrays by name, made from the kernel's numbers, vectors and matrices.

use bottomlock::frames::Vec3;
use bottomlock::state::NavState;
use nalgebra::{DMatrix, SMatrix};
use numpy::{Element, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;

/// A value that is one entry of an array, or has axes of its own.
pub trait Entry {
    type Number: Element;

    /// Lengths of its axes.
    fn axes() -> Vec<usize>;

    fn write(self, into: &mut Vec<Self::Number>);
}

macro_rules! number {
    ($($kind:ty),*) => {$(
        impl Entry for $kind {
            type Number = $kind;

            fn axes() -> Vec<usize> {
                Vec::new()
            }

            fn write(self, into: &mut Vec<$kind>) {
                into.push(self);
            }
        }
    )*};
}

number!(f64, i64, u8, bool);

impl<T: Entry, const N: usize> Entry for [T; N] {
    type Number = T::Number;

    fn axes() -> Vec<usize> {
        [vec![N], T::axes()].concat()
    }

    fn write(self, into: &mut Vec<T::Number>) {
        self.into_iter().for_each(|entry| entry.write(into));
    }
}

impl<F> Entry for Vec3<F> {
    type Number = f64;

    fn axes() -> Vec<usize> {
        vec![3]
    }

    fn write(self, into: &mut Vec<f64>) {
        self.to_array().write(into);
    }
}

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

/// A dict that is filled with results.
pub trait Results {
    /// An array of entries, whose first axes are stated.
    fn put<T: Entry>(&self, key: &str, leading: &[usize], values: impl IntoIterator<Item = T>) -> PyResult<()>;

    /// An array of one axis or more, an entry after the other.
    fn column<T: Entry>(
        &self,
        key: &str,
        values: impl IntoIterator<Item = T, IntoIter: ExactSizeIterator>,
    ) -> PyResult<()> {
        let values = values.into_iter();
        self.put(key, &[values.len()], values)
    }

    /// The numbers of one entry.
    fn entry<T: Entry>(&self, key: &str, value: T) -> PyResult<()> {
        self.put(key, &[], [value])
    }

    /// Position, attitude and velocity of states, each key with a prefix.
    fn motion<'a, I: Iterator<Item = &'a NavState>>(
        &self,
        prefix: &str,
        leading: &[usize],
        states: impl Fn() -> I,
    ) -> PyResult<()> {
        let key = |name: &str| format!("{prefix}{name}");
        self.put(&key("position_t_m"), leading, states().map(|state| state.position_t_m))?;
        let attitudes = states().map(|state| state.attitude_t_p.to_quaternion_wxyz());
        self.put(&key("attitude_t_p"), leading, attitudes)?;
        self.put(
            &key("velocity_p_mps"),
            leading,
            states().map(|state| state.velocity_p_mps),
        )
    }

    /// All vectors of states.
    fn states<'a, I: Iterator<Item = &'a NavState>>(
        &self,
        prefix: &str,
        leading: &[usize],
        states: impl Fn() -> I,
    ) -> PyResult<()> {
        let key = |name: &str| format!("{prefix}{name}");
        self.motion(prefix, leading, &states)?;
        self.put(
            &key("accel_bias_p_mps2"),
            leading,
            states().map(|state| state.accel_bias_p_mps2),
        )?;
        self.put(
            &key("gyro_bias_p_radps"),
            leading,
            states().map(|state| state.gyro_bias_p_radps),
        )?;
        self.put(&key("dvl_bias_mps"), leading, states().map(|state| state.dvl_bias_mps))
    }
}

impl Results for Bound<'_, PyDict> {
    fn put<T: Entry>(&self, key: &str, leading: &[usize], values: impl IntoIterator<Item = T>) -> PyResult<()> {
        self.set_item(key, entries(self.py(), leading, values)?)
    }
}

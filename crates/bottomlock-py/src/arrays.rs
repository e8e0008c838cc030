//! Conversion between Python arrays, lists and scalars and plain vectors, with checks of type and shape.

use numpy::{
    Element, IntoPyArray, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyException;
use pyo3::types::{PyList, PyTuple};

use bottomlock::error::require_time;
use bottomlock::frames::Vec3;

use crate::prelude::*;

/// An argument from Python.
pub type Argument<'a, 'py> = &'a Bound<'py, PyAny>;
/// A dict that a call returns.
pub type Dict<'py> = PyResult<Bound<'py, PyDict>>;

/// A contiguous copy of an array with its shape.
pub struct Array<T> {
    pub shape: Vec<usize>,
    pub values: Vec<T>,
}

/// Rows of a fixed width under leading axes.
///
/// A contiguous array of the right type is read without a copy. It must not be written to while it is read without the
/// GIL.
pub struct Rows<'py, const N: usize>(PyReadonlyArrayDyn<'py, f64>);

impl<'py, const N: usize> Rows<'py, N> {
    pub fn new(name: &str, value: &Bound<'py, PyAny>, leading: &[Option<usize>]) -> PyResult<Self> {
        let shape: Vec<Option<usize>> = leading.iter().copied().chain([Some(N)]).collect();
        checked(name, value, "fiu", "float64", &shape).map(Self)
    }

    pub fn get(&self) -> PyResult<&[[f64; N]]> {
        Ok(self.0.as_slice()?.as_chunks().0)
    }
}

/// A shape as numpy prints it, with `n` for any length.
fn shape_text(shape: &[Option<usize>]) -> String {
    let lengths: Vec<String> = shape.iter().map(|n| n.map_or("n".into(), |n| n.to_string())).collect();
    format!("({}{})", lengths.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// An array without its mask, and the mask of a numpy.ma array, in which a masked element is true.
pub struct Masked<'py> {
    pub data: Bound<'py, PyAny>,
    pub mask: Option<Bound<'py, PyAny>>,
}

impl<'py> Masked<'py> {
    pub fn of(value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let is_plain = value.is_exact_instance_of::<PyUntypedArray>()
            || value.is_instance_of::<PyList>()
            || value.is_instance_of::<PyTuple>();
        let ma = || value.py().import("numpy.ma");
        if is_plain || !ma()?.call_method1("isMaskedArray", (value,))?.extract::<bool>()? {
            let (data, mask) = (value.clone(), None);
            return Ok(Self { data, mask });
        }
        let (data, mask) = (value.getattr("data")?, ma()?.call_method1("getmaskarray", (value,))?);
        Ok(Self { data, mask: Some(mask) })
    }
}

/// Rejects an array of which an element is masked, naming it.
fn refuse_masked(name: &str, value: Argument) -> PyResult<()> {
    let Some(mask) = Masked::of(value)?.mask else {
        return Ok(());
    };
    let places = value.py().import("numpy")?.call_method1("argwhere", (mask,))?;
    let places: Vec<Vec<usize>> = places.call_method0("tolist")?.extract()?;
    let refusal = |place| Err(invalid(format!("{name}{place:?} is masked, expected a value")));
    places.first().map_or(Ok(()), refusal)
}

/// A contiguous array, checked for type and shape; `None` in a shape stands for any length.
fn checked<'py, T: Element>(
    name: &str,
    value: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let numpy = value.py().import("numpy")?;
    refuse_masked(name, value)?;
    let array = numpy.call_method1("asarray", (value,)).map_err(|error| {
        // An interrupt is no fault of the numbers.
        if !error.is_instance_of::<PyException>(value.py()) {
            return error;
        }
        invalid(format!(
            "{name} is not an array of numbers, expected rows of equal length"
        ))
    })?;
    let untyped = array.cast::<PyUntypedArray>()?;
    let kind = char::from(untyped.dtype().kind());
    if !kinds.contains(kind) {
        let given = untyped.dtype().str()?;
        return Err(invalid(format!("{name} has dtype {given}, expected {dtype}")));
    }
    let found: Vec<Option<usize>> = untyped.shape().iter().copied().map(Some).collect();
    let fits = |(n, want): (_, &Option<usize>)| want.is_none() || n == want;
    if found.len() != shape.len() || !found.iter().zip(shape).all(fits) {
        let (given, expected) = (shape_text(&found), shape_text(shape));
        return Err(invalid(format!("{name} has shape {given}, expected {expected}")));
    }
    // numpy would make a scalar one-dimensional here; the check of the shape has excluded that.
    let contiguous = numpy.call_method1("ascontiguousarray", (array, dtype))?;
    contiguous.extract()
}

/// As [`checked`], copied.
fn convert<T: Element + Copy>(
    name: &str,
    value: Argument,
    kinds: &str,
    dtype: &str,
    shape: &[Option<usize>],
) -> PyResult<Array<T>> {
    let typed = checked::<T>(name, value, kinds, dtype, shape)?;
    Ok(Array {
        shape: typed.shape().to_vec(),
        values: typed.as_slice()?.to_vec(),
    })
}

/// An array of numbers as float64.
pub fn floats(name: &str, value: Argument, shape: &[Option<usize>]) -> PyResult<Array<f64>> {
    convert(name, value, "fiu", "float64", shape)
}

/// A vector of times, integer nanoseconds; floats are rejected, since they lose nanoseconds, and so are unsigned numbers that
/// would become negative.
pub fn times(name: &str, value: Argument) -> PyResult<Vec<i64>> {
    if value.len().is_ok_and(|count| count == 0) {
        return Ok(Vec::new());
    }
    reject_wrapped(name, value)?;
    let times = convert::<i64>(name, value, "iu", "int64", &[None])?.values;
    for (row, &time_ns) in times.iter().enumerate() {
        require_time("this", time_ns).map_err(|_| {
            invalid(format!(
                "{name} row {row} is {time_ns} ns, more than 146 years from 0, expected integer nanoseconds: a filler for a \
                 missing time, or a time scaled twice?"
            ))
        })?;
    }
    Ok(times)
}

/// Rejects unsigned times that int64 cannot hold.
fn reject_wrapped(name: &str, value: Argument) -> PyResult<()> {
    let kind = value.getattr("dtype").and_then(|dtype| dtype.getattr("kind"));
    if !kind
        .and_then(|kind| kind.extract::<char>())
        .is_ok_and(|kind| kind == 'u')
    {
        return Ok(());
    }
    let latest = value.call_method0("max")?;
    latest.extract::<i64>().map(|_| ()).map_err(|_| {
        invalid(format!(
            "{name} has a time of {latest}, which int64 cannot hold, expected integer nanoseconds: a negative time stored as uint64?"
        ))
    })
}

/// An array of booleans.
pub fn booleans(name: &str, value: Argument, shape: &[Option<usize>]) -> PyResult<Array<bool>> {
    convert(name, value, "b", "bool", shape)
}

/// Rows of a fixed width, as a copy.
pub fn rows<const N: usize>(name: &str, value: Argument, count: Option<usize>) -> PyResult<Vec<[f64; N]>> {
    Ok(Rows::<N>::new(name, value, &[count])?.get()?.to_vec())
}

/// The numbers of an array that already has the right type and shape; calls to numpy dominate the cost of an event.
fn ready_made<const N: usize>(value: Argument) -> Option<[f64; N]> {
    if !value.is_exact_instance_of::<PyUntypedArray>() {
        return None;
    }
    let array = value.cast::<PyArrayDyn<f64>>().ok()?;
    // A view of more than 32 dimensions, which numpy allows, is more than the crate knows.
    if array.shape() != [N] {
        return None;
    }
    let array = array.try_readonly().ok()?;
    let values = array.as_array();
    Some(std::array::from_fn(|k| values[k]))
}

/// A vector of fixed length.
pub fn vector<const N: usize>(name: &str, value: Argument) -> PyResult<[f64; N]> {
    if let Some(values) = ready_made(value) {
        return Ok(values);
    }
    let array = floats(name, value, &[Some(N)])?;
    Ok(std::array::from_fn(|k| array.values[k]))
}

/// A vector in a frame.
pub fn vec3<F>(name: &str, value: Argument) -> PyResult<Vec3<F>> {
    vector(name, value).map(Vec3::from_array)
}

/// A new array of a shape.
pub fn array<'py, T: Element>(py: Python<'py>, values: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    values.into_pyarray(py).reshape(shape.to_vec())
}

/// Numbers by name.
pub fn by_name<'py, T: IntoPyObject<'py> + Copy>(py: Python<'py>, names: &[&str], numbers: &[T]) -> Dict<'py> {
    let out = PyDict::new(py);
    let mut named = names.iter().zip(numbers);
    named.try_for_each(|(name, &number)| out.set_item(name, number))?;
    Ok(out)
}

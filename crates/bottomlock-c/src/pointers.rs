//! Arguments from outside: pointers checked for NULL, texts for UTF-8, counts for what they should be.
//!
//! Every function here trusts what the head of the header asks of a caller: a pointer is NULL or points to as many values as the
//! call says, and a handle is NULL or one that the library has made and not freed.

use std::ffi::{CStr, c_char};
use std::slice;

use bottomlock::dvl::geometry::BeamSample;
use bottomlock::frames::Vec3;

use crate::calls::{Failure, Outcome, Status};

fn null(name: &str) -> Failure {
    Failure::new(Status::NullPointer, format!("{name} is NULL"))
}

/// What a pointer points to.
pub(crate) unsafe fn at<'a, T>(name: &str, pointer: *const T) -> Outcome<&'a T> {
    // SAFETY: as the header asks.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// The same, to be changed.
pub(crate) unsafe fn at_mut<'a, T>(name: &str, pointer: *mut T) -> Outcome<&'a mut T> {
    // SAFETY: as the header asks.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// What is given, and nothing for NULL.
pub(crate) unsafe fn given<T: Copy>(pointer: *const T) -> Option<T> {
    // SAFETY: as the header asks.
    unsafe { pointer.as_ref() }.copied()
}

/// Numbers of a fixed length.
pub(crate) unsafe fn numbers<const N: usize>(name: &str, pointer: *const f64) -> Outcome<[f64; N]> {
    // SAFETY: as the header asks.
    unsafe { given(pointer.cast()) }.ok_or_else(|| null(name))
}

pub(crate) unsafe fn vector<F>(name: &str, pointer: *const f64) -> Outcome<Vec3<F>> {
    // SAFETY: as the header asks.
    unsafe { numbers(name, pointer) }.map(Vec3::from_array)
}

/// Values of a length that the caller states; a pointer to none may be NULL.
pub(crate) unsafe fn values<'a, T>(name: &str, pointer: *const T, count: usize) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(null(name));
    }
    if count > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Failure::invalid(format!(
            "{name} has {count} entries, more than memory"
        )));
    }
    // SAFETY: as the header asks; the length is one that memory can have.
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// A text in UTF-8 that ends with a NUL.
pub(crate) unsafe fn text<'a>(name: &str, pointer: *const c_char) -> Outcome<&'a str> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: as the header asks.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|_| Failure::invalid(format!("{name} is not UTF-8")))
}

/// Writes a result; one of several numbers goes to `pointer.cast()`.
pub(crate) unsafe fn put<T>(name: &str, pointer: *mut T, value: T) -> Outcome<()> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: as the header asks; what lay there before is plain data and needs no drop.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Writes how many results there are, and all of them into a buffer of some capacity.
pub(crate) unsafe fn put_all<T: Copy>(
    (name, pointer, capacity): (&str, *mut T, usize),
    (size_name, size): (&str, *mut usize),
    results: &[T],
) -> Outcome<()> {
    let needed = results.len();
    // SAFETY: as the header asks.
    unsafe { put(size_name, size, needed)? };
    if needed > capacity {
        let message = format!("{name} holds {capacity}, expected {needed} or more");
        return Err(Failure::new(Status::BufferTooSmall, message));
    }
    if needed == 0 {
        return Ok(());
    }
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: as the header asks; the results are the library's own, so they do not overlap.
    unsafe { pointer.copy_from_nonoverlapping(results.as_ptr(), needed) };
    Ok(())
}

/// A ping of an instrument with `beams` beams: velocities, flags and standard deviations, `count` each.
pub(crate) unsafe fn ping(
    time_ns: i64,
    beams: usize,
    count: usize,
    (velocity_mps, valid, sd_mps): (*const f64, *const u8, *const f64),
) -> Outcome<BeamSample> {
    if count != beams {
        return Err(Failure::invalid(format!(
            "beams: got {count}, expected {beams}, those of the geometry"
        )));
    }
    // SAFETY: as the header asks.
    let (velocity, flags, sd) = unsafe {
        (
            values("velocity_mps", velocity_mps, count)?,
            values("valid", valid, count)?,
            values("sd_mps", sd_mps, count)?,
        )
    };
    let valid = (0..beams).filter(|&beam| flags[beam] != 0).collect();
    Ok(BeamSample::new(time_ns, velocity, sd, valid))
}

//! Arguments from outside: pointers checked for NULL, texts for UTF-8, counts for what they should be.
//!
//! Every function here trusts what the head of the header asks of a caller: a pointer is NULL or points to as many values as the
//! call says, and a handle is NULL or one that the library has made and not freed.

use std::ffi::{CStr, c_char};
use std::slice;

use bottomlock::dvl::geometry::BeamSample;
use bottomlock::frames::{Platform, Rot, Tangent, Vec3};

use crate::calls::{Failure, Outcome, Status};

fn null(name: &str) -> Failure {
    Failure::new(Status::NullPointer, format!("{name} is NULL"))
}

/// What a pointer points to.
pub(crate) unsafe fn at<'a, T>(name: &str, pointer: *const T) -> Outcome<&'a T> {
    pointer.as_ref().ok_or_else(|| null(name))
}

/// The same, to be changed.
pub(crate) unsafe fn at_mut<'a, T>(name: &str, pointer: *mut T) -> Outcome<&'a mut T> {
    pointer.as_mut().ok_or_else(|| null(name))
}

/// Numbers of a fixed length.
pub(crate) unsafe fn numbers<const N: usize>(name: &str, pointer: *const f64) -> Outcome<[f64; N]> {
    at(name, pointer.cast::<[f64; N]>()).copied()
}

/// Numbers of a fixed length, where they are given.
pub(crate) unsafe fn given<const N: usize>(pointer: *const f64) -> Option<[f64; N]> {
    pointer.cast::<[f64; N]>().as_ref().copied()
}

pub(crate) unsafe fn vector<F>(name: &str, pointer: *const f64) -> Outcome<Vec3<F>> {
    numbers(name, pointer).map(Vec3::from_array)
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
    let text = CStr::from_ptr(pointer);
    text.to_str()
        .map_err(|_| Failure::invalid(format!("{name} is not UTF-8")))
}

/// Writes a result.
pub(crate) unsafe fn put<T>(name: &str, pointer: *mut T, value: T) -> Outcome<()> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: as the header asks; what lay there before is plain data and needs no drop.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Writes several results into a buffer of some capacity.
pub(crate) unsafe fn fill<T: Copy>(name: &str, pointer: *mut T, capacity: usize, results: &[T]) -> Outcome<()> {
    let needed = results.len();
    if needed > capacity {
        return Err(Failure::new(
            Status::BufferTooSmall,
            format!("{name} holds {capacity}, expected {needed} or more"),
        ));
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

/// Writes how many results there are, and all of them into a buffer of some capacity.
pub(crate) unsafe fn put_all<T: Copy>(
    (name, pointer, capacity): (&str, *mut T, usize),
    (size_name, size): (&str, *mut usize),
    results: &[T],
) -> Outcome<()> {
    put(size_name, size, results.len())?;
    fill(name, pointer, capacity, results)
}

/// A unit quaternion, scalar first.
pub(crate) fn attitude(name: &str, quaternion: [f64; 4]) -> Outcome<Rot<Tangent, Platform>> {
    let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !((norm - 1.0).abs() < 1e-6) {
        let message = format!("{name} has norm {norm}, expected 1 (scalar first)");
        return Err(Failure::invalid(message).about(name));
    }
    Ok(Rot::from_quaternion_wxyz(quaternion))
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
    let (velocity, flags, sd) = (
        values("velocity_mps", velocity_mps, count)?,
        values("valid", valid, count)?,
        values("sd_mps", sd_mps, count)?,
    );
    let valid = (0..beams).filter(|&beam| flags[beam] != 0).collect();
    Ok(BeamSample::new(time_ns, velocity, sd, valid))
}

//! Names by number, for lists and menus; and words about an unknown one.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char};
use std::ptr;
use std::sync::{Mutex, PoisonError};

use bottomlock::mechanisation::IMU_FAULTS;
use bottomlock::navigator::METHODS;
use bottomlock::navigator::events::STREAM_NAMES;
use bottomlock::settings::hint;

use crate::calls::{Failure, Outcome, Status};

/// A known name as a C text. The kernel's names have no NUL, so every one gets its own, once for the life of the process.
pub(crate) fn c_name(name: &'static str) -> *const c_char {
    static NAMES: Mutex<BTreeMap<&'static str, &'static CStr>> = Mutex::new(BTreeMap::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    let made = names
        .entry(name)
        .or_insert_with(|| Box::leak(CString::new(name).unwrap_or_default().into_boxed_c_str()));
    made.as_ptr()
}

/// Name of an aiding method by its number from 0, NULL beyond the last: "ins", "lc", "tc" and so on.
#[unsafe(no_mangle)]
pub extern "C" fn bl_method_name(number: usize) -> *const c_char {
    METHODS.get(number).map_or(ptr::null(), |method| c_name(method.name))
}

/// Name of a stream by its number from 0, NULL beyond the last: "imu", "dvl", "depth" and so on.
#[unsafe(no_mangle)]
pub extern "C" fn bl_stream_name(number: usize) -> *const c_char {
    STREAM_NAMES.get(number).map_or(ptr::null(), |name| c_name(name))
}

/// Name of a fault of inertial readings by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_imu_fault_name(number: usize) -> *const c_char {
    IMU_FAULTS.get(number).map_or(ptr::null(), |name| c_name(name))
}

/// The entry of a name.
pub(crate) fn named<'a, T>(what: &str, name: &str, all: &'a [T], of: impl Fn(&T) -> &'static str) -> Outcome<&'a T> {
    all.iter().find(|one| of(one) == name).ok_or_else(|| {
        let known: Vec<_> = all.iter().map(of).collect();
        let message = format!("unknown {what} '{name}' ({})", hint(name, &known));
        Failure::new(Status::UnknownName, message).about(format!("{what}.preset"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A name is made once, and is the same text ever after.
    #[test]
    fn a_name_stays() {
        // SAFETY: names live as long as the process.
        let text = unsafe { CStr::from_ptr(c_name("depth")) };
        assert_eq!(text, c"depth");
        assert_eq!(c_name("depth"), text.as_ptr());
        assert!(bl_method_name(METHODS.len()).is_null() && !bl_method_name(0).is_null());
    }
}

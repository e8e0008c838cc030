//! Calls from outside: errors as codes with a message, and no panic to a caller.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use bottomlock::NavError;
use bottomlock::error::internal;

/// What a call returns: 0 for success. `bl_last_error()` says what was wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(C)]
pub enum Status {
    /// The call did what it says.
    #[default]
    Ok = 0,
    /// A pointer is NULL that must not be.
    NullPointer = 1,
    /// A number, a count or a text is not what the call takes.
    InvalidValue = 2,
    /// No method or preset has this name.
    UnknownName = 3,
    /// A time that does not come after the one before it in its stream.
    TimeNotIncreasing = 4,
    /// A reading that arrived later than the horizon allows; the navigator counts it.
    TooLate = 5,
    /// A measurement too far ahead of the inertial readings.
    TooFarAhead = 6,
    /// A gap between inertial readings that is longer than the limit.
    ImuGap = 7,
    /// A covariance that is not positive definite.
    NotPositiveDefinite = 8,
    /// Bytes that are no saved navigator of this version.
    NotRestored = 9,
    /// The buffer holds less than there is.
    BufferTooSmall = 10,
    /// There is no such estimate or report.
    NotAvailable = 11,
    /// A fault of the library itself: please report it with the call.
    Internal = 12,
}

/// An error with its code.
#[derive(Debug)]
pub(crate) struct Failure {
    status: Status,
    message: String,
    key: String,
}

impl Failure {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Self {
            status,
            message: message.into(),
            key: String::new(),
        }
    }

    pub(crate) fn invalid(message: impl Into<String>) -> Self {
        Self::new(Status::InvalidValue, message)
    }

    /// The same about a key.
    pub(crate) fn about(self, key: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            ..self
        }
    }

    /// The error of numbers that have no time.
    pub(crate) fn timeless(error: &NavError) -> Self {
        Self::new(status_of(error), error.timeless()).about(error.key())
    }
}

impl From<NavError> for Failure {
    fn from(error: NavError) -> Self {
        Self::new(status_of(&error), error.to_string()).about(error.key())
    }
}

fn status_of(error: &NavError) -> Status {
    match error {
        NavError::UnknownName { .. } => Status::UnknownName,
        NavError::TimeNotIncreasing { .. } => Status::TimeNotIncreasing,
        NavError::TooLate { .. } => Status::TooLate,
        NavError::TooFarAhead { .. } => Status::TooFarAhead,
        NavError::ImuGap { .. } | NavError::ImuGapTooLong { .. } => Status::ImuGap,
        NavError::NotPositiveDefinite { .. } => Status::NotPositiveDefinite,
        NavError::NotRestored { .. } => Status::NotRestored,
        _ => Status::InvalidValue,
    }
}

pub(crate) type Outcome<T> = Result<T, Failure>;

/// What is kept of an error.
#[derive(Default)]
struct Last {
    status: Status,
    message: CString,
    key: CString,
}

thread_local! {
    /// The last error of this thread's calls.
    static LAST: RefCell<Last> = RefCell::new(Last::default());
}

/// Keeps an error for `bl_last_error`; where a thread ends, there is nobody left to ask for it.
fn keep(failure: &Failure) {
    let text = |words: &str| CString::new(words.replace('\0', "\u{fffd}")).unwrap_or_default();
    let kept = Last {
        status: failure.status,
        message: text(&failure.message),
        key: text(&failure.key),
    };
    let _ = LAST.try_with(|last| last.replace(kept));
}

fn caught<T>(work: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
    // What the work changes is not used again after a panic: the lock of a navigator is poisoned by it.
    let caught = catch_unwind(AssertUnwindSafe(work));
    caught.unwrap_or_else(|panic| Err(Failure::new(Status::Internal, internal(panic.as_ref()))))
}

/// A call whose work trusts the caller's pointers as the head of the header asks, the one place where a call does:
/// `call!(status, ..)`, `call!(made, ..)` or `call!(count, ..)`.
macro_rules! call {
    ($kind:ident, $work:expr) => {
        // SAFETY: what the head of the header asks of every caller.
        $crate::calls::$kind(|| unsafe { $work })
    };
}
pub(crate) use call;

/// A call that returns its status.
pub(crate) fn status(work: impl FnOnce() -> Outcome<()>) -> Status {
    caught(work).map_or_else(
        |failure| {
            keep(&failure);
            failure.status
        },
        |()| Status::Ok,
    )
}

/// A call that returns something, or what a failure leaves.
fn or_default<T: Default>(work: impl FnOnce() -> Outcome<T>) -> T {
    caught(work).map_err(|failure| keep(&failure)).unwrap_or_default()
}

/// A call that makes an object; NULL for an error.
pub(crate) fn made<T>(work: impl FnOnce() -> Outcome<T>) -> Option<Box<T>> {
    or_default(|| work().map(|value| Some(Box::new(value))))
}

/// A call that counts; 0 for an error.
pub(crate) fn count(work: impl FnOnce() -> Outcome<usize>) -> usize {
    or_default(work)
}

/// Frees an object that `made` returned; NULL is none.
pub(crate) fn free<T>(object: Option<Box<T>>) {
    or_default(|| {
        drop(object);
        Ok(())
    });
}

/// A text of the last error; empty if none has been.
fn last(of: impl Fn(&Last) -> &CStr) -> *const c_char {
    const NONE: &CStr = c"";
    LAST.try_with(|last| last.try_borrow().map_or(NONE.as_ptr(), |last| of(&last).as_ptr()))
        .unwrap_or(NONE.as_ptr())
}

/// The message of the last call that failed on this thread; empty if none has. It stays until the thread's next failure.
#[unsafe(no_mangle)]
pub extern "C" fn bl_last_error() -> *const c_char {
    last(|last| &last.message)
}

/// The key or argument that it is about, such as "options.water.slip_time_s"; empty where it is about none. It stays as the message.
#[unsafe(no_mangle)]
pub extern "C" fn bl_last_error_key() -> *const c_char {
    last(|last| &last.key)
}

/// The status of the last call that failed on this thread, for calls that return a pointer; `BL_STATUS_OK` if none has.
#[unsafe(no_mangle)]
pub extern "C" fn bl_last_status() -> Status {
    LAST.try_with(|last| last.try_borrow().map_or(Status::Ok, |last| last.status))
        .unwrap_or(Status::Ok)
}

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn bl_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last() -> (Status, String) {
        // SAFETY: the message of this thread, which nothing changes meanwhile.
        let text = unsafe { CStr::from_ptr(bl_last_error()) };
        (bl_last_status(), text.to_str().expect("UTF-8").to_owned())
    }

    /// A panic is a status with its words, and none reaches the caller; the thread goes on.
    #[test]
    #[allow(clippy::panic)]
    fn a_panic_is_a_status() {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(|_| {}));
        assert_eq!(status(|| panic!("place {}", 7)), Status::Internal);
        assert_eq!(last().0, Status::Internal);
        assert!(
            last().1.ends_with("please report it with the call: place 7"),
            "{}",
            last().1
        );
        assert!(made::<u8>(|| panic!("words")).is_none());
        assert!(last().1.ends_with(": words"));
        assert_eq!(count(|| std::panic::panic_any(5_u8)), 0);
        assert!(last().1.ends_with(": no words"));
        std::panic::set_hook(hook);
        assert_eq!(status(|| Ok(())), Status::Ok);
    }

    /// A thread has its own last error, which a success keeps; a NUL within a message does not cut it.
    #[test]
    fn a_thread_has_its_own_error() {
        assert_eq!(status(|| Err(Failure::invalid("one\0two"))), Status::InvalidValue);
        assert_eq!(last(), (Status::InvalidValue, "one\u{fffd}two".to_owned()));
        let other = std::thread::spawn(last).join().expect("no panic");
        assert_eq!(other, (Status::Ok, String::new()));
        assert_eq!(status(|| Ok(())), Status::Ok);
        assert_eq!(last().1, "one\u{fffd}two");
    }

    /// What is made is freed once, and NULL is nothing.
    #[test]
    fn what_is_made_is_freed() {
        free(made(|| Ok(vec![1_u8; 1000])));
        free(None::<Box<u8>>);
    }
}

//! Words that messages are made of.

use std::any::Any;

use super::setting::nearest;

/// The known name that is nearest to an unknown one, in words; nothing where none is alike.
pub(super) fn near(name: &str, known: &str) -> String {
    let known: Vec<&str> = known.split(", ").collect();
    nearest(name, &known).map_or(String::new(), |near| format!("; did you mean '{near}'?"))
}

/// The message of a panic, which is a fault of the kernel itself.
#[must_use]
pub fn internal(panic: &(dyn Any + Send)) -> String {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    let words = words.or_else(|| panic.downcast_ref::<&str>().copied());
    let words = words.unwrap_or("no words");
    format!("internal error of the kernel, please report it with the call: {words}")
}

/// What stands before a part of a message that may be empty.
pub(super) fn before<'a>(words: &'a str, part: &str) -> &'a str {
    if part.is_empty() { "" } else { words }
}

/// A number in a message, without hundreds of digits.
pub(super) fn shown(value: f64) -> String {
    if value == 0.0 || (1e-9..1e15).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

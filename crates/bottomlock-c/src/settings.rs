//! Settings by key: one table of keys for reading, writing, listing and messages.

use std::ffi::c_char;

use bottomlock::NavError;

use crate::calls::{Failure, Outcome, Status};
use crate::names::hint;
use crate::pointers::{text, values};

/// The place of a key's value.
pub(crate) enum Slot<'a> {
    Number(&'a mut f64),
    /// A probability with which a good reading passes; 1 is no gate.
    Gate(&'a mut Option<f64>),
    Count(&'a mut u32),
    Nanoseconds(&'a mut i64),
    /// 0 or 1.
    Switch(&'a mut bool),
    Vector(&'a mut [f64]),
    /// One of some texts.
    Choice(&'a mut Choice),
}

/// One of some texts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Choice {
    pub(crate) chosen: &'static str,
    pub(crate) all: &'static [&'static str],
}

/// A key, and where its value is.
pub(crate) struct Key<S> {
    pub(crate) name: &'static str,
    pub(crate) slot: for<'a> fn(&'a mut S) -> Slot<'a>,
}

/// Settings with keys.
pub(crate) trait Keyed: Clone + 'static {
    /// Their name in messages.
    const OWNER: &'static str;
    const KEYS: &'static [Key<Self>];

    /// Checks every number.
    fn check(&self) -> Result<(), NavError>;

    fn slot(&mut self, name: &str) -> Outcome<Slot<'_>> {
        let Some(key) = Self::KEYS.iter().find(|key| key.name == name) else {
            let known: Vec<_> = Self::KEYS.iter().map(|key| key.name).collect();
            let message = format!("{} has no key '{name}' ({})", Self::OWNER, hint(name, &known));
            return Err(Failure::new(Status::UnknownName, message));
        };
        Ok((key.slot)(self))
    }

    /// Changes a copy and keeps it if it passes its checks, so that settings are always valid.
    fn change(&mut self, name: &str, change: impl FnOnce(Slot<'_>) -> Outcome<()>) -> Outcome<()> {
        let mut changed = self.clone();
        change(changed.slot(name)?)?;
        changed.check()?;
        *self = changed;
        Ok(())
    }

    fn set(&mut self, name: &str, value: f64) -> Outcome<()> {
        let wrong = |expected: &str| {
            Err(Failure::invalid(format!(
                "{}.{name} is {value}, expected {expected}",
                Self::OWNER
            )))
        };
        self.change(name, |slot| {
            match slot {
                Slot::Number(number) => *number = value,
                Slot::Gate(gate) => *gate = (value != 1.0).then_some(value),
                Slot::Count(count) if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) => {
                    *count = value as u32;
                }
                Slot::Count(_) => return wrong("a whole number, 0 or more"),
                // Whole numbers up to 2^53 are exact.
                Slot::Nanoseconds(time) if value.fract() == 0.0 && value.abs() < 9e15 => *time = value as i64,
                Slot::Nanoseconds(_) => return wrong("an integer number of nanoseconds"),
                Slot::Switch(switch) if value == 0.0 || value == 1.0 => *switch = value == 1.0,
                Slot::Switch(_) => return wrong("0 or 1"),
                Slot::Vector(vector) => return wrong(&format!("{} numbers: set the vector", vector.len())),
                Slot::Choice(choice) => return wrong(&format!("a text, {}: set the text", choice.expected())),
            }
            Ok(())
        })
    }

    /// # Safety
    /// As the header asks.
    unsafe fn set_vector(&mut self, name: &str, pointer: *const f64, count: usize) -> Outcome<()> {
        // SAFETY: as the header asks.
        let given = unsafe { values("values", pointer, count) }?;
        self.change(name, |slot| match slot {
            Slot::Vector(vector) if vector.len() == given.len() => {
                vector.copy_from_slice(given);
                Ok(())
            }
            Slot::Vector(vector) => Err(Failure::invalid(format!(
                "{}.{name}: got {count}, expected {} numbers",
                Self::OWNER,
                vector.len()
            ))),
            _ => Err(Failure::invalid(format!("{}.{name} is no vector", Self::OWNER))),
        })
    }

    fn set_text(&mut self, name: &str, value: &str) -> Outcome<()> {
        self.change(name, |slot| match slot {
            Slot::Choice(choice) => match choice.all.iter().find(|one| **one == value) {
                Some(chosen) => {
                    choice.chosen = chosen;
                    Ok(())
                }
                None => Err(Failure::invalid(format!(
                    "{}.{name} is '{value}', expected {}",
                    Self::OWNER,
                    choice.expected()
                ))),
            },
            _ => Err(Failure::invalid(format!("{}.{name} is no text", Self::OWNER))),
        })
    }

    /// The numbers of a key; one but for a vector.
    fn numbers(&self, name: &str) -> Outcome<Vec<f64>> {
        let mut copy = self.clone();
        Ok(match copy.slot(name)? {
            Slot::Number(number) => vec![*number],
            Slot::Gate(gate) => vec![gate.unwrap_or(1.0)],
            Slot::Count(count) => vec![f64::from(*count)],
            Slot::Nanoseconds(time) => vec![*time as f64],
            Slot::Switch(switch) => vec![f64::from(u8::from(*switch))],
            Slot::Vector(vector) => vector.to_vec(),
            Slot::Choice(_) => return Err(Failure::invalid(format!("{}.{name} is a text", Self::OWNER))),
        })
    }

    fn text(&self, name: &str) -> Outcome<&'static str> {
        match self.clone().slot(name)? {
            Slot::Choice(choice) => Ok(choice.chosen),
            _ => Err(Failure::invalid(format!("{}.{name} is no text", Self::OWNER))),
        }
    }
}

impl Choice {
    fn expected(&self) -> String {
        let quoted: Vec<_> = self.all.iter().map(|one| format!("'{one}'")).collect();
        match quoted.split_last() {
            Some((last, [])) => last.clone(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None => String::new(),
        }
    }
}

/// # Safety
/// As the header asks.
pub(crate) unsafe fn key<'a>(pointer: *const c_char) -> Outcome<&'a str> {
    // SAFETY: as the header asks.
    unsafe { text("key", pointer) }
}

/// A line for each key: its name, the kind of its value, and where it is.
macro_rules! keys {
    ($($name:literal: $kind:ident $($path:tt).+;)+) => {
        &[$(Key { name: $name, slot: |settings| Slot::$kind(keys!(@ $kind settings $($path).+)) }),+]
    };
    (@ Vector $settings:ident $($path:tt).+) => { $settings.$($path).+.as_mut_slice() };
    (@ $kind:ident $settings:ident $($path:tt).+) => { &mut $settings.$($path).+ };
}
pub(crate) use keys;

//! Settings that Serde did not read: the refusal names the key, what was expected, and the nearest known key.

use std::fmt::Display;

use serde::de::{Deserialize, Deserializer};

use super::NavError;

/// Reads settings whose name in messages is `place`; their numbers are not checked yet.
///
/// # Errors
/// [`NavError::Setting`] for a key that is unknown or missing, or a value of another type.
pub fn read<'de, T, D>(place: &str, source: D) -> Result<T, NavError>
where
    T: Deserialize<'de>,
    D: Deserializer<'de, Error: Display>,
{
    serde_path_to_error::deserialize(source)
        .map_err(|error| refusal(place, &error.path().to_string(), &error.inner().to_string()))
}

/// The refusal of a value that Serde did not read: `text` are its words.
fn refusal(place: &str, path: &str, text: &str) -> NavError {
    let text = text.split(" at line ").next().unwrap_or(text);
    // Sections of a model have their own names.
    let place = if place == "model" && path != "." { "" } else { place };
    let path = if path == "." { "" } else { path };
    let mut key = [place, path]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(".");
    let quoted: Vec<&str> = text.split('`').skip(1).step_by(2).collect();
    let (name, known) = quoted
        .split_first()
        .map_or(("", &[][..]), |(name, known)| (*name, known));
    let within = |key: &str| {
        if key.is_empty() {
            name.to_owned()
        } else {
            format!("{key}.{name}")
        }
    };
    let (mut found, mut expected, mut hint) = (text.to_owned(), String::new(), String::new());
    if text.starts_with("unknown field") {
        // The path ends at the key, or at what holds it.
        if key.rsplit('.').next() != Some(name) {
            key = within(&key);
        }
        found = "is unknown".into();
        match nearest(name, known) {
            Some(near) => hint = format!("did you mean '{near}'?"),
            None => expected = format!("one of {}", known.join(", ")),
        }
    } else if text.starts_with("missing field") {
        key = within(&key);
        found = "is missing".into();
    } else if text.starts_with("unknown variant") {
        found = format!("is '{name}'");
        expected = one_of(known);
        hint = nearest(name, known).map_or(String::new(), |near| format!("did you mean '{near}'?"));
    } else if let Some((given, wanted)) = text.split_once(", expected ") {
        found = format!("is {}", value(given));
        if let Some(count) = given.strip_prefix("invalid length ") {
            found = format!("has {count} values");
        }
        expected = type_name(wanted);
    }
    NavError::Setting {
        key,
        found,
        expected,
        hint,
    }
}

impl NavError {
    /// The refusal of a setting, without a likely mistake.
    pub(crate) fn setting(key: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Setting {
            key: key.into(),
            found: found.into(),
            expected: expected.into(),
            hint: String::new(),
        }
    }
}

/// The value in Serde's words for it.
fn value(words: &str) -> String {
    let words = words.split_once(": ").map_or(words, |(_, value)| value);
    let inner = |from: char, to: char| Some(&words[words.find(from)? + 1..words.rfind(to)?]);
    match words {
        "null" | "unit value" | "Option value" => "none".into(),
        "map" => "a table".into(),
        "sequence" => "a list".into(),
        _ if words.starts_with("string") => inner('"', '"').map_or(words.into(), |text| format!("'{text}'")),
        _ => inner('`', '`').unwrap_or(words).into(),
    }
}

/// What was expected, in plain words.
fn type_name(words: &str) -> String {
    match words {
        "f64" => "a number".into(),
        "u32" => "a whole number, 0 or more".into(),
        "i64" => "a whole number".into(),
        "a boolean" => "true or false".into(),
        _ if words.starts_with("enum ") => "a text".into(),
        _ if words.starts_with("struct") || words.starts_with("a map") => "a table of settings".into(),
        _ => (words.strip_prefix("an array of length ")).map_or(words.into(), |count| format!("{count} numbers")),
    }
}

fn one_of(known: &[&str]) -> String {
    let quoted: Vec<String> = known.iter().map(|name| format!("'{name}'")).collect();
    match quoted.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => quoted.concat(),
    }
}

/// The known name nearest to one given, if one is alike: with at most half of its letters to change, whatever their case.
#[must_use]
pub fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let near = known.iter().min_by_key(|one| distance(name, one))?;
    (2 * distance(name, near) <= near.len()).then_some(near)
}

/// Words that follow an unknown name: the nearest known one, or all of them.
#[must_use]
pub fn hint(name: &str, known: &[&str]) -> String {
    match nearest(name, known) {
        Some(near) => format!("did you mean '{near}'?"),
        None => format!("known: {}", known.join(", ")),
    }
}

/// Number of letters to insert, drop or change (Levenshtein), whatever their case.
fn distance(one: &str, two: &str) -> usize {
    let two: Vec<u8> = two.to_ascii_lowercase().into_bytes();
    let mut row: Vec<usize> = (0..=two.len()).collect();
    for (i, letter) in one.to_ascii_lowercase().bytes().take(80).enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in two.iter().enumerate() {
            let changed = corner + usize::from(letter != *other);
            corner = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(corner + 1);
        }
    }
    row[two.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters to change, whatever their case; a name too far from all known ones has no nearest one.
    #[test]
    fn the_nearest_name_is_proposed() {
        assert_eq!(distance("kitten", "Sitting"), 3);
        assert_eq!(
            (distance("", "abc"), distance("abc", ""), distance("abc", "abc")),
            (3, 3, 0)
        );
        assert_eq!(nearest("gaate", &["gps", "gate", "water"]), Some("gate"));
        assert_eq!((nearest("xyz", &["gps", "gate"]), nearest("x", &[])), (None, None));
        assert_eq!(hint("gaate", &["gps", "gate", "water"]), "did you mean 'gate'?");
        assert_eq!(hint("xyz", &["gps", "gate"]), "known: gps, gate");
    }
}

//! The rooms of the kernel: who may import whom, and where the vector library stays.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms from the bottom up: each imports only from those before it, so that no circle can arise.
const ROOMS: [&str; 25] = [
    "error",
    "saved",
    "stop",
    "layout",
    "frames",
    "random",
    "workers",
    "chi_squared",
    "simd",
    "state",
    "earth",
    "dvl",
    "mechanisation",
    "error_model",
    "aiding",
    "model",
    "filter",
    "settings",
    "plain_state",
    "presets",
    "navigator",
    "smoother",
    "simulation",
    "replay",
    "observability",
];

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            found.push(path);
        }
    }
}

/// The room of a file, and its lines of code outside tests.
fn rooms_and_code() -> Vec<(String, PathBuf, Vec<String>)> {
    let mut files = Vec::new();
    rust_files(&sources(), &mut files);
    let is_code = |path: &PathBuf| {
        let is_test = path.ends_with("testing.rs") || path.to_str().unwrap().ends_with("tests.rs");
        !path.ends_with("lib.rs") && !is_test
    };
    let read = |path: PathBuf| {
        let first = path.strip_prefix(sources()).unwrap().components().next().unwrap();
        let room = first.as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned();
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        (room, path, lines.map(str::to_owned).collect())
    };
    files.into_iter().filter(is_code).map(read).collect()
}

fn rank(room: &str) -> usize {
    let place = ROOMS.iter().position(|known| *known == room);
    place.unwrap_or_else(|| panic!("room {room} has no place in the order"))
}

#[test]
fn no_room_imports_from_one_above_it() {
    let mut imports = 0;
    for (room, path, code) in rooms_and_code() {
        for line in &code {
            for part in line.split("crate::").skip(1) {
                let other: String = part
                    .chars()
                    .take_while(|c| c.is_ascii_lowercase() || *c == '_')
                    .collect();
                if other.is_empty() || other == room {
                    continue;
                }
                imports += 1;
                assert!(rank(&other) < rank(&room), "{}: {line}", path.display());
            }
        }
    }
    assert!(imports > 100, "only {imports} imports found");
}

#[test]
fn the_vector_library_stays_in_its_room() {
    for (room, path, code) in rooms_and_code() {
        let named = code.iter().find(|line| line.contains("fearless_simd"));
        assert!(room == "simd" || named.is_none(), "{}: {named:?}", path.display());
    }
}

#[test]
fn no_file_is_longer_than_a_screenful_of_ideas() {
    let mut files = Vec::new();
    for folder in ["src", "tests", "examples"] {
        rust_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut files);
    }
    for path in files {
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 400, "{}: {lines} lines", path.display());
    }
}

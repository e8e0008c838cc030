//! C interface of the bottomlock kernel: check, call, map errors; no formula.
//!
//! `include/bottomlock.h` is made from these files by cbindgen (`make header`), with the rules for callers at its head
//! (`cbindgen.toml`). `include/bottomlock.hpp` wraps it for C++17. How it is used: `docs/howto/c_and_cpp.md`.

mod calls;
mod estimates;
mod geometry;
mod model;
mod names;
mod navigator;
mod options;
mod pointers;
mod push;
mod report;
mod settings;
mod state;
mod velocity;

//! Laws across modules of the kernel, on the kernel that the wheel is made of; one program, since each would be linked anew.

// Helpers outside `#[test]` functions panic on failure too.
#![allow(clippy::unwrap_used, clippy::panic)]

mod batch;
mod common;
mod frozen_dvl;
mod hostile_input;
mod lanes;
mod late;
mod late_law;
mod live;
mod own_method;
mod rooms;
mod speed_bound;
mod streams;
mod sway_current;
mod theorems;

//! Navigators: the event loop and the aiding methods.
//!
//! Campaign, replay and live use push events to the same [`Navigator`]; a live one checks them first ([`LiveNavigator`]).

mod checked;
pub(crate) mod dual_filter;
pub mod estimates;
pub mod event_loop;
pub mod events;
pub mod first_readings;
mod history;
pub(crate) mod imu_check;
mod imu_course;
mod late;
pub mod live;
mod measurable;
pub mod methods;
pub mod notice;
pub mod own_method;
pub(crate) mod run_events;
mod saved;

pub use self::event_loop::{BeamAiding, Navigator};
pub use self::live::LiveNavigator;
pub use self::methods::{METHODS, Method, RECOMMENDED_METHOD};
pub use self::notice::{Finding, Notice, Standing};
pub use self::saved::Snapshot;

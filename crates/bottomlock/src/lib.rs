//! Aided inertial navigation with partial Doppler velocity log (DVL) measurements.
//!
//! # A navigator
//! Inertial readings and pings of two beams are pushed with their times; the estimate comes with its covariance. Each
//! measurement used gives a report: innovation, NIS, accepted or rejected.
//!
//! ```
//! use bottomlock::NavError;
//! use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus};
//! use bottomlock::filter::options::Options;
//! use bottomlock::filter::report::UpdateReport;
//! use bottomlock::frames::Vec3;
//! use bottomlock::layout::{MAX_BEAMS, VELOCITY};
//! use bottomlock::mechanisation::ImuSample;
//! use bottomlock::model::Model;
//! use bottomlock::navigator::events::Event;
//! use bottomlock::navigator::{Method, Navigator};
//! use bottomlock::state::NavState;
//!
//! # fn main() -> Result<(), NavError> {
//! let geometry = BeamGeometry::janus(Janus::X, 20_f64.to_radians())?;
//! let (model, method) = (Model::table_2(), Method::named("sway_current")?);
//! let start = NavState { velocity_p_mps: Vec3::new(2.0, 0.0, 0.0), ..NavState::at_rest(0) };
//! let mut navigator = Navigator::new(start, geometry.clone(), method.aiding, &model, &Options::default())?;
//!
//! let mut ping = BeamSample {
//!     time_ns: 0,
//!     velocity_mps: [f64::NAN; MAX_BEAMS], // of lost beams nothing is read
//!     sd_mps: [0.042; MAX_BEAMS],
//!     valid: BeamMask::all(2),
//! };
//! for beam in ping.valid.iter() {
//!     ping.velocity_mps[beam] = geometry.direction_p(beam).x * 2.0; // 2 m/s ahead
//! }
//! let mut used = 0;
//! let mut report = |one: &UpdateReport| used += usize::from(one.was_used());
//! for step in 0..=1001 {
//!     let time_ns = step * 10_000_000; // 100 Hz
//!     let level = ImuSample {
//!         time_ns,
//!         rate_p_radps: Vec3::zeros(),
//!         force_p_mps2: Vec3::new(0.0, 0.0, -model.environment.gravity_mps2),
//!     };
//!     navigator.push(&Event::Imu(level), &mut report)?; // completes what waits for it
//!     if step > 0 && step % 100 == 0 {
//!         ping.time_ns = time_ns;
//!         navigator.push(&Event::Beams(ping), &mut report)?;
//!     }
//! }
//! let surge_sd_mps = navigator.covariance()[(VELOCITY, VELOCITY)].sqrt();
//! let surge_mps = navigator.state().velocity_p_mps.to_array()[0];
//! assert!((surge_mps - 2.0).abs() < 0.05, "{surge_mps}");
//! let of_one_ping_mps = 0.042 / (2_f64.sqrt() * geometry.direction_p(0).x);
//! assert!(surge_sd_mps < of_one_ping_mps, "{surge_sd_mps}");
//! assert_eq!(used, 30); // of each ping the beams, and what the method knows of sway and heave through the water
//! # Ok(())
//! # }
//! ```
//!
//! On a vehicle [`navigator::LiveNavigator`] adds what a live stream needs: samples that come late or twice, faulty
//! inertial readings, and units that cannot be.
//!
//! # Frames, units, signs
//! The tangent frame (`_t`) is north–east–down and fixed to the Earth. The platform frame (`_p`) is forward–right–down
//! and fixed to the vehicle. `attitude_t_p` maps platform vectors to the tangent frame. Units are SI, angles are
//! radians, time is integer nanoseconds. The error state is true minus estimate (Eq. 1), with R = Exp([ρ×]) R̂ for the
//! attitude.
//!
//! # Order of the error state
//! Position (tangent), misalignment ρ (tangent), velocity (platform), accelerometer bias, gyro bias, four beam biases,
//! scale factor: 20 states; see [`layout`]. The method with a model of the motion through the water has six more; see
//! [`aiding::water`].
//!
//! # Equations of Tal, Klein & Katz 2017
//! | Equations | Module |
//! |---|---|
//! | 1–11 | [`state`], [`error_model`] |
//! | 12–16 | [`dvl::geometry`], [`simulation::sensor_errors`] |
//! | 17–21 | [`dvl::velocity`] |
//! | 18, 22 | [`aiding`] |
//! | 23–49 | [`dvl::partial`] |
//!
//! Klein & Diamant 2015, Eqs. 1–6, 10, 13–15: [`observability`].
//!
//! The code holds the corrected equations. `docs/equations.md` lists the errata of the papers.

// A vehicle's kernel lacks what calls the rest of these.
#![cfg_attr(not(feature = "simulation"), allow(dead_code, unused_imports))]

pub mod aiding;
mod chi_squared;
pub mod dvl;
pub mod earth;
pub mod error;
pub mod error_model;
pub mod filter;
pub mod frames;
pub mod layout;
pub mod mechanisation;
pub mod model;
pub mod navigator;
#[cfg(feature = "simulation")]
pub mod observability;
pub mod plain_state;
pub mod presets;
#[cfg(feature = "simulation")]
pub mod random;
#[cfg(feature = "simulation")]
pub mod replay;
mod saved;
pub mod settings;
pub mod simd;
#[cfg(feature = "simulation")]
pub mod simulation;
pub mod smoother;
pub mod state;
pub mod stop;
#[cfg(test)]
mod testing;
#[cfg(feature = "simulation")]
mod workers;

pub use error::NavError;
pub use stop::Stop;

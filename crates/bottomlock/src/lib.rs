//! Aided inertial navigation with partial Doppler velocity log (DVL) measurements.
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
pub mod observability;
pub mod random;
pub mod replay;
mod saved;
pub mod simd;
pub mod simulation;
pub mod smoother;
pub mod state;
pub mod stop;
mod workers;

pub use error::NavError;
pub use stop::Stop;

//! The aiding methods and their short names.

use crate::dvl::partial::PartialMethod;
use crate::error::NavError;
use crate::navigator::event_loop::BeamAiding;
use crate::navigator::own_method::{OwnMethod, registered};

/// An aiding method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    /// Short name, as in scenarios and tables.
    pub name: &'static str,
    /// How the method uses the beams.
    pub aiding: BeamAiding,
    /// True for the reference method, which also receives the beams that a schedule marks lost.
    pub all_beams: bool,
}

/// All methods.
pub const METHODS: [Method; 11] = [
    Method {
        name: "ins",
        aiding: BeamAiding::None,
        all_beams: false,
    },
    Method {
        name: "lc",
        aiding: BeamAiding::Loose(PartialMethod::LeastSquares),
        all_beams: true,
    },
    Method {
        name: "tc",
        aiding: BeamAiding::Tight,
        all_beams: false,
    },
    Method {
        name: "vb",
        aiding: BeamAiding::Loose(PartialMethod::VirtualBeam),
        all_beams: false,
    },
    Method {
        name: "nsv",
        aiding: BeamAiding::Loose(PartialMethod::NullifiedSway),
        all_beams: false,
    },
    Method {
        name: "plcf",
        aiding: BeamAiding::Loose(PartialMethod::PartialLoose),
        all_beams: false,
    },
    Method {
        name: "vhv",
        aiding: BeamAiding::Loose(PartialMethod::VirtualHeave),
        all_beams: false,
    },
    Method {
        name: "elc",
        aiding: BeamAiding::Loose(PartialMethod::Selector),
        all_beams: false,
    },
    Method {
        name: "info",
        aiding: BeamAiding::Loose(PartialMethod::Information),
        all_beams: false,
    },
    Method {
        name: "weak_sway",
        aiding: BeamAiding::Loose(PartialMethod::WeakSway),
        all_beams: false,
    },
    Method {
        name: "sway_current",
        aiding: BeamAiding::SwayCurrent,
        all_beams: false,
    },
];

/// The method that is recommended, and the default wherever one is used that is not named. It assumes a slender vehicle, unless
/// the prior of the motion through the water is that of another.
pub const RECOMMENDED_METHOD: &str = "sway_current";

impl Method {
    /// Finds a method by its short name, also one that was [registered](crate::navigator::own_method::register).
    ///
    /// # Errors
    /// [`NavError::UnknownName`], which lists the known names.
    pub fn named(name: &str) -> Result<Self, NavError> {
        let known = METHODS.iter().find(|method| method.name == name).copied();
        known
            .or_else(|| registered(name).map(OwnMethod::as_method))
            .ok_or_else(|| NavError::UnknownName {
                what: "method",
                name: name.into(),
                expected: "ins, lc, tc, vb, nsv, plcf, vhv, elc, info, weak_sway, sway_current",
            })
    }
}

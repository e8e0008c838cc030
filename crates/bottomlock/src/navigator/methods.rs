//! The aiding methods and their short names.

use crate::dvl::partial::PartialMethod;
use crate::error::NavError;
use crate::navigator::event_loop::BeamAiding;
use crate::navigator::navigator_set::Aiding;
use crate::navigator::own_method::{OwnMethod, registered};

/// An aiding method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    /// Short name, as in scenarios and tables.
    pub name: &'static str,
    /// How the method uses the beams.
    pub aiding: Aiding,
    /// True for the reference method, which also receives the beams that a schedule marks lost.
    pub all_beams: bool,
}

/// All methods.
pub const METHODS: [Method; 13] = [
    Method {
        name: "ins",
        aiding: Aiding::One(BeamAiding::None),
        all_beams: false,
    },
    Method {
        name: "lc",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::LeastSquares)),
        all_beams: true,
    },
    Method {
        name: "tc",
        aiding: Aiding::One(BeamAiding::Tight),
        all_beams: false,
    },
    Method {
        name: "vb",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::VirtualBeam)),
        all_beams: false,
    },
    Method {
        name: "nsv",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::NullifiedSway)),
        all_beams: false,
    },
    Method {
        name: "plcf",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::PartialLoose)),
        all_beams: false,
    },
    Method {
        name: "vhv",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::VirtualHeave)),
        all_beams: false,
    },
    Method {
        name: "elc",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::Selector)),
        all_beams: false,
    },
    Method {
        name: "vb_exact",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::VirtualBeamExact)),
        all_beams: false,
    },
    Method {
        name: "info",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::Information)),
        all_beams: false,
    },
    Method {
        name: "weak_sway",
        aiding: Aiding::One(BeamAiding::Loose(PartialMethod::WeakSway)),
        all_beams: false,
    },
    Method {
        name: "sway_current",
        aiding: Aiding::One(BeamAiding::SwayCurrent),
        all_beams: false,
    },
    Method {
        name: "consistent",
        aiding: Aiding::Consistent,
        all_beams: false,
    },
];

impl Method {
    /// Finds a method by its short name, also one that was [registered](crate::navigator::own_method::register).
    ///
    /// # Errors
    /// [`NavError::UnknownName`], which lists the known names.
    pub fn named(name: &str) -> Result<Self, NavError> {
        METHODS
            .iter()
            .find(|method| method.name == name)
            .copied()
            .or_else(|| registered(name).map(OwnMethod::as_method))
            .ok_or_else(|| NavError::UnknownName {
                what: "method",
                name: name.into(),
                expected: "ins, lc, tc, vb, nsv, plcf, vhv, elc, vb_exact, info, weak_sway, sway_current, consistent",
            })
    }
}

//! Which beams of an instrument are meant, of 1 to [`MAX_BEAMS`].

use crate::layout::MAX_BEAMS;

/// Set of beams, for example those with a valid velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, serde::Serialize, serde::Deserialize)]
pub struct BeamMask(u8);

impl BeamMask {
    /// No beam.
    pub const NONE: Self = Self(0);

    /// The first `count` beams.
    #[must_use]
    pub fn all(count: usize) -> Self {
        (0..count.min(MAX_BEAMS)).collect()
    }
    /// Returns true if beam `index` (counted from 0) is in the mask.
    #[must_use]
    pub fn contains(self, index: usize) -> bool {
        index < MAX_BEAMS && self.0 & (1 << index) != 0
    }
    /// Number of beams in the mask.
    #[must_use]
    pub fn count(self) -> usize {
        self.0.count_ones() as usize
    }
    /// Indices of the beams, counted from 0, in increasing order.
    pub fn iter(self) -> impl Iterator<Item = usize> + Clone {
        (0..MAX_BEAMS).filter(move |&index| self.contains(index))
    }
    /// The beams in both masks.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
    /// The beams in either mask.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl FromIterator<usize> for BeamMask {
    fn from_iter<I: IntoIterator<Item = usize>>(indices: I) -> Self {
        Self(
            indices
                .into_iter()
                .filter(|&index| index < MAX_BEAMS)
                .fold(0, |bits, index| bits | 1 << index),
        )
    }
}

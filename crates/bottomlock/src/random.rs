//! Seeded random numbers: every stream of a run is its own ChaCha8 stream under the run's key.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

/// The numbers of one random stream, drawn in order.
#[derive(Debug)]
pub struct Normals(ChaCha8Rng);

impl Normals {
    /// Stream `number` under a seed.
    #[must_use]
    pub fn new(seed: [u8; 32], number: u64) -> Self {
        let mut generator = ChaCha8Rng::from_seed(seed);
        generator.set_stream(number);
        Self(generator)
    }
    /// A standard normal number.
    pub fn one(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
    /// Three normal numbers of these standard deviations.
    pub fn each(&mut self, sd: &[f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|k, _| sd[k] * self.one())
    }
    /// A uniform number, 0 or more and less than 1.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * 2_f64.powi(-53)
    }
    pub(crate) fn fill(&mut self, rows: &mut [[f64; 3]]) {
        rows.as_flattened_mut().fill_with(|| self.one());
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Word for word those of `rand_chacha`, over several refills, whatever the key and the stream: two libraries, one cipher.
        #[test]
        fn words_are_those_of_the_cipher(seed: [u8; 32], number: u64) {
            let mut own = Normals::new(seed, number);
            let mut other = <rand_chacha::ChaCha8Rng as SeedableRng>::from_seed(seed);
            other.set_stream(number);
            for _ in 0..400 {
                prop_assert_eq!(own.0.next_u64(), other.next_u64());
            }
        }

        /// Uniform numbers fill [0, 1) evenly: the mean of 4096 lies within five of its standard deviations of a half.
        #[test]
        fn uniform_numbers_are_uniform(seed: [u8; 32]) {
            let mut own = Normals::new(seed, 1);
            let drawn: Vec<f64> = (0..4096).map(|_| own.uniform()).collect();
            prop_assert!(drawn.iter().all(|u| (0.0..1.0).contains(u)));
            let mean = drawn.iter().sum::<f64>() / 4096.0;
            prop_assert!((mean - 0.5).abs() < 5.0 / (12.0_f64 * 4096.0).sqrt());
        }
    }
}

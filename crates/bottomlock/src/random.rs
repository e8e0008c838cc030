//! Seeded random numbers: every stream of a run is its own ChaCha8 stream under the run's key.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

/// The numbers of one random stream, drawn in order.
#[derive(Debug)]
pub struct Normals {
    generator: ChaCha8Rng,
    /// Time, ns, and value of a process at its last draw.
    last: Option<(i64, f64)>,
}

impl Normals {
    /// Stream `number` under a seed.
    #[must_use]
    pub fn new(seed: [u8; 32], number: u64) -> Self {
        let mut generator = ChaCha8Rng::from_seed(seed);
        generator.set_stream(number);
        Self { generator, last: None }
    }
    /// A standard normal number.
    pub fn one(&mut self) -> f64 {
        StandardNormal.sample(&mut self.generator)
    }
    /// Three normal numbers of these standard deviations.
    pub fn each(&mut self, sd: &[f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|k, _| sd[k] * self.one())
    }
    /// A uniform number, 0 or more and less than 1.
    pub fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * 2_f64.powi(-53)
    }
    /// The value at a time, ns, of the stream's Gauss–Markov process; times rise. `sd` is its standard deviation, 0 for
    /// none, and `time_s` its correlation time.
    pub fn gauss_markov(&mut self, sd: f64, time_s: f64, time_ns: i64) -> f64 {
        if sd == 0.0 {
            return 0.0;
        }
        let value = match self.last {
            None => sd * self.one(),
            Some((last_ns, value)) => {
                let left = (-((time_ns - last_ns) as f64) * 1e-9 / time_s).exp();
                left * value + (1.0 - left * left).sqrt() * sd * self.one()
            }
        };
        self.last = Some((time_ns, value));
        value
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
                prop_assert_eq!(own.generator.next_u64(), other.next_u64());
            }
        }

        /// Over 2,000 streams a process at 0, 10 and 1000 s has the variance it is asked for, and the correlation
        /// exp(−10/τ) and nearly none.
        #[test]
        fn a_gauss_markov_process_has_its_variance_and_correlation(seed: [u8; 32]) {
            let drawn: Vec<[f64; 3]> = (0..2000)
                .map(|number| {
                    let mut own = Normals::new(seed, number);
                    [0, 10, 1000].map(|second| own.gauss_markov(0.5, 20.0, second * 1_000_000_000))
                })
                .collect();
            let mean = |of: &dyn Fn(&[f64; 3]) -> f64| drawn.iter().map(of).sum::<f64>() / 2000.0 / 0.25;
            for k in 0..3 {
                prop_assert!((mean(&|x| x[k] * x[k]) - 1.0).abs() < 0.2);
            }
            prop_assert!((mean(&|x| x[0] * x[1]) - (-0.5_f64).exp()).abs() < 0.15);
            prop_assert!(mean(&|x| x[1] * x[2]).abs() < 0.15);
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

//! ChaCha with eight rounds, sixteen blocks at a time in the vectors of the machine: random bits for the inertial noise.
//!
//! The words are those of `rand_chacha::ChaCha8Rng` with the same seed and stream, one for one, at less than half the cost; the
//! slow sensors keep the library's generator, which holds fewer words in store. Bernstein 2008, "ChaCha, a variant of Salsa20",
//! with a counter and a stream number of 64 bits each.

use fearless_simd::prelude::*;
use fearless_simd::u32x16;
use rand_chacha::rand_core::{Infallible, TryRng};

use crate::lane::with_vectors;

/// Blocks of a refill.
const BLOCKS: usize = 16;
/// Pairs of words in a block.
const PAIRS: usize = 8;

/// A generator of 64-bit words.
#[derive(Debug, Clone)]
pub(crate) struct Keystream {
    /// Constants and key: the first twelve words of every block's input.
    key: [u32; 12],
    /// Number of the block that comes next.
    block: u64,
    stream: u64,
    store: [u64; BLOCKS * PAIRS],
    next: usize,
}

impl Keystream {
    pub(crate) fn new(seed: &[u8; 32], stream: u64) -> Self {
        let mut key = [0; 12];
        let bytes = b"expand 32-byte k".iter().chain(seed).copied();
        for (k, byte) in bytes.enumerate() {
            key[k / 4] |= u32::from(byte) << (8 * (k % 4));
        }
        Self {
            key,
            block: 0,
            stream,
            store: [0; BLOCKS * PAIRS],
            next: BLOCKS * PAIRS,
        }
    }

    #[inline(never)]
    fn refill(&mut self) {
        with_vectors!(simd => self.generate(simd));
        self.block = self.block.wrapping_add(BLOCKS as u64);
        self.next = 0;
    }

    /// Sixteen blocks, one in each lane; on their way to the store they are turned round to follow one another.
    #[inline(always)]
    fn generate<S: Simd>(&mut self, simd: S) {
        let splat = |word: u32| u32x16::splat(simd, word);
        let blocks: [u64; BLOCKS] = std::array::from_fn(|k| self.block.wrapping_add(k as u64));
        let mut input = [splat(0); 2 * PAIRS];
        for (row, &word) in input.iter_mut().zip(&self.key) {
            *row = splat(word);
        }
        input[12] = u32x16::simd_from(simd, blocks.map(|block| block as u32));
        input[13] = u32x16::simd_from(simd, blocks.map(|block| (block >> 32) as u32));
        input[14] = splat(self.stream as u32);
        input[15] = splat((self.stream >> 32) as u32);
        let mut x = input;
        for _ in 0..4 {
            for k in 0..4 {
                quarter_round(&mut x, [k, 4 + k, 8 + k, 12 + k]);
            }
            for k in 0..4 {
                quarter_round(&mut x, [k, 4 + (k + 1) % 4, 8 + (k + 2) % 4, 12 + (k + 3) % 4]);
            }
        }
        let mut words = [[0; BLOCKS]; 2 * PAIRS];
        for k in 0..2 * PAIRS {
            (x[k] + input[k]).store_slice(&mut words[k]);
        }
        for block in 0..BLOCKS {
            for k in 0..PAIRS {
                let (low, high) = (words[2 * k][block], words[2 * k + 1][block]);
                self.store[block * PAIRS + k] = u64::from(low) | u64::from(high) << 32;
            }
        }
    }
}

#[inline(always)]
fn quarter_round<S: Simd>(x: &mut [u32x16<S>; 16], [a, b, c, d]: [usize; 4]) {
    x[a] += x[b];
    x[d] = rotated(x[d] ^ x[a], 16);
    x[c] += x[d];
    x[b] = rotated(x[b] ^ x[c], 12);
    x[a] += x[b];
    x[d] = rotated(x[d] ^ x[a], 8);
    x[c] += x[d];
    x[b] = rotated(x[b] ^ x[c], 7);
}

#[inline(always)]
fn rotated<S: Simd>(x: u32x16<S>, by: u32) -> u32x16<S> {
    (x << by) | (x >> (32 - by))
}

impl TryRng for Keystream {
    type Error = Infallible;

    /// The lower half of a 64-bit word; the upper one is lost.
    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        self.try_next_u64().map(|word| word as u32)
    }

    #[inline(always)]
    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        if self.next >= self.store.len() {
            self.refill();
        }
        let word = self.store[self.next];
        self.next += 1;
        Ok(word)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for part in bytes.chunks_mut(8) {
            let word = self.try_next_u64()?.to_le_bytes();
            part.copy_from_slice(&word[..part.len()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::lane::on_every_level;

    fn library(seed: [u8; 32], stream: u64) -> ChaCha8Rng {
        let mut generator = ChaCha8Rng::from_seed(seed);
        generator.set_stream(stream);
        generator
    }

    proptest! {
        /// Word for word those of the library, over several refills, whatever the seed and the stream.
        #[test]
        fn words_are_those_of_the_library(seed: [u8; 32], stream: u64) {
            let (mut own, mut library) = (Keystream::new(&seed, stream), library(seed, stream));
            for _ in 0..3 * BLOCKS * PAIRS + 5 {
                prop_assert_eq!(own.next_u64(), library.next_u64());
            }
        }
    }

    /// The same words in the vectors of every machine, also where the block's number leaves 32 bits.
    #[test]
    fn every_machine_has_the_same_words() {
        let begin = u64::from(u32::MAX) - 3;
        let mut library = library([3; 32], 7);
        library.set_word_pos(u128::from(begin) * 16);
        let expected: Vec<u64> = (0..BLOCKS * PAIRS).map(|_| library.next_u64()).collect();
        on_every_level!(simd => {
            let mut own = Keystream::new(&[3; 32], 7);
            own.block = begin;
            own.generate(simd);
            assert_eq!(own.store[..], expected[..]);
        });
    }
}

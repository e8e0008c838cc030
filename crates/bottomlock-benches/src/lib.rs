//! Benchmarks alone: see `benches/kernel.rs`.

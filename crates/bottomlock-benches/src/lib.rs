//! Benchmarks alone: see `benches/kernel.rs` and `benches/late.rs`.

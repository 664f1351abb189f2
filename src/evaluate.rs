//! Cases with truth to figures: what a detector finds and misses, how far poses are off, and whether what is stated holds.

pub mod recorded;

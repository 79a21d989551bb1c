//! Tests of identification, sessions and comparison, one program: to build and link one costs less than many.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

#[path = "common/arm.rs"]
mod arm;

mod arithmetic;
mod compare;
mod counts;
mod coverage;
mod degenerate;
mod distances;
mod elasticity;
mod follow;
mod identification;
mod known;
mod mutations;
mod places;
mod read_otherwise;
mod sessions;
mod simulate;
mod stream;

//! Tests of recordings, one program: to build and link one costs less than many.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    missing_docs
)]

mod bags;
mod formats;
mod round_trip;

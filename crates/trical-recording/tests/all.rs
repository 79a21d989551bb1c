//! Tests of recordings, one program: to build and link one costs less than many.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bags;
mod formats;
mod round_trip;

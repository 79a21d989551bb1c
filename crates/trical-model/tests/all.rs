//! Tests of kinematics and model files, one program: to build and link one costs less than many.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    missing_docs
)]

mod derivatives;
mod mutations;
mod robots;
mod shapes;

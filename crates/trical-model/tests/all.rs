//! Tests of kinematics and model files, one program: to build and link one costs less than many.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::panic)]

mod derivatives;
mod mutations;
mod robots;
mod shapes;

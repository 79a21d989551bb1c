//! Tests of the diagnosis, one program: to build and link one costs less than many.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used)]

#[path = "../../trical-ident/tests/common/arm.rs"]
mod arm;

mod diagnosis;
mod effects;
mod encoder;
mod evidence;
mod linear_picture;
mod rejection;

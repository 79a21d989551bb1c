//! Tests of the command line, one program: to build and link one costs less than many, and what waits leaves the processor to others.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod common;
#[path = "../crates/trical-device/tests/common/rws_server.rs"]
mod rws_server;
#[path = "../crates/trical-device/tests/common/ur_server.rs"]
mod ur_server;

mod cli;
mod compensate;
mod corpus;
mod device_cli;
mod device_faults;
#[cfg(unix)] // limits of memory by the shell, pipes, devices
mod hostile;
mod record;
mod report;

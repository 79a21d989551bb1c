//! Tests of the simulated devices, drivers and procedure, one program: to build and link one costs less than many.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::panic)]

mod common;
#[path = "common/rws_server.rs"]
mod rws_server;
#[path = "common/ur_server.rs"]
mod ur_server;

mod controller;
mod faults;
mod fuzz;
#[cfg(unix)] // on pseudo-terminals
mod gauges;
mod kill;
mod million;
mod procedure;
mod rapid_module;
mod recording;
mod rws;
mod untrue;
mod ur;

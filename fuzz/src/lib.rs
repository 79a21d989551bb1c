//! What is asked of every reader of bytes from outside: no panic, and nothing taken that is not finite or not allowed.
//!
//! Each function is given any bytes and says whether the reader took them. The fuzz targets call them, and so does a test of the
//! workspace (`tests/corpus.rs`) over the files in `corpus/`, and the tests that change valid files at random (`mutations.rs`).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod device;
pub mod ident;
pub mod model;
pub mod plan;
pub mod program;

/// A reader, given any bytes: whether it took them.
pub type Target = fn(&[u8]) -> bool;

/// All targets by name, which is that of the fuzz target and of the folder in `corpus/`.
pub const TARGETS: [(&str, Target); 24] = [
    // files
    ("robot", model::robot),
    ("cell", model::cell),
    ("urdf", model::urdf),
    ("recording", ident::recording),
    ("model", ident::model),
    ("known", ident::known),
    ("plan", plan::plan),
    ("geometry", plan::geometry),
    ("mesh", plan::mesh),
    ("mcap", device::mcap),
    ("joint_state", device::joint_state),
    ("row", device::row),
    // programs
    ("program_rapid", program::rapid),
    ("program_krl", program::krl),
    ("program_fanuc", program::fanuc),
    ("program_urscript", program::urscript),
    ("program_csv", program::csv),
    ("frames", program::frames),
    // devices
    ("url", device::url),
    ("uwave", device::uwave),
    ("line", device::line),
    ("rapid", device::rapid),
    ("rws", device::rws),
    ("rtde", device::rtde),
];

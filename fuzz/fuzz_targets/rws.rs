//! Answers of Robot Web Services.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::controller::rws_protocol::{parse_joints, parse_value, unquoted};

fuzz_target!(|data: &str| {
    if let Some((q, count)) = parse_joints(data) {
        assert!(count <= 6 && q.iter().all(|q| q.is_finite()));
    }
    if let Some(value) = parse_value(data) {
        let _ = unquoted(&value);
    }
});

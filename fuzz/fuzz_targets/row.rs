//! Rows as JSON: what is taken comes back as it was.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::record::json::{row_from_json, row_to_json};

fuzz_target!(|data: &[u8]| {
    if let Ok((row, joints)) = row_from_json(data) {
        assert!((1..=9).contains(&joints));
        let _ = row_to_json(&row, joints);
    }
});

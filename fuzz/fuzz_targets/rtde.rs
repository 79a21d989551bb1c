//! Packages of Universal Robots' data exchange.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::controller::rtde::{parse_state, take};

fuzz_target!(|data: &[u8]| {
    let mut bytes = data.to_vec();
    while let Ok(Some((_, content))) = take(&mut bytes) {
        if let Some(state) = parse_state(&content, 1) {
            assert!(state.t.is_finite() && state.q.iter().all(|q| q.is_finite()));
        }
    }
});

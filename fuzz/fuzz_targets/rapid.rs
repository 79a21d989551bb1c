//! Messages of the RAPID module, both ways.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::controller::rapid_protocol::{parse_numbers, parse_reply, parse_request};

fuzz_target!(|data: &[u8]| {
    if let Some(request) = parse_request(data) {
        assert!(request.parameters.iter().all(|value| value.is_finite()));
    }
    if let Some(numbers) = parse_reply(data).and_then(|reply| parse_numbers(&reply.data)) {
        assert!(numbers.iter().all(|value| value.is_finite()));
    }
});

//! Records and requests of the U-WAVE-R: no panic, and only finite values.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::gauge::uwave_protocol::{Record, parse_record, parse_request};

fuzz_target!(|data: &[u8]| {
    if let Some(Record::Data { value, .. }) = parse_record(data) {
        assert!(value.is_finite() && data.len() == 20);
    }
    let _ = parse_request(data);
});

//! Lines of other gauges, under any pattern: no panic, and only finite values.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::gauge::line_protocol::{LineReply, Pattern, parse_line};

fuzz_target!(|data: (String, Vec<u8>)| {
    let (pattern, line) = data;
    for pattern in [Pattern::parse(&pattern), Some(Pattern::default())].into_iter().flatten() {
        if let LineReply::Values(values) = parse_line(&line, &pattern) {
            assert!(values.iter().all(|(value, _)| value.is_finite()));
        }
    }
});

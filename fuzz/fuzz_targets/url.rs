//! Device URLs.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::url::DeviceUrl;

fuzz_target!(|data: &str| {
    if let Ok(mut url) = DeviceUrl::parse(data) {
        let _ = url.take_number("x", 0.0, 0.0..=1.0);
        let _ = url.finish("x");
    }
});

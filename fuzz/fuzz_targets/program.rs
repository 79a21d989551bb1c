//! Bytes as a program of every dialect: targets or a sentence.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::program::Dialect;

fuzz_target!(|data: &[u8]| {
    for dialect in Dialect::ALL {
        if let Ok(scan) = dialect.scan(data) {
            assert!(scan.spots.iter().all(|s| scan.at(s) < data.len()));
        }
    }
});

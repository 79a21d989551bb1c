//! Recordings, whole, cut or damaged: an error or what is whole, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::record::read_bytes;

fuzz_target!(|data: &[u8]| {
    let _ = read_bytes("fuzz.mcap".as_ref(), data);
    // most inputs lack the magic
    let headed = [&[0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'], data].concat();
    if let Ok(read) = read_bytes("fuzz.mcap".as_ref(), &headed) {
        assert!(read.lost.is_some() || !data.is_empty());
    }
});

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    trical_fuzz::program::urscript(data);
});

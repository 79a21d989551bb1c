//! `sensor_msgs/msg/JointState` in CDR: what is taken comes back as it was.
#![no_main]

use libfuzzer_sys::fuzz_target;
use trical_device::record::cdr::JointState;

fuzz_target!(|data: &[u8]| {
    let headed = [&[0, 1, 0, 0], data].concat();
    for bytes in [data, &headed] {
        if let Some(state) = JointState::from_cdr(bytes) {
            let again = JointState::from_cdr(&state.to_cdr()).map(|state| state.to_cdr());
            // compared as bytes: NaN is not equal to itself
            assert_eq!(again, Some(state.to_cdr()));
        }
    }
});

//! Packages of the real-time data exchange (RTDE, protocol version 2) of Universal Robots: big-endian, a head of size and
//! type, then the fields of the recipe.

/// Types of packages.
pub mod kind {
    /// Ask for a protocol version.
    pub const VERSION: u8 = b'V';
    /// Ask for output fields.
    pub const OUTPUTS: u8 = b'O';
    /// Begin.
    pub const START: u8 = b'S';
    /// Data.
    pub const DATA: u8 = b'U';
    /// A text message of the controller.
    pub const TEXT: u8 = b'M';
}

/// The fields that are asked for.
pub const FIELDS: &str = "timestamp,actual_q,output_int_register_24,safety_mode";
/// Their types, as the controller confirms them.
pub const TYPES: &str = "DOUBLE,VECTOR6D,INT32,INT32";

/// Longest package that is taken.
pub const LONGEST: usize = 4096;

/// One package of data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// The controller's clock, s.
    pub t: f64,
    /// Joints, rad.
    pub q: [f64; 6],
    /// Number of the last program that has come to its end.
    pub done: i32,
    /// 1 normal, 2 reduced; all others stand.
    pub safety: i32,
}

/// A package with its head.
#[must_use]
pub fn package(kind: u8, content: &[u8]) -> Vec<u8> {
    let size = u16::try_from(content.len() + 3).unwrap_or(u16::MAX);
    let mut bytes = size.to_be_bytes().to_vec();
    bytes.push(kind);
    bytes.extend_from_slice(content);
    bytes
}

/// Asks for the fields, so many times a second.
#[must_use]
pub fn outputs_request(frequency: f64) -> Vec<u8> {
    let mut content = frequency.to_be_bytes().to_vec();
    content.extend_from_slice(FIELDS.as_bytes());
    package(kind::OUTPUTS, &content)
}

/// Takes the first whole package off the front: type and content. `None` = more bytes are needed.
///
/// # Errors
/// A size that no package has.
pub fn take(bytes: &mut Vec<u8>) -> Result<Option<(u8, Vec<u8>)>, String> {
    let Some(head) = bytes.get(..3) else { return Ok(None) };
    let size = usize::from(u16::from_be_bytes([head[0], head[1]]));
    if !(3..=LONGEST).contains(&size) {
        return Err(format!("a package of {size} bytes; expected 3 to {LONGEST}"));
    }
    if bytes.len() < size {
        return Ok(None);
    }
    let whole: Vec<u8> = bytes.drain(..size).collect();
    let kind = whole.get(2).copied().unwrap_or(0);
    Ok(Some((kind, whole.get(3..).unwrap_or_default().to_vec())))
}

/// The data of a package of this recipe; `None` where it has another, or numbers that are none.
#[must_use]
pub fn parse_state(content: &[u8], recipe: u8) -> Option<State> {
    let (first, mut rest) = content.split_first()?;
    if *first != recipe || rest.len() != 8 + 48 + 4 + 4 {
        return None;
    }
    let mut double = || {
        let (bytes, after) = rest.split_at_checked(8)?;
        rest = after;
        Some(f64::from_be_bytes(bytes.try_into().ok()?))
    };
    let t = double()?;
    let mut q = [0.0; 6];
    for q in &mut q {
        *q = double()?;
    }
    let done = i32::from_be_bytes(rest.get(..4)?.try_into().ok()?);
    let safety = i32::from_be_bytes(rest.get(4..8)?.try_into().ok()?);
    (t.is_finite() && q.iter().all(|q| q.is_finite())).then_some(State { t, q, done, safety })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_packages_of_the_guide() {
        assert_eq!(package(kind::VERSION, &[0, 2]), [0, 5, b'V', 0, 2]);
        assert_eq!(package(kind::START, &[]), [0, 3, b'S']);
        let outputs = outputs_request(125.0);
        assert_eq!(&outputs[3..11], &125.0_f64.to_be_bytes());
        assert_eq!(usize::from(outputs[1]), outputs.len());
        let mut bytes = [package(kind::TEXT, b"hi"), vec![0, 4, b'S']].concat();
        assert_eq!(take(&mut bytes).unwrap(), Some((kind::TEXT, b"hi".to_vec())));
        assert_eq!(take(&mut bytes).unwrap(), None);
        assert!(take(&mut b"HTTP/1.1 400".to_vec()).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_refused_or_taken_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..100)) {
            let _ = take(&mut bytes.clone());
            if let Some(state) = parse_state(&bytes, 1) {
                prop_assert!(state.q.iter().all(|q| q.is_finite()));
            }
        }
    }
}

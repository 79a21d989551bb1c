//! The RAPID dialect: what goes over the socket between this program and `rapid/TriCal.mod`, both ways.
//!
//! Framing and codes 00 to 09 and 99 are those that users know from open_abb: request `"<code> <p1> <p2> ... #"`, reply
//! `"<code> <ok> <data>#"`. Codes from 20 on are ours. Lengths are mm, angles deg, joints have five decimals; `ok` is 1,
//! or 0 with the reason as data.
//!
//! | code | request | reply |
//! |---|---|---|
//! | 00 | ping | |
//! | 02 | MoveAbsJ `j1 .. j6` | when the arm stands still |
//! | 04 | joints | `j1 .. j6` |
//! | 06 | tool `x y z q0 qx qy qz` | |
//! | 08 | speed of the TCP in mm/s, of rotation in deg/s | |
//! | 09 | zone; only `fine` (1) is taken | |
//! | 20 | correction `dx dy dz` in the tool's axes | when the arm stands still |
//! | 21 | clock | `seconds` |
//! | 22 | stream joints while moving, every so many ms; 0 = off | |
//! | 23 | temperature | `degC`, or nothing where there is no sensor |
//! | 24 | who are you | `TriCal <version> <number of joints> <correction limit mm>` |
//! | 25 | stop the motion under way; taken while it is | after the motion's own reply, which is refused |
//! | 26 | alive? taken while the arm moves; a module that hears nothing for some seconds then stops it | |
//! | 27 | `SECRET`: the first message, where the module has one; a word, not a number | |
//! | 28 | serial number | what the controller says |
//! | 30 | (never requested) | `seconds j1 .. j6`: a sample of the stream |
//! | 99 | close | |

use trical_model::recording::{Joints, MAX_JOINTS};

/// Version of the dialect.
pub const VERSION: u32 = 1;

/// Codes of the dialect.
pub mod code {
    /// Sign of life.
    pub const PING: u8 = 0;
    /// Move all joints.
    pub const MOVE_JOINTS: u8 = 2;
    /// Report the joints.
    pub const JOINTS: u8 = 4;
    /// Set the tool.
    pub const TOOL: u8 = 6;
    /// Set the speed.
    pub const SPEED: u8 = 8;
    /// Set the zone.
    pub const ZONE: u8 = 9;
    /// Displace the TCP in the tool's axes.
    pub const CORRECT: u8 = 20;
    /// Report the clock.
    pub const CLOCK: u8 = 21;
    /// Stream joints while moving.
    pub const STREAM: u8 = 22;
    /// Report the temperature.
    pub const TEMPERATURE: u8 = 23;
    /// Report name, version, joints and limit.
    pub const IDENTIFY: u8 = 24;
    /// Stop the motion under way.
    pub const STOP: u8 = 25;
    /// Say that both ends are alive, while the arm moves.
    pub const ALIVE: u8 = 26;
    /// Give the secret.
    pub const LOGIN: u8 = 27;
    /// Report the serial number.
    pub const SERIAL_NUMBER: u8 = 28;
    /// A sample of the stream.
    pub const SAMPLE: u8 = 30;
    /// Close the connection.
    pub const CLOSE: u8 = 99;
}

/// Longest message that is taken; more without `#` is garbage.
pub const LONGEST: usize = 1024;

/// A request, with its parameters as they stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// What is asked.
    pub code: u8,
    /// Parameters.
    pub parameters: Vec<f64>,
}

/// A reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The code of the request.
    pub code: u8,
    /// Whether it was done.
    pub ok: bool,
    /// What follows.
    pub data: String,
}

/// Writes a request; `decimals` of its parameters.
#[must_use]
pub fn write_request(code: u8, parameters: &[f64], decimals: usize) -> String {
    let mut text = format!("{code:02} ");
    for value in parameters {
        text.push_str(&number(*value, decimals));
        text.push(' ');
    }
    text.push('#');
    text
}

/// Writes a reply.
#[must_use]
pub fn write_reply(code: u8, ok: bool, data: &str) -> String {
    format!("{code:02} {} {data}#", u8::from(ok))
}

/// Takes a request apart, without its `#`.
#[must_use]
pub fn parse_request(message: &[u8]) -> Option<Request> {
    let mut words = std::str::from_utf8(message).ok()?.split_ascii_whitespace();
    let code = words.next()?.parse().ok()?;
    let parameters = words.map(parse_number).collect::<Option<Vec<f64>>>()?;
    Some(Request { code, parameters })
}

/// Fewest and most letters of a secret: a RAPID string holds 80.
pub const SECRET_LETTERS: std::ops::RangeInclusive<usize> = 8..=40;

/// The word that stands for no secret at all, in the module and in a URL.
pub const NO_SECRET: &str = "none";

/// What is said to who commands before it has given the secret.
pub const SECRET_EXPECTED: &str = "secret expected";

/// What is said to who gives a wrong one.
pub const SECRET_WRONG: &str = "wrong secret";

/// What is said to who gives a secret where none is set.
pub const SECRET_NOT_SET: &str = "no secret is set here";

/// Whether a text can be a secret: letters and digits only, neither too few nor too many.
#[must_use]
pub fn is_secret(text: &str) -> bool {
    SECRET_LETTERS.contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

/// Writes the message that gives the secret.
#[must_use]
pub fn write_login(secret: &str) -> String {
    format!("{:02} {secret} #", code::LOGIN)
}

/// The secret that a message gives, without its `#`; `None` where it is another message.
#[must_use]
pub fn parse_login(message: &[u8]) -> Option<&str> {
    std::str::from_utf8(message).ok()?.trim().strip_prefix("27 ").map(str::trim)
}

/// Takes a reply apart, without its `#`.
#[must_use]
pub fn parse_reply(message: &[u8]) -> Option<Reply> {
    let text = std::str::from_utf8(message).ok()?.trim();
    let (code, rest) = text.split_once(' ').unwrap_or((text, ""));
    let (ok, data) = rest.split_once(' ').unwrap_or((rest, ""));
    let code = code.parse().ok()?;
    let ok = match ok {
        "1" => true,
        "0" => false,
        _ => return None,
    };
    Some(Reply { code, ok, data: data.trim().to_owned() })
}

/// SI units of one that a controller of ABB speaks of: mm of a joint that slides, else deg.
pub(crate) fn wire_unit(slides: &[bool], joint: usize) -> f64 {
    if slides.get(joint) == Some(&true) { 1e-3 } else { 1_f64.to_radians() }
}

/// Joint values (SI) as parameters, of the first `count` joints: degrees, and mm of those that slide.
#[must_use]
pub fn joint_parameters(q: &Joints, count: usize, slides: &[bool]) -> Vec<f64> {
    q.iter().take(count).enumerate().map(|(k, q)| q / wire_unit(slides, k)).collect()
}

/// Joint values (SI) as text: degrees with five decimals, and mm of those that slide.
#[must_use]
pub fn write_joints(q: &Joints, count: usize, slides: &[bool]) -> String {
    joint_parameters(q, count, slides).into_iter().map(|q| number(q, 5)).collect::<Vec<_>>().join(" ")
}

/// Reads degrees, and mm of joints that slide, as joint values; there must be `count` of them.
#[must_use]
pub fn parse_joints(values: &[f64], count: usize, slides: &[bool]) -> Option<Joints> {
    if values.len() != count || count > MAX_JOINTS {
        return None;
    }
    let mut q = [0.0; MAX_JOINTS];
    for (k, (q, value)) in q.iter_mut().zip(values).enumerate() {
        *q = value * wire_unit(slides, k);
    }
    Some(q)
}

/// Reads finite numbers, separated by blanks.
#[must_use]
pub fn parse_numbers(text: &str) -> Option<Vec<f64>> {
    text.split_ascii_whitespace().map(parse_number).collect()
}

fn parse_number(word: &str) -> Option<f64> {
    word.parse::<f64>().ok().filter(|value| value.is_finite())
}

fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    // -0.00000 is confusing in a protocol log
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|byte| matches!(byte, b'0' | b'.')) => rest.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_framing_of_open_abb() {
        assert_eq!(write_request(code::PING, &[], 5), "00 #");
        assert_eq!(write_request(code::CORRECT, &[0.25, -1.0, 0.0], 4), "20 0.2500 -1.0000 0.0000 #");
        assert_eq!(write_reply(code::PING, true, ""), "00 1 #");
        assert_eq!(parse_reply(b"04 1 1.0 2.0").unwrap(), Reply { code: 4, ok: true, data: "1.0 2.0".to_owned() });
        assert_eq!(parse_reply(b"20 0 correction over limit").unwrap().data, "correction over limit");
    }

    #[test]
    fn six_joints_fit_a_rapid_string_of_80_characters() {
        let q = [(-359.999_99_f64).to_radians(); MAX_JOINTS];
        assert!(write_request(code::MOVE_JOINTS, &joint_parameters(&q, 6, &[]), 5).len() <= 80);
        assert!(write_reply(code::JOINTS, true, &write_joints(&q, 6, &[])).len() <= 80);
    }

    #[test]
    fn a_secret_fits_a_rapid_string_and_is_no_request() {
        let longest = "s".repeat(*SECRET_LETTERS.end());
        let message = write_login(&longest);
        assert!(message.len() <= 80);
        let message = message.trim_end_matches('#').as_bytes();
        assert_eq!(parse_login(message), Some(longest.as_str()));
        assert_eq!(parse_request(message), None);
        assert_eq!(parse_login(b"24 "), None);
        for bad in ["none", "short", "with blank", "with#hash", "gr\u{fc}\u{df}e_1234", &"s".repeat(41)] {
            assert!(!is_secret(bad), "{bad}");
        }
        assert!(is_secret("Torx25kanne"));
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for bad in ["20 nan 0 0", "20 inf", "20 1,0", "x 1", ""] {
            assert_eq!(parse_request(bad.as_bytes()), None, "{bad}");
        }
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..120)) {
            let _ = parse_request(&bytes);
            let _ = parse_reply(&bytes);
        }

        #[test]
        fn joints_come_back_to_five_decimals(degrees in proptest::collection::vec(-400.0_f64..400.0, 6)) {
            let q = parse_joints(&degrees, 6, &[]).unwrap();
            let back = parse_joints(&parse_numbers(&write_joints(&q, 6, &[])).unwrap(), 6, &[]).unwrap();
            for (a, b) in q.iter().zip(&back) {
                prop_assert!((a - b).to_degrees().abs() < 5.1e-6);
            }
        }
    }
}

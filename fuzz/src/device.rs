//! What gauges, controllers and recordings say.

use trical_device::controller::{rapid_protocol, rtde as exchange, rws_protocol};
use trical_device::gauge::line_protocol::{LineReply, Pattern, parse_line};
use trical_device::gauge::uwave_protocol::{Record, parse_record, parse_request};
use trical_device::url::DeviceUrl;
use trical_recording::json::{RowRead, row_from_json, row_to_json};
use trical_recording::mcap::cdr::JointState;
use trical_recording::mcap::read_bytes;
use trical_recording::{Places, Shared};

/// The form of a data record, as the manual has it: `^DT1(\d\d)(\d\d)([+-][0-9.]{11})([MI0])$`.
fn is_data_record(line: &[u8]) -> bool {
    line.len() == 20
        && line.starts_with(b"DT1")
        && line[3..7].iter().all(u8::is_ascii_digit)
        && b"+-".contains(&line[7])
        && line[8..19].iter().all(|b| b.is_ascii_digit() || *b == b'.')
        && b"MI0".contains(&line[19])
}

/// A line from or to the U-WAVE-R: a value only where the manual has one, and that value. Says whether it was a value.
pub fn uwave(line: &[u8]) -> bool {
    let _ = parse_request(line);
    let Some(Record::Data { group, channel, value, .. }) = parse_record(line) else { return false };
    assert!(is_data_record(line), "{}", line.escape_ascii());
    let text = std::str::from_utf8(line).unwrap();
    assert_eq!((group, channel), (text[3..5].parse().unwrap(), text[5..7].parse().unwrap()));
    let magnitude: f64 = text[8..19].parse().unwrap();
    assert_eq!(value.abs(), magnitude);
    assert!(value == 0.0 || value.is_sign_negative() == text[7..].starts_with('-'));
    true
}

/// A line of another gauge, as an answer of this form: as many finite values as the form has, and none in an error.
pub fn line_in(line: &[u8], pattern: &Pattern) -> bool {
    let LineReply::Values(found) = parse_line(line, pattern) else { return false };
    assert_eq!(found.len(), pattern.values());
    let upper = String::from_utf8_lossy(line).trim().to_ascii_uppercase();
    assert!(!upper.starts_with("ERR") && !upper.starts_with("OV") && !upper.starts_with('#'), "{upper}");
    let is_91x = upper.len() == 3 && upper.starts_with("91") && upper.bytes().all(|b| b.is_ascii_digit());
    assert!(!is_91x, "{upper}");
    assert!(found.iter().all(|(value, _)| value.is_finite()));
    true
}

/// A form (`{v};{v};{v}`) on the first line, an answer on the rest.
pub fn line(data: &[u8]) -> bool {
    let mut parts = data.splitn(2, |b| *b == b'\n');
    let pattern = parts.next().and_then(|p| Pattern::parse(std::str::from_utf8(p).ok()?));
    let Some((pattern, line)) = pattern.zip(parts.next()) else { return false };
    line_in(line, &pattern)
}

/// A message of the RAPID module or to it.
pub fn rapid(message: &[u8]) -> bool {
    let request = rapid_protocol::parse_request(message);
    assert!(request.iter().all(|r| r.parameters.iter().all(|value| value.is_finite())));
    let reply = rapid_protocol::parse_reply(message);
    if let Some(numbers) = reply.as_ref().and_then(|reply| rapid_protocol::parse_numbers(&reply.data)) {
        assert!(numbers.iter().all(|value| value.is_finite()));
        if let Some(q) = rapid_protocol::parse_joints(&numbers, 6, &[]) {
            assert!(numbers.len() == 6 && q[6..] == [0.0; 3]);
        }
    }
    request.is_some() || reply.is_some()
}

/// An answer of Robot Web Services: joints, or the value of a variable.
pub fn rws(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let joints = rws_protocol::parse_joints(text, &[]);
    assert!(joints.iter().all(|(q, count)| (1..=6).contains(count) && q.iter().all(|q| q.is_finite())));
    let value = rws_protocol::parse_value(text);
    assert!(value.iter().all(|v| rws_protocol::unquoted(v).len() <= v.len()));
    joints.is_some() || value.is_some()
}

/// Packages of Universal Robots' data exchange: whether there was a state of the arm among them.
pub fn rtde(data: &[u8]) -> bool {
    let mut bytes = data.to_vec();
    let mut taken = false;
    while let Ok(Some((_, content))) = exchange::take(&mut bytes) {
        if let Some(state) = exchange::parse_state(&content, 1) {
            assert!(state.t.is_finite() && state.q.iter().all(|q| q.is_finite()));
            taken = true;
        }
    }
    taken
}

/// The address of a device with its options.
pub fn url(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let Ok(mut url) = DeviceUrl::parse(text) else { return false };
    assert!(url.take_number("timeout_s", 1.0, 0.0..=1.0).is_ok_and(|x| (0.0..=1.0).contains(&x)) || text.contains('='));
    let _ = url.finish("timeout_s");
    true
}

/// `sensor_msgs/msg/JointState` in CDR, with its header or without: what is taken comes back as it was.
pub fn joint_state(data: &[u8]) -> bool {
    let headed = [&[0, 1, 0, 0], data].concat();
    let mut taken = false;
    for bytes in [data, &headed] {
        if let Some(state) = JointState::from_cdr(bytes) {
            let again = JointState::from_cdr(&state.to_cdr()).map(|state| state.to_cdr());
            // compared as bytes: NaN is not equal to itself
            assert_eq!(again, Some(state.to_cdr()));
            taken = true;
        }
    }
    taken
}

/// A measurement as JSON: what is taken is finite, and says the same when it is written again.
pub fn row(data: &[u8]) -> bool {
    let mut places = Places::default();
    let Ok(RowRead { row, joints, prismatic }) = row_from_json(data, &mut places) else { return false };
    let shared = Shared { joints, prismatic, places: places.into_names() };
    let text = row_to_json(&row, &shared);
    assert!((1..=9).contains(&joints) && row.state.q.iter().all(|q| q.is_finite()), "{text}");
    let mut places = Places::default();
    let again = row_from_json(text.as_bytes(), &mut places).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let same = Shared { joints: again.joints, prismatic: again.prismatic, places: places.into_names() };
    let again = again.row;
    assert_eq!((same, again.seq, again.state.dir), (shared, row.seq, row.state.dir), "{text}");
    assert_eq!(again.state.place, row.state.place, "{text}");
    assert_eq!(std::mem::discriminant(&again.measured), std::mem::discriminant(&row.measured), "{text}");
    true
}

/// An MCAP recording, whole, cut or damaged.
pub fn mcap(data: &[u8]) -> bool {
    let check = |bytes: &[u8]| {
        let Ok(read) = read_bytes("fuzz.mcap".as_ref(), bytes) else { return false };
        assert!(read.recording.rows.iter().all(|r| r.state.q.iter().all(|q| q.is_finite())));
        true
    };
    // most inputs lack the magic
    let headed = [&[0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'], data].concat();
    check(&headed);
    check(data)
}

//! What ABB Robot Web Services 1.0 says and is told: paths, JSON answers, RAPID values as text.

use serde_json::Value;
use trical_model::recording::{Joints, MAX_JOINTS};

use super::rapid_protocol::wire_unit;

/// Path of the joints of a mechanical unit.
#[must_use]
pub fn joints_path(unit: &str) -> String {
    format!("/rw/motionsystem/mechunits/{unit}/jointtarget?json=1")
}

/// Path of a RAPID variable.
#[must_use]
pub fn variable_path(task: &str, module: &str, name: &str) -> String {
    format!("/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}")
}

/// First state of an answer.
fn state(body: &str) -> Option<Value> {
    let value: Value = serde_json::from_str(body).ok()?;
    value.get("_embedded")?.get("_state")?.get(0).cloned()
}

/// Joints in an answer: `rax_1` to `rax_6` in degrees, as text or numbers; rad, and how many there are.
#[must_use]
pub fn parse_joints(body: &str, slides: &[bool]) -> Option<(Joints, usize)> {
    let state = state(body)?;
    let mut q = [0.0; MAX_JOINTS];
    let mut count = 0;
    for (k, q) in q.iter_mut().take(6).enumerate() {
        let Some(value) = state.get(format!("rax_{}", k + 1)) else { break };
        let degrees = match value {
            Value::String(text) => text.trim().parse().ok()?,
            other => other.as_f64()?,
        };
        // 9E9 stands for an axis that is not there
        if !f64::is_finite(degrees) || degrees.abs() >= 1e6 {
            break;
        }
        *q = degrees * wire_unit(slides, k);
        count += 1;
    }
    (count > 0).then_some((q, count))
}

/// The value of a RAPID variable in an answer, as it stands.
#[must_use]
pub fn parse_value(body: &str) -> Option<String> {
    match state(body)?.get("value")? {
        Value::String(text) => Some(text.clone()),
        other => Some(other.to_string()),
    }
}

/// A RAPID string without its quotes.
#[must_use]
pub fn unquoted(text: &str) -> &str {
    let text = text.trim();
    text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text)
}

/// A request as the array that the RAPID loop reads: its number, the code, seven numbers, and its number again.
#[must_use]
pub fn request_value(number: u64, code: u8, parameters: &[f64]) -> String {
    let mut words = vec![number.to_string(), code.to_string()];
    // RAPID numbers are single precision: five decimals are all there is
    words.extend((0..7).map(|k| format!("{:.5}", parameters.get(k).copied().unwrap_or(0.0))));
    words.push(number.to_string());
    format!("[{}]", words.join(","))
}

/// A whole number of the module.
#[must_use]
pub fn parse_number(text: &str) -> Option<u64> {
    let number = text.trim().parse::<f64>().ok().filter(|v| v.fract() == 0.0 && (0.0..1e7).contains(v));
    number.map(|v| v as u64)
}

/// Number of the request that stands in the array.
#[must_use]
pub fn request_number(value: &str) -> Option<u64> {
    let words: Vec<&str> = value.trim().strip_prefix('[')?.strip_suffix(']')?.split(',').collect();
    parse_number(words.first().filter(|_| words.len() == 10)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    const JOINTS: &str = r#"{"_links":{"base":{"href":"http://127.0.0.1/rw/motionsystem/"}},"_embedded":{"_state":[
        {"_type":"ms-jointtarget","_title":"ROB_1","rax_1":"1.50000","rax_2":"-2","rax_3":"0","rax_4":"-0.00001",
         "rax_5":"45","rax_6":"180.25","eax_a":"8.999999E+09","eax_b":"8.999999E+09"}]}}"#;

    #[test]
    fn the_answers_of_the_services() {
        let (q, count) = parse_joints(JOINTS, &[]).unwrap();
        assert_eq!(count, 6);
        assert!((q[0].to_degrees() - 1.5).abs() < 1e-12 && (q[5].to_degrees() - 180.25).abs() < 1e-12);
        let body = r#"{"_embedded":{"_state":[{"_type":"rap-data","value":"\"joint 3 out of limits\""}]}}"#;
        assert_eq!(unquoted(&parse_value(body).unwrap()), "joint 3 out of limits");
        for bad in ["", "{}", "[]", r#"{"_embedded":{"_state":[]}}"#, r#"{"_embedded":{"_state":[{"rax_1":"x"}]}}"#] {
            assert!(parse_joints(bad, &[]).is_none(), "{bad}");
        }
    }

    #[test]
    fn requests_as_rapid_reads_them() {
        assert_eq!(
            request_value(46, 20, &[0.25, -1.0, 0.0]),
            "[46,20,0.25000,-1.00000,0.00000,0.00000,0.00000,0.00000,0.00000,46]"
        );
        assert_eq!(request_number("[46,20,0.25,-1,0,0,0,0,0,46]"), Some(46));
        assert_eq!(request_number("[20,0.25,-1,0,0,0,0,0]"), None, "that of an earlier version");
        assert_eq!(joints_path("ROB_1"), "/rw/motionsystem/mechunits/ROB_1/jointtarget?json=1");
        assert_eq!(variable_path("T_ROB1", "TriCalRws", "nAck"), "/rw/rapid/symbol/data/RAPID/T_ROB1/TriCalRws/nAck");
    }

    proptest! {
        #[test]
        fn any_answer_is_refused_or_taken_without_a_panic(text in ".{0,200}", value in "[0-9eE+.\\-\"]{0,12}") {
            let _ = parse_joints(&text, &[]);
            let _ = parse_value(&text);
            let _ = request_number(&text);
            let body = format!("{{\"_embedded\":{{\"_state\":[{{\"rax_1\":\"{}\"}}]}}}}", value.replace('"', ""));
            if let Some((q, _)) = parse_joints(&body, &[]) {
                prop_assert!(q.iter().all(|q| q.is_finite()));
            }
        }
    }
}

//! Topics and schemas of a recording.

/// Joints while the arm moves: CDR `sensor_msgs/msg/JointState`.
pub const JOINT_STATES: &str = "/joint_states";
/// The robot as URDF, once: CDR `std_msgs/msg/String`.
pub const ROBOT_DESCRIPTION: &str = "/robot_description";
/// Every reading of the gauge: JSON.
pub const INDICATORS: &str = "/indicators";
/// Temperature: JSON.
pub const TEMPERATURE: &str = "/temperature";
/// Accepted measurements, with the fields of a CSV row: JSON.
pub const MEASUREMENT: &str = "/measurement";

/// Name of the JointState schema.
pub const JOINT_STATE_NAME: &str = "sensor_msgs/msg/JointState";
/// Name of the String schema.
pub const STRING_NAME: &str = "std_msgs/msg/String";
/// Text of the String schema.
pub const STRING_TEXT: &str = "string data\n";

/// Text of the JointState schema: the message, then each dependency after a line of 80 `=`.
pub const JOINT_STATE_TEXT: &str = "\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort

================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id

================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// Name and text of the schema of `/indicators`.
#[must_use]
pub fn indicators() -> (&'static str, String) {
    let fields = ["t_s", "ix_mm", "iy_mm", "iz_mm"].map(|name| (name.to_owned(), "number"));
    let mut fields = fields.to_vec();
    fields.push(("settled".to_owned(), "boolean"));
    ("trical.Indicators", json_schema("trical.Indicators", &fields, &["t_s", "ix_mm", "iy_mm", "iz_mm"]))
}

/// Name and text of the schema of `/temperature`.
#[must_use]
pub fn temperature() -> (&'static str, String) {
    let fields = ["t_s", "temp_c"].map(|name| (name.to_owned(), "number"));
    ("trical.Temperature", json_schema("trical.Temperature", &fields, &["t_s", "temp_c"]))
}

/// Name and text of the schema of `/measurement` for an arm with so many joints.
#[must_use]
pub fn measurement(joints: usize) -> (&'static str, String) {
    let mut fields = vec![("t_s".to_owned(), "number")];
    for (stem, tail, kind) in [("q", "_deg", "number"), ("qc", "_deg", "number"), ("dir", "", "integer")] {
        fields.extend((1..=joints).map(|joint| (format!("{stem}{joint}{tail}"), kind)));
    }
    for name in ["seq", "ball", "target", "reference", "anchor"] {
        fields.push((name.to_owned(), "integer"));
    }
    for name in
        ["temp_c", "payload_kg", "ix_mm", "iy_mm", "iz_mm", "x_mm", "y_mm", "z_mm", "d_mm", "qw", "qx", "qy", "qz"]
    {
        fields.push((name.to_owned(), "number"));
    }
    let required: Vec<String> = (1..=joints).map(|joint| format!("q{joint}_deg")).collect();
    let required: Vec<&str> = required.iter().map(String::as_str).collect();
    ("trical.Measurement", json_schema("trical.Measurement", &fields, &required))
}

fn json_schema(title: &str, fields: &[(String, &str)], required: &[&str]) -> String {
    let properties: Vec<String> =
        fields.iter().map(|(name, kind)| format!("\"{name}\":{{\"type\":\"{kind}\"}}")).collect();
    let required: Vec<String> = required.iter().map(|name| format!("\"{name}\"")).collect();
    format!(
        "{{\"title\":\"{title}\",\"type\":\"object\",\"properties\":{{{}}},\"required\":[{}]}}",
        properties.join(","),
        required.join(",")
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn schemas_are_json_and_named_by_their_title() {
        for (name, text) in [indicators(), temperature(), measurement(6)] {
            let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(schema["title"], name);
            for key in schema["required"].as_array().unwrap() {
                assert!(schema["properties"].get(key.as_str().unwrap()).is_some());
            }
        }
        assert!(JOINT_STATE_TEXT.contains(&format!("\n{}\nMSG: std_msgs/Header\n", "=".repeat(80))));
    }
}

//! Topics and schemas of a recording.

use crate::columns::{COLUMNS, Field, column};
use crate::shared::Shared;

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

/// The columns of a field as properties of a schema, for an arm of which these joints slide.
fn properties(field: Field, shared: &Shared) -> Vec<(String, &'static str)> {
    let column = column(field);
    let one = |k: usize| {
        let unit = column.unit(k, &shared.prismatic);
        (column.name(k, unit), unit.json_type())
    };
    (0..column.width(shared.joints)).map(one).collect()
}

/// Name and text of the schema of `/indicators`.
#[must_use]
pub fn indicators() -> (&'static str, String) {
    let none = Shared::default();
    let mut fields = [properties(Field::Time, &none), properties(Field::Indicators, &none)].concat();
    let required: Vec<String> = fields.iter().map(|(name, _)| name.clone()).collect();
    fields.push(("settled".to_owned(), "boolean"));
    ("trical.Indicators", json_schema("trical.Indicators", &fields, &required))
}

/// Name and text of the schema of `/temperature`.
#[must_use]
pub fn temperature() -> (&'static str, String) {
    let none = Shared::default();
    let fields = [properties(Field::Time, &none), properties(Field::Temperature, &none)].concat();
    let required: Vec<String> = fields.iter().map(|(name, _)| name.clone()).collect();
    ("trical.Temperature", json_schema("trical.Temperature", &fields, &required))
}

/// Name and text of the schema of `/measurement`.
#[must_use]
pub fn measurement(shared: &Shared) -> (&'static str, String) {
    let written = COLUMNS.iter().filter(|c| c.field.is_written());
    let fields: Vec<_> = written.flat_map(|c| properties(c.field, shared)).collect();
    let of_every_row = COLUMNS.iter().filter(|c| c.required && c.kinds.is_empty());
    let required: Vec<String> = of_every_row.flat_map(|c| properties(c.field, shared)).map(|(name, _)| name).collect();
    ("trical.Measurement", json_schema("trical.Measurement", &fields, &required))
}

fn json_schema(title: &str, fields: &[(String, &str)], required: &[String]) -> String {
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
        for (name, text) in [indicators(), temperature(), measurement(&Shared::for_joints(6))] {
            let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(schema["title"], name);
            for key in schema["required"].as_array().unwrap() {
                assert!(schema["properties"].get(key.as_str().unwrap()).is_some());
            }
        }
        assert!(JOINT_STATE_TEXT.contains(&format!("\n{}\nMSG: std_msgs/Header\n", "=".repeat(80))));
    }

    #[test]
    fn a_schema_has_the_columns_of_an_arm_with_their_types() {
        let mut shared = Shared::for_joints(2);
        shared.prismatic[1] = true;
        let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        let schema = read(&measurement(&shared).1);
        let of = |key: &str| schema["properties"][key]["type"].as_str();
        assert_eq!([of("q1_deg"), of("q2_mm"), of("t_s"), of("x_mm")], [Some("number"); 4]);
        assert_eq!([of("q2_deg"), of("q3_deg")], [None; 2]);
        assert!(schema["required"].as_array().unwrap().iter().any(|key| key == "q1_deg"), "{schema}");
        let needs = |text: &str| read(text)["required"].to_string();
        assert_eq!(needs(&indicators().1), r#"["t_s","ix_mm","iy_mm","iz_mm"]"#);
        assert_eq!(needs(&temperature().1), r#"["t_s","temp_c"]"#);
    }
}

//! Recordings written as CSV, at once or row by row.

use std::io::Write;

use trical_model::{Measured, Recording, Row};

/// Writes a recording as CSV, with the columns that it has anything for.
///
/// # Errors
/// The operating system's.
pub fn write_csv(recording: &Recording, out: &mut dyn Write) -> std::io::Result<()> {
    let mut layout = Layout::new();
    recording.rows.iter().for_each(|r| layout.see(r));
    layout.write_header(recording.joints, out)?;
    recording.rows.iter().try_for_each(|r| layout.write_row(recording.joints, r, out))
}

/// Which columns a CSV needs: those that any of its rows has something for.
#[derive(Clone, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "a list of yes and no")]
pub struct Layout {
    commanded: bool,
    dir: bool,
    time: bool,
    temp: bool,
    payload: bool,
    seq: bool,
    touch: bool,
    pose: bool,
    reference: bool,
    target: bool,
    xyz: bool,
    distance: bool,
}

impl Layout {
    /// Joints only.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes room for what `row` has.
    pub fn see(&mut self, row: &Row) {
        let s = &row.state;
        self.commanded |= s.q_commanded.is_some();
        self.dir |= s.dir.is_some();
        self.time |= s.t.is_some();
        self.temp |= s.temp_c.is_some();
        self.payload |= s.payload_kg.is_some();
        self.seq |= row.seq.is_some();
        match row.measured {
            Measured::Touch { .. } => self.touch = true,
            Measured::Point { target, .. } => {
                self.xyz = true;
                self.target |= target > 0;
            }
            Measured::Reference { .. } => (self.xyz, self.reference, self.target) = (true, true, true),
            Measured::Pose { .. } => (self.xyz, self.pose) = (true, true),
            Measured::Distance { .. } => self.distance = true,
        }
    }

    /// The first line.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write_header(&self, joints: usize, out: &mut dyn Write) -> std::io::Result<()> {
        let mut header: Vec<String> = Vec::new();
        let joint =
            |prefix: &str, suffix: &str| (1..=joints).map(|k| format!("{prefix}{k}{suffix}")).collect::<Vec<_>>();
        let named = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        for (on, names) in [
            (self.time, named(&["t_s"])),
            (self.seq, named(&["seq"])),
            (true, joint("q", "_deg")),
            (self.commanded, joint("qc", "_deg")),
            (self.dir, joint("dir", "")),
            (self.touch, named(&["ball", "ix_mm", "iy_mm", "iz_mm"])),
            (self.target, named(&["target"])),
            (self.reference, named(&["reference"])),
            (self.xyz, named(&["x_mm", "y_mm", "z_mm"])),
            (self.pose, named(&["qw", "qx", "qy", "qz"])),
            (self.distance, named(&["anchor", "d_mm"])),
            (self.temp, named(&["temp_c"])),
            (self.payload, named(&["payload_kg"])),
        ] {
            if on {
                header.extend(names);
            }
        }
        writeln!(out, "{}", header.join(","))
    }

    /// The line of a row that was seen.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write_row(&self, joints: usize, r: &Row, out: &mut dyn Write) -> std::io::Result<()> {
        let deg = |v: f64| format!("{}", trical_model::robot::tidy(v.to_degrees()));
        let mm = |v: f64| format!("{}", trical_model::robot::tidy(v * 1e3));
        let opt = |v: Option<f64>| v.map_or_else(String::new, |v| format!("{v}"));
        let mut line: Vec<String> = Vec::with_capacity(3 * joints + 12);
        let s = &r.state;
        if self.time {
            line.push(opt(s.t));
        }
        if self.seq {
            line.push(r.seq.map_or_else(String::new, |q| q.to_string()));
        }
        line.extend(s.q[..joints].iter().map(|q| deg(*q)));
        if self.commanded {
            line.extend((0..joints).map(|k| s.q_commanded.map_or_else(String::new, |q| deg(q[k]))));
        }
        if self.dir {
            line.extend((0..joints).map(|k| s.dir.map_or_else(String::new, |d| d[k].to_string())));
        }
        let mut fields: [String; 15] = std::array::from_fn(|_| String::new());
        match r.measured {
            Measured::Touch { ball, reading } => {
                fields[0] = (ball + 1).to_string();
                for k in 0..3 {
                    fields[1 + k] = mm(reading[k]);
                }
            }
            Measured::Point { target, position } => {
                fields[4] = (target + 1).to_string();
                for k in 0..3 {
                    fields[6 + k] = mm(position[k]);
                }
            }
            Measured::Reference { reference, position } => {
                fields[5] = (reference + 1).to_string();
                for k in 0..3 {
                    fields[6 + k] = mm(position[k]);
                }
            }
            Measured::Pose { position, quaternion } => {
                for k in 0..3 {
                    fields[6 + k] = mm(position[k]);
                }
                for k in 0..4 {
                    fields[9 + k] = format!("{}", quaternion[k]);
                }
            }
            Measured::Distance { anchor, length } => {
                fields[13] = (anchor + 1).to_string();
                fields[14] = mm(length);
            }
        }
        let groups = [
            (self.touch, 0..4),
            (self.target, 4..5),
            (self.reference, 5..6),
            (self.xyz, 6..9),
            (self.pose, 9..13),
            (self.distance, 13..15),
        ];
        for (on, range) in groups {
            if on {
                line.extend(fields[range].iter().cloned());
            }
        }
        if self.temp {
            line.push(opt(s.temp_c));
        }
        if self.payload {
            line.push(opt(s.payload_kg));
        }
        writeln!(out, "{}", line.join(","))
    }
}

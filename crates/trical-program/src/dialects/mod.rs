//! The dialects: one table with a row each, and one reader each.

pub mod fanuc;
pub mod krl;
pub mod poses_csv;
pub mod rapid;
pub mod urscript;

use std::path::Path;

use nalgebra::Vector3;
use trical_model::{Cell, Model, Pose, Robot};

use crate::elsewhere::{Elsewhere, Nowhere};
use crate::scan::Scan;

/// What the comment says that keeps a program from being compensated twice.
pub const MARK: &str = "compensated by TriCal";

/// The largest program, all its files together, bytes: in memory it takes about twice that. Places in it are kept in 32 bits.
pub(crate) const LARGEST: usize = 1 << 30;
pub(crate) const TOO_LARGE: &str = "the program has more than 1 GiB, expected at most that; divide it";

/// Languages of programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// ABB RAPID.
    Rapid,
    /// KUKA KRL.
    Krl,
    /// FANUC TP listing.
    Fanuc,
    /// Universal Robots script.
    UrScript,
    /// A table of poses or joint values.
    Csv,
}

/// All that differs from dialect to dialect, but for the grammar itself.
struct Row {
    dialect: Dialect,
    /// On the command line.
    name: &'static str,
    maker: &'static str,
    /// Of its files, in lower case.
    extensions: &'static [&'static str],
    /// What a file is expected to hold.
    expected: &'static str,
    /// Targets, frames and order of a program.
    scan: fn(&[u8], &dyn Elsewhere) -> Result<Scan, String>,
    /// Offset of the line that gets the mark.
    header: fn(&[u8]) -> usize,
    /// What stands before and behind the mark in its line; the model's name is left out where lines are short.
    comment: (&'static str, &'static str),
    names_model: bool,
}

const TABLE: [Row; 5] = [
    Row {
        dialect: Dialect::Rapid,
        name: "rapid",
        maker: "ABB",
        extensions: &["mod", "modx", "sys", "sysx", "prg"],
        expected: "ABB RAPID with robtarget or jointtarget data",
        scan: |bytes, elsewhere| Ok(rapid::scan(bytes, elsewhere)),
        header: rapid::header,
        comment: ("! ", ""),
        names_model: true,
    },
    Row {
        dialect: Dialect::Krl,
        name: "krl",
        maker: "KUKA",
        extensions: &["src", "dat", "sub"],
        expected: "KUKA KRL with E6POS, POS, FRAME, E6AXIS or AXIS data",
        scan: |bytes, elsewhere| Ok(krl::scan(bytes, elsewhere)),
        header: krl::header,
        comment: ("; ", ""),
        names_model: true,
    },
    Row {
        dialect: Dialect::Fanuc,
        name: "fanuc",
        maker: "",
        extensions: &["ls"],
        expected: "a FANUC .ls listing with positions in /POS",
        scan: |bytes, _| Ok(fanuc::scan(bytes)),
        header: fanuc::header,
        // a remark of a TP program holds 32 characters
        comment: ("   :  !", " ;"),
        names_model: false,
    },
    Row {
        dialect: Dialect::UrScript,
        name: "urscript",
        maker: "",
        extensions: &["script", "urscript"],
        expected: "Universal Robots script with p[...] or joints in movej, movel, movep or movec",
        scan: |bytes, _| Ok(urscript::scan(bytes)),
        header: |_| 0,
        comment: ("# ", ""),
        names_model: true,
    },
    Row {
        dialect: Dialect::Csv,
        name: "csv",
        maker: "",
        extensions: &["csv"],
        expected: "rows of x_mm,y_mm,z_mm,qw,qx,qy,qz or q1_deg,... (columns are called as those of recordings)",
        scan: |bytes, _| poses_csv::scan(bytes),
        header: |_| 0,
        comment: ("# ", ""),
        names_model: true,
    },
];

impl Dialect {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Rapid, Self::Krl, Self::Fanuc, Self::UrScript, Self::Csv];

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// What it is, for people.
    #[must_use]
    pub fn in_words(self) -> String {
        let row = self.row();
        let files: Vec<String> = row.extensions.iter().map(|e| format!(".{e}")).collect();
        let maker = if row.maker.is_empty() { String::new() } else { format!("{}: ", row.maker) };
        format!("{} ({maker}{})", row.name, files.join(" "))
    }

    /// All of them in words.
    #[must_use]
    pub fn known() -> String {
        Self::ALL.map(Self::in_words).join(", ")
    }

    /// By name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        TABLE.iter().find(|r| r.name == name).map(|r| r.dialect)
    }

    /// By the file's extension.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        TABLE.iter().find(|r| r.extensions.contains(&extension.as_str())).map(|r| r.dialect)
    }

    /// Targets, frames and order of a program.
    ///
    /// # Errors
    /// In words, where the file is none of this dialect.
    pub fn scan(self, bytes: &[u8]) -> Result<Scan, String> {
        self.scan_with(bytes, &Nowhere)
    }

    /// As [`Self::scan`], of a program that calls routines of other files.
    ///
    /// # Errors
    /// As [`Self::scan`].
    pub fn scan_with(self, bytes: &[u8], elsewhere: &dyn Elsewhere) -> Result<Scan, String> {
        if bytes.len() > LARGEST {
            return Err(TOO_LARGE.into());
        }
        (self.row().scan)(bytes, elsewhere)
    }

    /// What a file of this dialect is expected to hold.
    #[must_use]
    pub fn expected(self) -> &'static str {
        self.row().expected
    }

    /// Where the mark is put (an offset), and the line that has it.
    #[must_use]
    pub fn mark(self, bytes: &[u8], model: &str) -> (usize, String) {
        let row = self.row();
        let end = if bytes.windows(2).take(100_000).any(|w| w == b"\r\n") { "\r\n" } else { "\n" };
        let version = env!("CARGO_PKG_VERSION");
        let (open, close) = row.comment;
        // one line of plain text, whatever the model's file is called
        let model: String = model.chars().map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect();
        let with = if row.names_model { format!(" with {model}") } else { String::new() };
        let bom = if bytes.starts_with(b"\xef\xbb\xbf") && self != Self::Fanuc { 3 } else { 0 };
        ((row.header)(bytes).max(bom), format!("{open}{MARK} {version}{with}{close}{end}"))
    }

    /// The controller's world in the arm's foot, where the dialect's controllers do not put it there: FANUC's lies where axis 2
    /// passes axis 1, of an arm on a rail with that at zero.
    #[must_use]
    pub fn usual_world(self, robot: &Robot) -> Option<Pose> {
        let carried =
            robot.is_on_rail().then(|| Model::nominal(robot.clone(), Cell::bare()).on_rail(0.0).ok()).flatten();
        let robot = carried.as_ref().map_or(robot, |m| &m.robot);
        let first = robot.joints.first().filter(|_| self == Self::Fanuc)?;
        let axis = Pose { translation: Vector3::new(0.0, 0.0, first.d), ..Pose::identity() };
        Some(Pose { translation: robot.root_from_zero.compose(&axis).translation, ..Pose::identity() })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn rows_stand_in_the_order_of_the_dialects() {
        for (row, dialect) in TABLE.iter().zip(Dialect::ALL) {
            assert_eq!(row.dialect, dialect);
            assert_eq!(row.dialect.row().name, row.name);
        }
    }

    #[test]
    fn of_a_path_less_is_kept_than_its_text() {
        let paths = [
            (
                Dialect::Rapid,
                "PROC main()\n",
                "MoveL [[350,K,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v9,z1,tool0;\n",
            ),
            (Dialect::Krl, "DEF main()\n", "LIN {X 350.0,Y K,Z 320.0,A 106.2,B 4.0,C 177.0} C_DIS\n"),
            (
                Dialect::Fanuc,
                "/MN\n/POS\n",
                "P[K]{ GP1: UF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0', X = K.0 mm, Y = 0.0 mm, Z = 320.0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n",
            ),
            (Dialect::UrScript, "", "  movel(p[0.350,0.K,0.320,1.8326,2.4435,0.0],a=1.2,v=0.1)\n"),
            (Dialect::Csv, "x_mm,y_mm,z_mm,qw,qx,qy,qz\n", "350.000,K.000,320.000,0.0436,0.5994,0.7992,0.0000\n"),
        ];
        for (dialect, head, line) in paths {
            let lines: String = (100..999).map(|k| line.replace('K', &k.to_string())).collect();
            let scan = dialect.scan(format!("{head}{lines}").as_bytes()).unwrap();
            assert_eq!((scan.spots.len(), scan.problems.len()), (899, 0), "{dialect:?}: {:?}", scan.problems);
            let kept = scan.bytes_kept();
            assert!(kept < 60 * 899 && kept < lines.len(), "{dialect:?}: {kept} of {} bytes", lines.len());
        }
    }
}

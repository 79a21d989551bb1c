//! Recordings of robot arms: what was measured at which joints, from CSV and MCAP files and back, and in passes where files are
//! larger than memory.
//!
//! ```
//! use trical_recording::{parse_csv, to_csv};
//!
//! let text = "seq,place,q1_deg,q2_deg,ball,ix_mm,iy_mm,iz_mm\n1,left,0,90,1,0.01,-0.02,0\n";
//! let recording = parse_csv(text.as_bytes(), "touches.csv", 2)?;
//! assert_eq!(recording.places, ["left"]);
//! assert_eq!(to_csv(&recording)?, text.as_bytes());
//! # Ok::<(), trical_recording::RecordError>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`columns`] | all columns, once: names, units, meaning |
//! | [`open`](mod@open) | a recording from a file, CSV or MCAP by what is in it |
//! | [`csv`] | CSV, read and written |
//! | [`json`] | a row as a JSON object: the messages of an MCAP recording |
//! | [`mcap`] | MCAP recordings: writer with resume, reader that recovers what is whole |
//! | [`motion`] | joint samples and the sense of each joint's last motion |
//! | [`output`] | what may be written: never over what is read |
//! | [`shared`] | what all rows of a recording share: joints, places |
//! | [`stream`] | large CSV files in passes, and a sample of their rows |
//! | [`visits`] | visits of sockets, taken down one by one |
//! | [`whole`](mod@whole) | files that are written whole or not at all |

mod bounds;
pub mod columns;
pub mod csv;
pub mod error;
mod expected;
pub mod json;
pub mod mcap;
pub mod motion;
pub mod open;
pub mod output;
pub mod shared;
pub mod stream;
pub mod visits;
pub mod whole;

pub use crate::csv::{ROOM_C, load_csv, parse_csv, write_csv};
pub use crate::mcap::{ReadRecording, RecordingWriter, RunLog, read_recording, write_recording};
pub use error::{RecordError, Result};
pub use expected::Expected;
pub use open::{is_mcap, open, open_damaged, parse, refuse_other_units, to_csv};
pub use shared::{Places, Shared};
pub use stream::{CsvStream, open_large};

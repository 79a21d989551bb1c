//! Targets that no motion of the file names.

use crate::frames::Frames;
use crate::options::Options;
use crate::scan::{Scan, Setup};

/// Gives them a setup: targets that no motion of the file names have the only tool and frame that the file's motions use. Where there are several,
/// and the user says none either, nobody knows.
pub fn settle_unnamed(scan: &mut Scan, known: &mut Frames, options: &Options) {
    let asked = options.tool.is_some() || options.frame.is_some();
    let only = match scan.setups.len() {
        0 => return,
        1 => Some(0),
        _ => None,
    };
    let mut unknown = None;
    for k in 0..scan.spots.len() {
        if scan.spots[k].setup.is_some() || asked {
            continue;
        }
        scan.spots[k].setup = only.or_else(|| {
            // a setup that nobody knows says so for each of its targets
            let name = "(unused)".to_owned();
            let setup = unknown.get_or_insert_with(|| Setup { tool: Some(name.clone()), frame: None }).clone();
            let why = "no motion in the file names it, and the file uses several tools or frames; --tool and --frame say which";
            known.tools.insert(name, Err(why.into()));
            Some(scan.setup(setup))
        });
    }
}

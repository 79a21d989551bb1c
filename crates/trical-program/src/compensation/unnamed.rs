//! Targets that no motion of the files names, and those of which nobody knows with which tool the arm goes there.

use crate::frames::Frames;
use crate::options::Options;
use crate::scan::{Scan, Setup};

/// Gives them a setup: targets that no motion of the files names have the only tool and frame that the file's motions
/// use. Where there are several, and the user says none either, nobody knows. Where only the tool is not known, it is the
/// one that the user says.
pub fn settle_unnamed(scan: &mut Scan, known: &mut Frames, options: &Options) {
    for (name, tool) in &mut known.tools {
        if let (Err(why), true) = (tool, Setup::says_no_tool(name)) {
            *why += &format!("; {} says it", options.spelling.with("tool", "NAME"));
        }
    }
    let asked = options.tool.is_some() || options.frame.is_some();
    let unsaid: Vec<bool> = scan.setups.iter().map(Setup::is_unsaid).collect();
    let mut said = (0..).zip(&unsaid).filter(|(_, unsaid)| !**unsaid).map(|(k, _)| k);
    let only = match (said.next(), said.next()) {
        (None, _) if !asked => return,
        (one, None) => one,
        _ => None,
    };
    let mut unknown = None;
    for k in 0..scan.spots.len() {
        let of_nobody = scan.spots[k].setup().filter(|s| unsaid.get(*s as usize) == Some(&true));
        if let (Some(tool), Some(setup), None) = (&options.tool, of_nobody, scan.ambiguous(&scan.spots[k])) {
            let frame = scan.setups.get(setup as usize).and_then(|s| s.frame.clone());
            let setup = scan.setup(Setup { tool: Some(tool.to_lowercase()), frame });
            scan.mean(k, setup);
        }
        if scan.spots[k].setup().is_some() || asked {
            continue;
        }
        let setup = only.unwrap_or_else(|| {
            // a setup that nobody knows says so for each of its targets
            let name = "(unused)".to_owned();
            let setup = unknown.get_or_insert_with(|| Setup { tool: Some(name.clone()), frame: None }).clone();
            let [tool, frame] = ["tool", "frame"].map(|setting| options.spelling.of(setting));
            let why = format!("no motion in the file names it, and the file uses several tools or frames; {tool} and {frame} say which");
            known.tools.insert(name, Err(why));
            scan.setup(setup)
        });
        scan.mean(k, setup);
    }
}

//! `trical effects`: the catalogue.

use trical_diagnose::effects::EFFECTS;
use trical_report::table;

use crate::error::Result;
use crate::{say, say_json, say_lines};

/// Arguments of `trical effects`.
#[derive(clap::Args)]
pub struct Args {
    /// A machine-readable list on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if args.json {
        return say_json(&EFFECTS);
    }
    for e in EFFECTS {
        say(format!("{}: {} (site: {})", e.id, e.title, e.site))?;
        for (what, text) in [("", e.form), ("needs: ", e.needs), ("typical: ", e.typical), ("rivals: ", e.rivals)] {
            if text != "-" {
                say_lines(table::wrapped(&format!("{what}{text}"), 104, "    "))?;
            }
        }
    }
    Ok(())
}

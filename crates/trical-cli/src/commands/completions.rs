//! `trical completions`: what a shell needs to complete commands and options.

use clap::Command;
use clap_complete::{Shell, generate};

use crate::error::{CliError, Result};

/// Arguments of `trical completions`.
#[derive(clap::Args)]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Writes the script of `command` to standard output.
pub fn run(args: &Args, mut command: Command) -> Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut command, "trical", &mut script);
    let text = String::from_utf8(script).map_err(CliError::failed)?;
    crate::say(text.trim_end())
}

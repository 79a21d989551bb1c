//! The `trical` binary.

fn main() -> std::process::ExitCode {
    trical_cli::run(std::env::args_os()).into()
}

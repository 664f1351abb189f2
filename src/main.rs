//! The `skypose` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    skypose::shell::cli::run()
}

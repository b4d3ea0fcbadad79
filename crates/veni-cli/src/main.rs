//! `veni-cli`: train, encode, sample and bake natural illumination.
//!
//! One file per command in [`commands`]; what they share is beside this file. Results go to stdout,
//! everything else to stderr; exit codes are 0 (fine), 1 (ran, negative outcome), 2 (error); a signal ends the process as a
//! signal does.

#![forbid(unsafe_code)]

#[cfg(feature = "learn")]
mod allocator;
mod almanac;
mod args;
mod asked;
mod baking;
mod cli;
mod commands;
mod device;
mod features;
mod interrupt;
mod latent_files;
mod numbers;
mod output;
mod part;
mod picture;
mod piped;
mod printable;
mod private;
mod progress;
mod report;
mod shard;
mod size;
mod skies;
mod source;
mod standard;

use std::process::ExitCode;

use crate::report::{Outcome, Report};

fn main() -> ExitCode {
    let (cli, is_taken) = cli::Cli::typed().unwrap_or_else(|error| report::exit_on_usage(&error));
    interrupt::watch();
    private::sweep();
    let report = Report::new(cli.json, cli.quiet);
    let result = is_taken.and_then(|is_taken| {
        let result = cli.command.run(if is_taken { report.beside_stdout() } else { report });
        // what is there was finished: of several inputs others may have failed, as with a file
        let delivered = piped::deliver(report::to_stdout);
        result.and_then(|outcome| delivered.map(|()| outcome))
    });
    let code = end(result);
    piped::clear();
    code
}

fn end(result: anyhow::Result<Outcome>) -> ExitCode {
    match result {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::Negative) => ExitCode::from(1),
        Err(error) if report::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            report::error(&error);
            ExitCode::from(2)
        }
    }
}

//! `veni-cli completions`: tab completion for a shell.

use anyhow::Result;
use clap::{Args, Command};
use clap_complete::{Shell, generate};
use serde_json::json;

use crate::report::{Outcome, Report, to_stdout};

/// Print tab completions for a shell
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    veni-cli completions bash > ~/.local/share/bash-completion/completions/veni-cli\n  \
    veni-cli completions zsh > \"${fpath[1]}/_veni-cli\"\n  \
    veni-cli completions fish > ~/.config/fish/completions/veni-cli.fish")]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    /// For the command line `cli`.
    pub(crate) fn run(self, mut cli: Command, report: Report) -> Result<Outcome> {
        let mut script = Vec::new();
        generate(self.shell, &mut cli, "veni-cli", &mut script);
        if report.is_json() {
            let script = String::from_utf8_lossy(&script);
            report.result("", &json!({ "shell": self.shell.to_string(), "script": script }))?;
        } else {
            to_stdout(&script)?;
        }
        Ok(Outcome::Fine)
    }
}

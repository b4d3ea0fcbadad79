//! `veni-cli man`: manual pages.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Command};
use clap_mangen::Man as Page;
use serde_json::json;
use veni_light::Error;
use veni_light::output::{Overwrite, write_atomic};

use crate::args::Force;
use crate::output::{refuse_existing, with_remedy};
use crate::report::{Outcome, Report, to_stdout};

/// Print the manual page, or write one per command into a folder
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    veni-cli man | man -l -                        read it\n  \
    veni-cli man ~/.local/share/man/man1           install veni-cli.1, veni-cli-bake.1, …")]
pub(crate) struct Man {
    /// Folder for the pages; created if missing
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,

    #[command(flatten)]
    force: Force,
}

impl Man {
    /// For the command line `cli`.
    pub(crate) fn run(self, cli: Command, report: Report) -> Result<Outcome> {
        let mut cli = cli.disable_help_subcommand(true);
        cli.build();
        let Some(folder) = self.folder else {
            let text = render(cli)?;
            if report.is_json() {
                let page = String::from_utf8_lossy(&text);
                report.result("", &json!({ "page": page }))?;
            } else {
                to_stdout(&text)?;
            }
            return Ok(Outcome::Fine);
        };
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "create", e))?;
        let overwrite = Overwrite::from(self.force);
        let commands: Vec<_> = cli.get_subcommands().cloned().collect();
        let pages = std::iter::once(cli).chain(commands).map(|command| {
            // a built subcommand is displayed as "veni-cli-bake"
            let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
            (folder.join(format!("{name}.1")), command)
        });
        let pages: Vec<_> = pages.collect();
        for (path, _) in &pages {
            refuse_existing(path, overwrite)?;
        }
        let mut files = Vec::new();
        for (path, command) in pages {
            let text = render(command)?;
            write_atomic(&path, overwrite, |out| {
                out.write_all(&text).map_err(|e| Error::io(&path, "write", e))
            })
            .map_err(with_remedy)?;
            files.push(path.display().to_string());
        }
        let human = format!("{} pages in {}", files.len(), folder.display());
        report.result(human, &json!({ "files": files }))?;
        Ok(Outcome::Fine)
    }
}

fn render(command: Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    Page::new(command).render(&mut text)?;
    Ok(text)
}

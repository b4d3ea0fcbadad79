//! The command line as a whole: everything that can be typed, and what runs it.

use anyhow::Result;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::commands;
use crate::features::{GPU, LEARN, only};
use crate::report::{Outcome, Report};
use crate::standard;

/// Everything that can be typed.
#[derive(Debug, Parser)]
#[command(
    name = "veni-cli",
    version,
    about = "Natural light for renderers, from a learned prior of outdoor skies",
    long_about = format!("Natural light for renderers, from a learned prior of outdoor skies.\n\n\
        VENI turns an HDR environment map into a few vectors (a latent) that rotate with it, and a latent \
        back into radiance for any direction. This tool bakes skies to image files, {}encodes panoramas, fits latents to \
        panoramas, parts of them and photographs, {}shows what is inside files and measures how fast this machine is.",
        only(GPU, "on the graphics card if there is one, "),
        only(LEARN, "trains models, ")),
    after_help = format!("Results are printed on stdout, everything else on stderr.\n\
        Exit codes: 0 fine; 1 ran, but stopped early or the answer is no; 2 error.\n\
        - in place of a file is standard input or output.\n\n\
        Examples:\n  \
        veni-cli bake --seed 7 -o sky.exr             a random sky\n  \
        veni-cli sample -o sheet.png                  sixteen random skies on one sheet\n  \
        veni-cli inspect sky.exr                      size, range, sun, the latent inside\n  \
        {}\n\
        'veni-cli help COMMAND' explains a command.",
        only(GPU, "veni-cli inspect --devices                    which graphics devices can bake\n")),
    propagate_version = true
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,

    /// Print each result as one line of JSON
    #[arg(long, global = true, display_order = 900)]
    pub(crate) json: bool,

    /// Print results and errors only: no progress, no notes
    #[arg(long, short, global = true, display_order = 901)]
    pub(crate) quiet: bool,
}

impl Cli {
    /// What was typed, and whether a file goes to standard output; that `-` stands where it cannot is an error of the command.
    pub(crate) fn typed() -> Result<(Self, Result<bool>), clap::Error> {
        let mut command = Self::command();
        let mut typed = command.try_get_matches_from_mut(std::env::args_os())?;
        let is_taken = standard::check(&command, &typed);
        let cli = Self::from_arg_matches_mut(&mut typed).map_err(|error| error.format(&mut command))?;
        Ok((cli, is_taken))
    }
}

/// The commands, in the order of `--help`.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Bake(commands::bake::Bake),
    Sample(commands::sample::Sample),
    Day(commands::day::Day),
    Synth(commands::synth::Synth),
    Encode(commands::encode::Encode),
    Fit(Box<commands::fit::Fit>),
    Ibl(commands::ibl::Ibl),
    Prepare(commands::prepare::Prepare),
    RenderProbe(commands::render_probe::RenderProbe),
    Light(commands::light::Light),
    #[cfg(feature = "learn")]
    Evaluate(commands::evaluate::Evaluate),
    Inspect(commands::inspect::Inspect),
    Bench(commands::bench::Bench),
    #[cfg(feature = "learn")]
    Train(commands::train::Train),
    Completions(commands::completions::Completions),
    Man(commands::man::Man),
}

impl Command {
    /// Runs what was typed.
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        match self {
            Self::Bake(c) => c.run(report),
            Self::Sample(c) => c.run(report),
            Self::Day(c) => c.run(report),
            Self::Synth(c) => c.run(report),
            Self::Encode(c) => c.run(report),
            Self::Fit(c) => c.run(report),
            Self::Ibl(c) => c.run(report),
            Self::Prepare(c) => c.run(report),
            Self::RenderProbe(c) => c.run(report),
            Self::Light(c) => c.run(report),
            #[cfg(feature = "learn")]
            Self::Evaluate(c) => c.run(report),
            Self::Inspect(c) => c.run(report),
            Self::Bench(c) => c.run(report),
            #[cfg(feature = "learn")]
            Self::Train(c) => c.run(report),
            Self::Completions(c) => c.run(Cli::command(), report),
            Self::Man(c) => c.run(Cli::command(), report),
        }
    }
}

#[cfg(test)]
mod advice;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_and_argument_is_explained() {
        let mut cli = Cli::command();
        cli.build();
        for command in cli.get_subcommands().filter(|c| c.get_name() != "help") {
            let name = command.get_name();
            assert!(command.get_about().is_some(), "{name} has no description");
            assert!(command.get_after_help().is_some(), "{name} shows no examples");
            for argument in command.get_arguments() {
                assert!(argument.get_help().is_some(), "{name}: {} is not explained", argument.get_id());
            }
        }
    }

    #[test]
    fn what_may_be_a_dash_is_an_argument() {
        let mut cli = Cli::command();
        cli.build();
        let rows = standard::MAY.iter().filter(|(of, ..)| *of != "evaluate" || cfg!(feature = "learn"));
        for (of, id, _) in rows {
            let mut commands = cli.get_subcommands().filter(|c| *of == "*" || c.get_name() == *of);
            assert!(commands.any(|c| c.get_arguments().any(|a| a.get_id() == *id)), "{of}: {id}");
        }
    }
}

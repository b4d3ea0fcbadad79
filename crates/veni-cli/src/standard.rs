//! Which arguments may be `-`, and that at most one takes standard input and one standard output.

use std::any::TypeId;
use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Arg, ArgMatches, Command};

/// What `-` stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dash {
    /// Standard input.
    Read,
    /// Standard output, and results go to stderr.
    Written,
    /// Standard output, where results go anyway.
    Result,
}

/// The arguments that may be `-`, by their names in the code, of all commands or of one. Folders may not, nor files whose names
/// are recorded to be found again.
pub(crate) const MAY: [(&str, &str, Dash); 29] = [
    ("*", "model", Dash::Read),
    ("bake", "latents", Dash::Read),
    ("bake", "output", Dash::Written),
    ("sample", "output", Dash::Written),
    ("synth", "sheet", Dash::Written),
    ("encode", "panoramas", Dash::Read),
    ("encode", "output", Dash::Result),
    ("encode", "preview", Dash::Written),
    ("fit", "pictures", Dash::Read),
    ("fit", "mask", Dash::Read),
    ("fit", "normals", Dash::Read),
    ("fit", "albedo_map", Dash::Read),
    ("fit", "target_sh", Dash::Read),
    ("fit", "target_irradiance", Dash::Read),
    ("fit", "output", Dash::Result),
    ("fit", "completed", Dash::Written),
    ("fit", "uncertainty", Dash::Written),
    ("ibl", "input", Dash::Read),
    ("render-probe", "sources", Dash::Read),
    ("render-probe", "mesh", Dash::Read),
    ("render-probe", "output", Dash::Written),
    ("render-probe", "normals", Dash::Written),
    ("render-probe", "mask", Dash::Written),
    ("light", "input", Dash::Read),
    ("light", "output", Dash::Written),
    ("light", "residual", Dash::Written),
    ("light", "sharpened", Dash::Written),
    ("inspect", "files", Dash::Read),
    ("evaluate", "models", Dash::Read),
];

/// Checks what was typed. Whether standard output is a file's, so that results go to stderr.
pub(crate) fn check(cli: &Command, typed: &ArgMatches) -> Result<bool> {
    let Some((name, typed)) = typed.subcommand() else { return Ok(false) };
    let Some(command) = cli.find_subcommand(name) else { return Ok(false) };
    let mut named = Vec::new();
    for argument in command.get_arguments().filter(|argument| is_path(name, argument)) {
        let values = typed.get_raw(argument.get_id().as_str()).into_iter().flatten();
        let dashes = values.filter(|value| *value == "-").count();
        match meaning(name, argument) {
            Some(dash) => named.extend(std::iter::repeat_n((called(argument), dash), dashes)),
            None if dashes > 0 => bail!(
                "{} -: neither standard input nor output can stand for this; give a name (./- if it is called so)",
                called(argument)
            ),
            None => {}
        }
    }
    let (read, written): (Vec<_>, Vec<_>) = named.into_iter().partition(|(_, dash)| *dash == Dash::Read);
    once(&read, "standard input (-) can be read only once: save it as a file, and name that")?;
    once(&written, "standard output (-) takes only one of them: name files for the others")?;
    Ok(written.iter().any(|(_, dash)| *dash == Dash::Written))
}

fn once(named: &[(String, Dash)], why: &str) -> Result<()> {
    match named {
        [] | [_] => Ok(()),
        [(first, _), (second, _), ..] if first == second => bail!("{first} names - twice; {why}"),
        [(first, _), (second, _), ..] => bail!("{first} and {second} both name -; {why}"),
    }
}

/// What `-` is for an argument; nothing where it may not be.
fn meaning(command: &str, argument: &Arg) -> Option<Dash> {
    let id = argument.get_id().as_str();
    let found = MAY.iter().find(|(of, name, _)| (*of == command || *of == "*") && *name == id);
    found.map(|(.., dash)| *dash)
}

/// Whether the values of an argument are paths, be it with a name before them.
fn is_path(command: &str, argument: &Arg) -> bool {
    argument.get_value_parser().type_id() == TypeId::of::<PathBuf>() || meaning(command, argument).is_some()
}

/// How an argument is typed.
fn called(argument: &Arg) -> String {
    match argument.get_long() {
        Some(long) => format!("--{long}"),
        None => argument
            .get_value_names()
            .unwrap_or_default()
            .first()
            .map_or_else(String::new, |name| name.to_string()),
    }
}

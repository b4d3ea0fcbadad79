//! What is reported to the user, and where: results on stdout, notes and errors on stderr.

use std::borrow::Cow;
use std::ffi::OsString;
use std::fmt::Display;
use std::io::{self, Write};

use serde::Serialize;

use crate::piped::renamed;
use crate::printable::{printable, printable_json, printable_lines};

/// How a command that did not fail ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// It did what was asked (exit code 0).
    Fine,
    /// It ran, but the answer is no, or it was stopped on request (exit code 1).
    Negative,
}

/// The two output switches that every command has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Report {
    json: bool,
    quiet: bool,
    /// Whether an output file goes to stdout, and results to stderr.
    taken: bool,
}

impl Report {
    pub(crate) fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet, taken: false }
    }

    /// For a command that writes its file to stdout: results are not to be in it.
    pub(crate) fn beside_stdout(self) -> Self {
        Self { taken: true, ..self }
    }

    /// Whether an output file goes to stdout.
    pub(crate) fn is_beside_stdout(self) -> bool {
        self.taken
    }

    /// Whether results are to be JSON.
    pub(crate) fn is_json(self) -> bool {
        self.json
    }

    /// Whether progress and notes are unwanted.
    pub(crate) fn is_quiet(self) -> bool {
        self.quiet
    }

    /// One result: the line `human`, or `value` as one line of JSON.
    pub(crate) fn result(self, human: impl Display, value: &impl Serialize) -> anyhow::Result<()> {
        self.print(&printable(&human.to_string()), value)
    }

    /// One result of several lines, whose own parts must be [`printable`].
    pub(crate) fn table(self, human: &str, value: &impl Serialize) -> anyhow::Result<()> {
        self.print(&printable_lines(human), value)
    }

    fn print(self, human: &str, value: &impl Serialize) -> anyhow::Result<()> {
        let line = renamed(if self.json { serde_json::to_string(value)? } else { human.to_owned() });
        let line = if self.json { printable_json(&line) } else { line.as_str().into() };
        if self.taken {
            if self.json || !self.quiet {
                write_stderr(&format!("{line}\n"));
            }
            return Ok(());
        }
        to_stdout(format!("{line}\n").as_bytes())
    }

    /// A remark that is not a result (stderr, silenced by `--quiet`).
    pub(crate) fn note(self, text: impl Display) {
        if !self.quiet {
            complain(&text.to_string());
        }
    }
}

/// The whole error chain in one line, so that a log keeps it together.
pub(crate) fn error(error: &anyhow::Error) {
    complain(&format!("veni-cli: {}", chain(error)));
}

/// Prints what is wrong with the command line, or the help that was asked for, and ends.
pub(crate) fn exit_on_usage(error: &clap::Error) -> ! {
    // without escape sequences, those of what was typed too
    let text = error.render().to_string();
    let shown = printable_lines(&text);
    let acts = |argument: &OsString| {
        let argument = argument.to_string_lossy();
        matches!(printable_lines(&argument), Cow::Owned(_))
    };
    if error.use_stderr() && (shown != text || std::env::args_os().any(|argument| acts(&argument))) {
        // colours would be lost among what is escaped
        write_stderr(&shown);
        std::process::exit(error.exit_code());
    }
    error.exit()
}

/// Does `work` for each item and goes on after errors, unless nobody reads the results any more.
pub(crate) fn each<T>(
    items: impl IntoIterator<Item = T>,
    mut work: impl FnMut(T) -> anyhow::Result<()>,
) -> anyhow::Result<Outcome> {
    let mut failed = Vec::new();
    for item in items {
        match work(item) {
            Ok(()) => {}
            Err(error) if is_closed_pipe(&error) => return Err(error),
            Err(error) => failed.push(error),
        }
    }
    last_of(failed)
}

/// Ends a command that went on after errors: the last one is for `main` to print, the others are printed here.
pub(crate) fn last_of(mut errors: Vec<anyhow::Error>) -> anyhow::Result<Outcome> {
    let last = errors.pop();
    errors.iter().for_each(error);
    last.map_or(Ok(Outcome::Fine), Err)
}

/// An error and what caused it. A cause whose words stand there already is not said twice: wgpu's errors have those of their
/// causes in their own.
fn chain(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(|cause| one_line(&cause.to_string())) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

fn one_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Lines for stdout that are no result of their own (tables, latents).
pub(crate) fn lines_to_stdout(text: &str) -> anyhow::Result<()> {
    to_stdout(printable_lines(text).as_bytes())
}

/// Writes and flushes bytes as they are to stdout; a reader that went away becomes [`ClosedPipe`].
pub(crate) fn to_stdout(bytes: &[u8]) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Err(ClosedPipe.into()),
        Err(e) => Err(anyhow::Error::new(e).context("cannot write to standard output")),
    }
}

/// One line for stderr.
pub(crate) fn complain(line: &str) {
    write_stderr(&format!("{}\n", printable(&renamed(line.to_owned()))));
}

/// Nobody may be listening on stderr either, and there is no third place to complain.
fn write_stderr(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// The reader of stdout has gone (`veni-cli … | head -1`): a reason to stop, not an error.
#[derive(Debug, PartialEq, Eq)]
struct ClosedPipe;

impl Display for ClosedPipe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("standard output was closed")
    }
}

impl std::error::Error for ClosedPipe {}

/// Whether `error` only says that nobody reads stdout any more.
pub(crate) fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<ClosedPipe>().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_chain_is_one_line() {
        let error = anyhow::anyhow!("line one\n  line two").context("outer");
        assert_eq!(chain(&error), "outer: line one line two");
        let error = anyhow::anyhow!("full").context("disk: full").context("outer");
        assert_eq!(chain(&error), "outer: disk: full");
    }

    #[test]
    fn a_closed_pipe_is_known_through_context() {
        assert!(is_closed_pipe(&anyhow::Error::new(ClosedPipe).context("while writing")));
        assert!(!is_closed_pipe(&anyhow::anyhow!("standard output was closed")));
    }
}

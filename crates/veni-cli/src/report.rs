//! What is reported to the user, and where: results on stdout, notes and errors on stderr.

use std::fmt::Display;
use std::io::{self, Write};

use serde::Serialize;

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
}

impl Report {
    pub(crate) fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet }
    }

    /// Whether results are to be JSON.
    pub(crate) fn is_json(self) -> bool {
        self.json
    }

    /// Whether progress and notes are unwanted.
    pub(crate) fn is_quiet(self) -> bool {
        self.quiet
    }

    /// One result: `human` as it stands, or `value` as one line of JSON.
    pub(crate) fn result(self, human: impl Display, value: &impl Serialize) -> anyhow::Result<()> {
        if self.json {
            let mut line = serde_json::to_vec(value)?;
            line.push(b'\n');
            to_stdout(&line)
        } else {
            to_stdout(format!("{human}\n").as_bytes())
        }
    }

    /// A remark that is not a result (stderr, silenced by `--quiet`).
    pub(crate) fn note(self, text: impl Display) {
        if !self.quiet {
            to_stderr(&format!("{text}\n"));
        }
    }
}

/// The whole error chain in one line, so that a log keeps it together.
pub(crate) fn error(error: &anyhow::Error) {
    to_stderr(&format!("veni-cli: {}\n", one_line(&format!("{error:#}"))));
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

fn one_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Writes and flushes raw bytes to stdout; a reader that went away becomes [`ClosedPipe`].
pub(crate) fn to_stdout(bytes: &[u8]) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Err(ClosedPipe.into()),
        Err(e) => Err(anyhow::Error::new(e).context("cannot write to standard output")),
    }
}

/// Nobody may be listening on stderr either, and there is no third place to complain.
pub(crate) fn to_stderr(text: &str) {
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
        assert_eq!(one_line(&format!("{error:#}")), "outer: line one line two");
    }

    #[test]
    fn a_closed_pipe_is_known_through_context() {
        assert!(is_closed_pipe(&anyhow::Error::new(ClosedPipe).context("while writing")));
        assert!(!is_closed_pipe(&anyhow::anyhow!("standard output was closed")));
    }
}

//! `metrics.jsonl`: one JSON object per line, appended as the run goes.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::{Error, Result};
use veni_light::output::{Overwrite, write_atomic};

/// An append-only log of records that have a `step`.
#[derive(Debug)]
pub(super) struct MetricsLog {
    path: PathBuf,
    file: File,
    validated: bool,
}

impl MetricsLog {
    /// Opens `path` for a run that has made `step` updates of `total`: lines of later steps, and a torn last line, come
    /// from a life that ended after its last checkpoint and are dropped. So is the validation after the last update,
    /// which a run makes whenever it arrives there.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read or written.
    pub(super) fn open(path: &Path, step: u64, total: u64) -> Result<Self> {
        let mut validated = false;
        if path.exists() {
            let (lines, has_validation) = kept(path, step, total)?;
            validated = has_validation;
            write_atomic(path, Overwrite::Replace, |out| {
                lines.iter().try_for_each(|l| writeln!(out, "{l}")).map_err(|e| Error::io(path, "write", e))
            })?;
        }
        let file = OpenOptions::new().create(true).append(true).open(path);
        let file = file.map_err(|e| Error::io(path, "create", e))?;
        Ok(Self { path: path.to_path_buf(), file, validated })
    }

    /// Whether the log had the validation after the last update when it was opened.
    pub(super) fn is_validated(&self) -> bool {
        self.validated
    }

    /// Appends one record.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub(super) fn append(&mut self, record: &impl Serialize) -> Result<()> {
        let mut line =
            serde_json::to_vec(record).map_err(|e| Error::invalid(format!("metrics record: {e}")))?;
        line.push(b'\n');
        // one write per line: a kill leaves at most one torn line
        self.file.write_all(&line).map_err(|e| Error::io(&self.path, "write", e))
    }

    /// Returns once all lines are on disk.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be written.
    pub(super) fn sync(&self) -> Result<()> {
        self.file.sync_data().map_err(|e| Error::io(&self.path, "write", e))
    }
}

/// The lines up to update `step`, and whether its validation is among them.
fn kept(path: &Path, step: u64, total: u64) -> Result<(Vec<String>, bool)> {
    let file = fs::File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let (mut lines, mut validated) = (Vec::new(), false);
    for line in BufReader::new(file).lines() {
        let line = line.map_err(|e| Error::io(path, "read", e))?;
        let Ok(record) = serde_json::from_str::<serde_json::Value>(&line) else { continue };
        let last = |at: u64| at == total && record.get("validation").is_some();
        if record["step"].as_u64().is_some_and(|at| at <= step && !last(at)) {
            validated |= record["step"].as_u64() == Some(step) && record.get("validation").is_some();
            lines.push(line);
        }
    }
    Ok((lines, validated))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn reopening_drops_what_the_checkpoint_does_not_know() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        let mut log = MetricsLog::open(&path, 0, 3).unwrap();
        for step in 1..=3 {
            log.append(&json!({ "step": step })).unwrap();
        }
        drop(log);
        let mut text = fs::read_to_string(&path).unwrap();
        text.push_str("{\"step\": 2, \"tor");
        fs::write(&path, text).unwrap();
        MetricsLog::open(&path, 2, 3).unwrap().append(&json!({ "step": 3, "again": true })).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text, "{\"step\":1}\n{\"step\":2}\n{\"again\":true,\"step\":3}\n");
    }

    #[test]
    fn the_last_validation_is_made_and_logged_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        for _ in 0..3 {
            let known = fs::read_to_string(&path).unwrap_or_default().lines().count() as u64;
            let mut log = MetricsLog::open(&path, known.min(2), 2).unwrap();
            (known + 1..=2).for_each(|step| log.append(&json!({ "step": step })).unwrap());
            log.append(&json!({ "step": 2, "validation": {} })).unwrap();
        }
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text, "{\"step\":1}\n{\"step\":2}\n{\"step\":2,\"validation\":{}}\n");
        // that of an earlier step is only made once
        MetricsLog::open(&path, 2, 3).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }
}

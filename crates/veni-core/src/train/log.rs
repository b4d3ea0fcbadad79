//! `metrics.jsonl`: one JSON object per line, appended as the run goes.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::output::{Overwrite, write_atomic};
use crate::{Error, Result};

/// An append-only log of records that have a `step`.
#[derive(Debug)]
pub(super) struct MetricsLog {
    path: PathBuf,
    file: File,
}

impl MetricsLog {
    /// Opens `path` for a run that has made `step` updates: lines of later steps, and a torn last line, come
    /// from a life that ended after its last checkpoint and are dropped.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read or written.
    pub(super) fn open(path: &Path, step: u64) -> Result<Self> {
        if path.exists() {
            let lines = kept(path, step)?;
            write_atomic(path, Overwrite::Replace, |out| {
                lines.iter().try_for_each(|l| writeln!(out, "{l}")).map_err(|e| Error::io(path, "write", e))
            })?;
        }
        let file = OpenOptions::new().create(true).append(true).open(path);
        let file = file.map_err(|e| Error::io(path, "create", e))?;
        Ok(Self { path: path.to_path_buf(), file })
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
}

fn kept(path: &Path, step: u64) -> Result<Vec<String>> {
    let file = fs::File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let mut lines = Vec::new();
    for line in BufReader::new(file).lines() {
        let line = line.map_err(|e| Error::io(path, "read", e))?;
        let record: Option<serde_json::Value> = serde_json::from_str(&line).ok();
        if record.and_then(|r| r["step"].as_u64()).is_some_and(|s| s <= step) {
            lines.push(line);
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn reopening_drops_what_the_checkpoint_does_not_know() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        let mut log = MetricsLog::open(&path, 0).unwrap();
        for step in 1..=3 {
            log.append(&json!({ "step": step })).unwrap();
        }
        drop(log);
        let mut text = fs::read_to_string(&path).unwrap();
        text.push_str("{\"step\": 2, \"tor");
        fs::write(&path, text).unwrap();
        MetricsLog::open(&path, 2).unwrap().append(&json!({ "step": 3, "again": true })).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text, "{\"step\":1}\n{\"step\":2}\n{\"again\":true,\"step\":3}\n");
    }
}

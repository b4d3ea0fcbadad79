//! Running the binary in a folder of its own, and saying what is expected of it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// A fresh folder in which commands run; removed at the end.
pub(crate) struct Dir(TempDir);

/// What a command left behind.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.path(name), content).unwrap();
        self.path(name)
    }

    /// The command, not yet started.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_veni-cli"));
        command.current_dir(self.0.path()).args(args).stdin(Stdio::null());
        // a layer of Mesa's that sorts graphics devices complains on stderr where there is no desktop
        command.env("NODEVICE_SELECT", "1");
        command
    }

    /// Runs to the end.
    pub(crate) fn run(&self, args: &[&str]) -> Run {
        finish(&mut self.command(args))
    }

    /// Runs and must succeed; returns what it printed.
    pub(crate) fn ok(&self, args: &[&str]) -> String {
        let run = self.run(args);
        assert_eq!(run.code, Some(0), "{args:?} failed:\n{}{}", run.out, run.err);
        run.out
    }

    /// Runs with `--json`, must succeed, and every line must be a JSON object.
    pub(crate) fn json(&self, args: &[&str]) -> Vec<Value> {
        let out = self.ok(&[args, &["--json", "--quiet"]].concat());
        assert!(!out.is_empty(), "{args:?} printed no JSON");
        let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{args:?}: {e}: {line}"));
        out.lines().map(parse).inspect(|v: &Value| assert!(v.is_object(), "{v}")).collect()
    }

    /// Runs and must fail as an error should: exit code 2, one line on stderr with each of `words` in it, nothing
    /// on stdout, no file made or removed.
    pub(crate) fn refused(&self, args: &[&str], words: &[&str]) {
        let before = self.files();
        let run = self.run(args);
        assert_eq!(run.code, Some(2), "{args:?} was not refused:\n{}{}", run.out, run.err);
        assert_eq!(run.out, "", "{args:?}");
        assert!(run.err.starts_with("veni-cli: ") && run.err.ends_with('\n'), "{args:?}: {}", run.err);
        assert_eq!(run.err.lines().count(), 1, "{args:?}: {}", run.err);
        for word in words {
            assert!(run.err.contains(word), "{args:?}: '{word}' is missing in: {}", run.err);
        }
        assert_eq!(self.files(), before, "{args:?} left something behind");
    }

    /// All files and folders below, hidden ones too.
    pub(crate) fn files(&self) -> BTreeSet<PathBuf> {
        fn walk(folder: &Path, found: &mut BTreeSet<PathBuf>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    walk(&path, found);
                }
                found.insert(path);
            }
        }
        let mut found = BTreeSet::new();
        walk(self.0.path(), &mut found);
        found
    }
}

/// Runs a command to its end.
pub(crate) fn finish(command: &mut Command) -> Run {
    let output = command.output().unwrap();
    Run {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The panoramas of the repository: a folder with `train/` and `val/`.
pub(crate) fn panoramas() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/panoramas"))
}

/// One real panorama.
pub(crate) fn panorama() -> String {
    let mut files: Vec<_> =
        std::fs::read_dir(panoramas().join("val")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "exr" || e == "hdr"));
    files.sort();
    text(&files[0])
}

/// A small file of `tests/cli/files`.
pub(crate) fn file(name: &str) -> String {
    text(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cli/files").join(name))
}

pub(crate) fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

/// Arguments that train `steps` steps of a very small model on the repository's panoramas.
pub(crate) fn train_args<'a>(data: &'a str, out: &'a str, steps: &'a str) -> Vec<&'a str> {
    let mut args = vec!["train", "--data", data, "--preset", "tiny", "--latent-vectors", "4"];
    args.extend(["--seed", "3", "--steps", steps, "--out", out, "--quiet"]);
    args
}

/// The model of a run of two steps, trained once by the binary for all tests.
pub(crate) fn model() -> &'static str {
    static MODEL: OnceLock<(Dir, String)> = OnceLock::new();
    let (_, path) = MODEL.get_or_init(|| {
        let dir = Dir::new();
        dir.ok(&train_args(panoramas().to_str().unwrap(), "run", "2"));
        let path = text(&dir.path("run/model.safetensors"));
        (dir, path)
    });
    path
}

/// How a process is asked to stop: as Ctrl-C does, unless that is ignored here, as it is in the background of a shell without job
/// control, and so by every process that is started from here.
#[cfg(unix)]
pub(crate) fn interrupt() -> &'static str {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    if ignored & 0b10 == 0 { "-INT" } else { "-TERM" }
}

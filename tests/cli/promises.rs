//! What the file system is promised: nothing is replaced that was not meant, nothing stays half-written, one of two wins.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

#[cfg(unix)]
use crate::util::interrupt;
use crate::util::{Dir, text};

/// A bake that takes long enough to be disturbed.
fn slow(dir: &Dir, args: &[&str]) -> Child {
    let bake = ["bake", "--seed", "1", "--device", "cpu", "-q"];
    dir.command(&[&bake, args].concat()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Unfinished files in the folder.
fn parts(dir: &Dir) -> Vec<String> {
    let hidden = dir.files().into_iter().filter(|file| file.extension().is_some_and(|e| e == "part"));
    hidden.map(|file| text(&file)).collect()
}

/// Waits until a file is being written.
fn begun(dir: &Dir, count: usize) {
    let patience = Instant::now();
    while parts(dir).len() < count {
        assert!(patience.elapsed() < Duration::from_secs(60), "no file was begun");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn what_comes_into_being_meanwhile_is_not_replaced() {
    let dir = Dir::new();
    let child = slow(&dir, &["-o", "late.exr", "--size", "1024"]);
    begun(&dir, 1);
    dir.write("late.exr", "precious");
    let ended = child.wait_with_output().unwrap();
    let err = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{err}");
    assert!(err.contains("late.exr: exists already; --force") && ended.stdout.is_empty(), "{err}");
    assert_eq!(std::fs::read_to_string(dir.path("late.exr")).unwrap(), "precious");
    assert_eq!(dir.files().len(), 1, "{:?}", dir.files());
}

#[test]
fn of_two_bakes_to_one_name_one_wins() {
    let dir = Dir::new();
    let small = ["-o", "one.exr", "-o", "one.png", "--size", "512"];
    let children: Vec<_> = (0..2).map(|_| slow(&dir, &small)).collect();
    let ended: Vec<_> = children.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
    let mut codes: Vec<_> = ended.iter().map(|e| e.status.code().unwrap()).collect();
    codes.sort_unstable();
    assert_eq!(codes, [0, 2], "{ended:?}");
    assert_eq!(dir.files().len(), 2, "{:?}", dir.files());
    dir.ok(&["inspect", "one.exr"]);
}

/// A folder for an engine, of a sky that takes a while.
fn ibl(dir: &Dir, name: &str) -> Child {
    let args = ["ibl", "sky.exr", "--engine", "three", "--size", "256", "-q", "-o", name];
    dir.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The unfinished folders beside the files.
fn part_folders(dir: &Dir) -> usize {
    let names = std::fs::read_dir(dir.path("")).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter(|name| name.to_string_lossy().ends_with(".part")).count()
}

fn folder_begun(dir: &Dir) {
    let patience = Instant::now();
    while part_folders(dir) == 0 {
        assert!(patience.elapsed() < Duration::from_secs(60), "no folder was begun");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn folders_keep_the_promises_of_files() {
    let dir = Dir::new();
    dir.ok(&["bake", "--seed", "5", "--size", "64", "--device", "cpu", "-q", "-o", "sky.exr"]);
    // what comes into being meanwhile stays
    let child = ibl(&dir, "late");
    folder_begun(&dir);
    std::fs::create_dir(dir.path("late")).unwrap();
    dir.write("late/sky.ktx2", "precious");
    let ended = child.wait_with_output().unwrap();
    let err = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(2) && err.contains("late: exists already"), "{err}");
    assert_eq!(std::fs::read_to_string(dir.path("late/sky.ktx2")).unwrap(), "precious");
    // of two to one name one wins
    let children = [ibl(&dir, "one"), ibl(&dir, "one")];
    let mut codes = children.map(|child| child.wait_with_output().unwrap().status.code().unwrap());
    codes.sort_unstable();
    assert_eq!((codes, part_folders(&dir)), ([0, 2], 0));
    // killed outright, it cannot clean up: the next one does, be it another command
    let mut child = ibl(&dir, "killed");
    folder_begun(&dir);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(part_folders(&dir), 1);
    dir.ok(&["bake", "--seed", "2", "--size", "16", "-q", "-o", "small.exr"]);
    assert_eq!(part_folders(&dir), 0);
    #[cfg(unix)]
    {
        let mut child = ibl(&dir, "ended");
        folder_begun(&dir);
        signal(&child, "-TERM");
        child.wait().unwrap();
        assert!(part_folders(&dir) == 0 && !dir.path("ended").exists());
    }
}

#[cfg(unix)]
fn signal(child: &Child, signal: &str) {
    let sent = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

#[cfg(unix)]
#[test]
fn signals_end_it_at_once_and_leave_nothing() {
    use std::os::unix::process::ExitStatusExt;
    for (name, number) in [("-INT", 2), ("-TERM", 15), ("-HUP", 1)] {
        if name == "-INT" && interrupt() != name {
            continue;
        }
        let dir = Dir::new();
        // two files at once
        let mut child = slow(&dir, &["-o", "big.exr", "-o", "big.hdr", "--size", "8192"]);
        begun(&dir, 2);
        let sent = Instant::now();
        signal(&child, name);
        let status = child.wait().unwrap();
        assert!(sent.elapsed() < Duration::from_secs(3), "{name}: {:?}", sent.elapsed());
        assert_eq!(status.signal(), Some(number), "{name}: {status:?}");
        assert_eq!(dir.files().len(), 0, "{name}: {:?}", dir.files());
    }
}

/// nohup's promise.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_is_ignored_stays_ignored() {
    let dir = Dir::new();
    let bin = env!("CARGO_BIN_EXE_veni-cli");
    let script = format!("trap '' HUP; exec '{bin}' bake --seed 1 --size 1024 --device cpu -q -o a.exr");
    let mut command = std::process::Command::new("sh");
    let mut child = command.args(["-c", &script]).current_dir(dir.path("")).spawn().unwrap();
    begun(&dir, 1);
    signal(&child, "-HUP");
    assert!(child.wait().unwrap().success());
    dir.ok(&["inspect", "a.exr"]);
}

#[test]
fn what_a_killed_process_left_is_swept_by_the_next() {
    let dir = Dir::new();
    let mut child = slow(&dir, &["-o", "big.exr", "--size", "8192"]);
    begun(&dir, 1);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(parts(&dir).len(), 1, "killed outright, it could not clean up");
    let own = text(&dir.write(".notes.part", "mine"));
    let mut alive = slow(&dir, &["-o", "alive.exr", "--size", "8192"]);
    let patience = Instant::now();
    let living = loop {
        let left: Vec<_> = parts(&dir).into_iter().filter(|part| *part != own).collect();
        if let [part] = left.as_slice()
            && part.contains(".alive.exr.")
        {
            break part.clone();
        }
        assert!(patience.elapsed() < Duration::from_secs(60), "{left:?}");
        std::thread::sleep(Duration::from_millis(10));
    };
    // what a living one writes is not swept, nor what is somebody's own
    dir.ok(&["bake", "--seed", "2", "--size", "16", "-q", "-o", "small.exr"]);
    assert_eq!(parts(&dir), [living, own]);
    alive.kill().unwrap();
    alive.wait().unwrap();
}

#[cfg(unix)]
#[test]
fn force_keeps_the_mode_and_replaces_a_link_not_what_it_names() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let dir = Dir::new();
    let bake = |force: &[&str]| {
        dir.run(&[&["bake", "--seed", "2", "--size", "16", "-q", "-o", "sky.exr"], force].concat())
    };
    assert_eq!(bake(&[]).code, Some(0));
    std::fs::set_permissions(dir.path("sky.exr"), std::fs::Permissions::from_mode(0o640)).unwrap();
    assert_eq!(bake(&["--force"]).code, Some(0));
    let mode = dir.path("sky.exr").metadata().unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640);

    std::fs::rename(dir.path("sky.exr"), dir.path("shared.exr")).unwrap();
    let shared = std::fs::read(dir.path("shared.exr")).unwrap();
    symlink("shared.exr", dir.path("sky.exr")).unwrap();
    dir.refused(&["bake", "--seed", "3", "--size", "16", "-o", "sky.exr"], &["exists already"]);
    assert_eq!(bake(&["--force"]).code, Some(0));
    assert!(!dir.path("sky.exr").is_symlink());
    assert_eq!(std::fs::read(dir.path("shared.exr")).unwrap(), shared);
    // a link to nowhere is something that exists, too
    symlink("nowhere.exr", dir.path("dangling.exr")).unwrap();
    dir.refused(&["bake", "--seed", "3", "--size", "16", "-o", "dangling.exr"], &["exists already"]);
    let pipe = dir.path("pipe.exr");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    dir.refused(&["bake", "--seed", "3", "--size", "16", "-o", "pipe.exr", "--force"], &["pipe"]);
}

//! One image gives one file, whichever process writes it: names and order of attributes are no matter of chance.

use std::path::Path;
use std::process::Command;

use veni_image::{HalfRange, Panorama, Precision, WriteFormat, WriteOptions, attributes};
use veni_light::sphere::Equirect;

/// Set for the processes that this test starts: the file that they write.
const TARGET: &str = "VENI_TEST_EXR_TARGET";
/// More than a shuffled order would ever have right by chance: one order in 12! = 4.8e8.
const NAMES: [&str; 12] = ["m", "c", "veni:b", "A", "zz", "e", "owner", "d", "comments", "Z", "f", "veni:a"];

fn write(path: &Path) {
    // beyond the range of half precision, so that the factor is an attribute too
    let image = Panorama::from_fn(Equirect::new(40, 20), |[x, y, z]| [1e5 * (1.0 + x), 1.0 + y, 1.0 + z]);
    let mut options = WriteOptions::new(WriteFormat::Exr(Precision::Half));
    options.half_range = HalfRange::Fit;
    options.attributes = NAMES.map(|name| (name.to_owned(), format!("value of {name}"))).into();
    image.write(path, &options).unwrap();
}

/// The names in the header's order: magic number and version, then (name, type, length, value) until an empty name.
fn names(bytes: &[u8]) -> Vec<String> {
    let (mut at, mut names) = (8, Vec::new());
    let text = |at: &mut usize| {
        let length = bytes[*at..].iter().position(|b| *b == 0).unwrap();
        let text = String::from_utf8(bytes[*at..*at + length].to_vec()).unwrap();
        *at += length + 1;
        text
    };
    loop {
        let name = text(&mut at);
        if name.is_empty() {
            return names;
        }
        names.push(name);
        text(&mut at);
        at += 4 + u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    }
}

#[test]
fn two_processes_write_the_same_bytes() {
    if let Some(target) = std::env::var_os(TARGET) {
        return write(Path::new(&target));
    }
    let folder = tempfile::tempdir().unwrap();
    let files = ["first.exr", "second.exr"].map(|name| {
        let path = folder.path().join(name);
        let run = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "two_processes_write_the_same_bytes"])
            .env(TARGET, &path)
            .output()
            .unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
        (std::fs::read(&path).unwrap(), path)
    });
    assert!(files[0].0 == files[1].0, "{:?}\n{:?}", names(&files[0].0), names(&files[1].0));
    // the format's own first, the others by the bytes of their names
    let names = names(&files[0].0);
    let (own, others) = names.split_at(names.len() - 13);
    let given = ["A", "Z", "c", "colorInteropID", "d", "e", "f", "m", "veni:a", "veni:b"];
    assert_eq!(others, [&given[..], &["veni:pixels", "veni:radianceScale", "zz"]].concat(), "{own:?}");
    // what is said is what was given, and the pixels behind it are whole
    let said = attributes(&files[0].1).unwrap();
    assert!(NAMES.iter().all(|name| said[*name] == format!("value of {name}")), "{said:?}");
    let back = Panorama::read(&files[0].1).unwrap();
    assert!((back.pixel(20, 10)[0] / 2e5 - 1.0).abs() < 0.02, "{:?}", back.pixel(20, 10));
}

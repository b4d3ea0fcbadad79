//! Wavefront OBJ files, by the command line's own reader: it is no library's, so its file is compiled here too.

use std::path::Path;

use super::{Target, untouched};

#[path = "../../../crates/veni-cli/src/commands/render_probe/obj/mod.rs"]
#[allow(dead_code, unreachable_pub, missing_docs, reason = "what of it reads files is run")]
mod reader;

pub(super) const TARGETS: &[Target] = &[Target { name: "obj", run: mesh, seeds: meshes, repair: untouched }];

fn mesh(path: &Path) -> bool {
    reader::read(path, reader::Up::Y).is_ok()
}

fn meshes() -> Vec<Vec<u8>> {
    let square = "v 0 0 0\nv 1 0 0\n# a comment\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    let normals = "o a\nv 0 0 0\nv 1 0 0\nv 0 1 1\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 -1/1/1\n";
    let concave = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 3 4 5 6 1 2\n";
    vec![square.into(), normals.into(), concave.into()]
}

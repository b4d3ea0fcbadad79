//! 8-bit sRGB PNG, row by row.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;

use super::{Accept, SOFTWARE, WriteOptions};
use crate::encoder::encoder;
use crate::tonemap::Tonemap;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

pub(super) fn write(
    file: &mut BufWriter<File>,
    path: &Path,
    grid: Equirect,
    tonemap: Tonemap,
    options: &WriteOptions,
    run: impl FnOnce(Accept<'_>) -> Result<()>,
) -> Result<()> {
    let wrap = |error| match error {
        png::EncodingError::IoError(e) => Error::io(path, "write", e),
        other => Error::invalid(format!("PNG: {other}")),
    };
    let mut encoder = encoder(file, [grid.width, grid.height], png::ColorType::Rgb)?;
    encoder.add_itxt_chunk("Software".to_owned(), SOFTWARE.to_owned()).map_err(wrap)?;
    for (name, value) in &options.attributes {
        encoder.add_itxt_chunk(name.clone(), value.clone()).map_err(wrap)?;
    }
    let mut writer = encoder.write_header().map_err(wrap)?;
    let mut stream = writer.stream_writer().map_err(wrap)?;
    run(&mut |rows| {
        for rows in rows.chunks(64 * grid.width) {
            let bytes: Vec<[u8; 3]> = rows.par_iter().map(|&pixel| tonemap.apply_u8(pixel)).collect();
            stream.write_all(bytes.as_flattened()).map_err(|e| Error::io(path, "write", e))?;
        }
        Ok(())
    })?;
    stream.finish().map_err(wrap)?;
    writer.finish().map_err(wrap)
}

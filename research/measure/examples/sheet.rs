//! PNG pictures of one size side by side, row by row.
//!
//! ```sh
//! cargo run --release -p veni-research --example sheet -- COLUMNS OUT.png IN.png…
//! ```

use veni_image::Sheet;
use veni_light::output::Overwrite;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [columns, out, inputs @ ..] = &args[..] else {
        return Err("usage: sheet COLUMNS OUT.png IN.png…".into());
    };
    let columns: usize = columns.parse()?;
    let mut sheet = None;
    for (at, input) in inputs.iter().enumerate() {
        let picture = image::open(input)?.to_rgb8();
        let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
        let sheet = sheet.get_or_insert_with(|| {
            (Sheet::new(columns, inputs.len().div_ceil(columns), width, height), [width, height])
        });
        if sheet.1 != [width, height] {
            return Err(format!("{input}: {width} x {height}, the first is {:?}", sheet.1).into());
        }
        sheet.0.place(at % columns, at / columns, picture.pixels().map(|p| p.0));
    }
    let (sheet, _) = sheet.ok_or("no pictures")?;
    Ok(sheet.write(std::path::Path::new(out), Overwrite::Replace)?)
}

//! Fits the LDR → HDR expansion to HDR panoramas, measures it, and shows it.
//!
//! ```text
//! cargo run --release -p veni-research --example expansion -- fit DIR
//! cargo run --release -p veni-research --example expansion -- measure DIR [TRAIN_DIR]
//! cargo run --release -p veni-research --example expansion -- picture OUT.png IN.exr…
//! ```
//! Every panorama is exposed so that its geometric mean luminance is middle grey, and 1 stop less, 1 and 2 more; clipped,
//! coded in 8-bit sRGB, expanded, and compared with what it was. `measure` tables the expansion beside plain linearisation
//! and two published operators, whose free parameters are chosen on TRAIN_DIR.

#![expect(clippy::print_stdout, reason = "an example that prints tables")]

mod fit;
mod metrics;
mod operators;
mod picture;
mod sample;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["fit", folder] => fit::run(folder),
        ["measure", folder] => metrics::run(folder, None),
        ["measure", folder, train] => metrics::run(folder, Some(train)),
        ["picture", out, ref inputs @ ..] if !inputs.is_empty() => picture::run(out, inputs),
        _ => Err("usage: expansion fit DIR | measure DIR [TRAIN_DIR] | picture OUT.png IN.exr…".into()),
    }
}

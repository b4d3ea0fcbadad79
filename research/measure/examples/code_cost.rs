//! What lights and lobes of a code add to the time of a bake: ratios, in turns.
//!
//! ```sh
//! cargo run --release -p veni-research --example code_cost -- LATENT.json [ROUNDS]
//! ```
//!
//! LATENT.json has four lights and 38 lobes: `veni-cli encode PANORAMA --model 300 --compact-lights 4 -o LATENT.json`.

#![allow(clippy::print_stdout, reason = "results go to stdout")]

use std::time::Instant;

use veni_light::latent::Latent;
use veni_light::light::Lights;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let file = args.next().ok_or("usage: code_cost LATENT.json [ROUNDS]")?;
    let rounds: usize = args.next().map_or(Ok(15), |word| word.parse())?;
    let whole = Latent::load(&file)?;
    let all: Vec<_> = whole.lights.iter().copied().collect();
    let decoder = Model::pretrained().decoder()?;
    let cases: [(usize, usize); 5] = [(0, 0), (1, 0), (4, 0), (1, 16), (1, 38)];
    let mut fields = Vec::new();
    for (lights, lobes) in cases {
        let (Some(lights), Some(lobes)) = (all.get(..lights), whole.lobes.get(..lobes)) else {
            return Err(format!("{file}: {} lights and {} lobes", all.len(), whole.lobes.len()).into());
        };
        let lights = Lights::new(lights.first().copied(), lights.iter().skip(1).copied());
        fields.push(decoder.condition(&Latent { lights, lobes: lobes.to_vec(), ..whole.clone() })?);
    }
    for grid in [Equirect::new(128, 64), Equirect::new(1024, 512)] {
        let repeats = (1 << 19) / grid.len();
        let mut seconds = vec![Vec::new(); cases.len()];
        for round in 0..=rounds {
            for (field, seconds) in fields.iter().zip(&mut seconds) {
                let begin = Instant::now();
                for _ in 0..repeats {
                    std::hint::black_box(field.bake(grid));
                }
                // the first warms up
                if round > 0 {
                    seconds.push(begin.elapsed().as_secs_f64() / repeats as f64);
                }
            }
        }
        for seconds in &mut seconds {
            seconds.sort_by(f64::total_cmp);
        }
        for ((lights, lobes), sorted) in cases.iter().zip(&seconds) {
            // the least is what others on the machine disturb least
            let ratio = |k: usize| sorted[k] / seconds[0][k];
            println!(
                "{} × {}: {lights} lights, {lobes} lobes: {:.2} ms, {:.3} times (median {:.3})",
                grid.width,
                grid.height,
                1e3 * sorted[0],
                ratio(0),
                ratio(rounds / 2)
            );
        }
    }
    Ok(())
}

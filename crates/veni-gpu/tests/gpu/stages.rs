//! Stage by stage against the twin: where a cross-check of the whole network only says that something is wrong.

use veni_gpu::shader::twin::{direction_of, listed, veni_encode};
use veni_gpu::shader::{ENTRY_POINT, Grid, Kernel, Variant};
use veni_light::sphere::Frame;

use crate::kernels::{TILED, Work, list_variant};
use crate::util::{directions, filler, latent, plain};

/// The kernel's text with another entry point, which runs `body` instead and writes features of each direction, a row of
/// columns each.
fn staged(variant: &Variant, body: &str) -> String {
    let source = variant.source();
    let renamed = source.replace(&format!("fn {ENTRY_POINT}("), "fn veni_unused(");
    assert_ne!(source, renamed);
    format!(
        "{}
@compute @workgroup_size(VENI_THREADS)
fn {ENTRY_POINT}(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) index: u32) {{
    let first = group.x * VENI_TILE;
    for (var i = index; i < VENI_TILE; i += threads()) {{
        tile_directions[i] = vec4f(direction_of(min(first + i, request.count - 1u)), 0.0);
    }}
    workgroupBarrier();
    if request.count > 4000000000u {{
        // never: keeps the bindings of stages that do not run
        target_buffer[0] = directions[0] + veni_matrices[0] + veni_vectors[0];
    }}
    let role = role_of(index);
    let latent = veni_latent(0u);
    var x = broadcast(veni_latents[latent + role.group], veni_latents[latent + VENI_GROUPS + role.group]);
    {body}
    for (var i = 0u; i < 8u; i++) {{
        let quad = role.block + select(0u, VENI_QUADS / 2u, i >= 4u);
        let at = first + 4u * quad + (i & 3u);
        if at < request.count {{
            target_buffer[at * VENI_COLUMNS + role.group] = x[i];
            target_buffer[at * VENI_COLUMNS + VENI_GROUPS + role.group] = x[i + 8u];
        }}
    }}
}}
",
        renamed.replacen(
            "@compute @workgroup_size(VENI_THREADS)\n",
            "@compute @workgroup_size(VENI_THREADS) ",
            1
        )
    )
}

/// Largest difference between the kernel's features after `body` and the twin's after `stages`.
fn off(work: &Work, body: &str, stages: impl Fn(&Work, [f32; 3]) -> Vec<f64>) -> Option<f64> {
    let gpu = plain()?;
    let variant = list_variant(work.twin.sizes, TILED);
    let columns = work.twin.sizes.columns();
    let found = work.run(&gpu, &variant, &staged(&variant, body), work.directions.len() * columns);
    let rows = found.chunks_exact(columns).zip(&work.directions);
    let worst = rows.map(|(row, d)| {
        let expected = stages(work, listed(&work.request, *d));
        let row = row.as_flattened();
        assert!(row[expected.len()..].iter().all(|v| *v == 0.0), "padding is not zero");
        row.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
    });
    Some(worst.fold(0.0, f64::max))
}

#[test]
fn tiles() {
    for (n, hidden, layers) in [(9, 128, 2), (3, 20, 2)] {
        let work = Work::new(&filler(n, hidden, layers), &[latent(n, 3)], directions(70));
        let project = |work: &Work, d: [f32; 3]| work.twin.project(0, d);
        let Some(first) = off(&work, "project(latent, index, &x);", project) else { return };
        assert!(first < 2e-5, "project: {first:e}");
        let normalise = |work: &Work, d: [f32; 3]| {
            let mut x = work.twin.project(0, d);
            let gamma = work.twin.vectors[..hidden].to_vec();
            work.twin.normalise(&gamma, &mut x);
            x
        };
        let body = "project(latent, index, &x); normalise(veni_vector(0u, VENI_FIRST_GAMMA), index, &x);";
        let second = off(&work, body, normalise).unwrap();
        assert!(second < 2e-5, "normalise: {second:e}");
        let residual = |work: &Work, d: [f32; 3]| {
            let mut x = work.twin.project(0, d);
            work.twin.residual_layer(0, 0, &mut x);
            x
        };
        let body = "project(latent, index, &x); residual_layer(latent, 0u, index, &x);";
        let third = off(&work, body, residual).unwrap();
        assert!(third < 5e-5, "residual_layer: {third:e}");
        // and what is not the same stage is far off
        assert!(off(&work, "project(latent, index, &x);", residual).unwrap() > 1e-2);
    }
}

/// The entry point of kernel "each" with its last line replaced by one that writes what `expression` gives for direction `index`.
pub(crate) fn each(work: &Work, grid: bool, expression: &str) -> Option<Vec<[f32; 4]>> {
    each_changed(work, grid, expression, &|source| source)
}

pub(crate) fn each_changed(
    work: &Work,
    grid: bool,
    expression: &str,
    change: &dyn Fn(String) -> String,
) -> Option<Vec<[f32; 4]>> {
    let gpu = plain()?;
    let mut variant = list_variant(work.twin.sizes, Kernel::Each);
    if grid {
        variant.directions = veni_gpu::shader::Directions::Grid;
    }
    let source = change(variant.source());
    let from = "store(group.z, index, stored(veni_log_radiance_of(latent, direction), lights));";
    assert!(source.contains(from));
    let sixth = if grid { "bitcast<vec4f>(gains[0])" } else { "directions[0]" };
    let keep = format!(
        "if request.count > 4000000000u {{ target_buffer[0] = {sixth} + veni_matrices[0] + veni_vectors[0] \
         + veni_latents[0]; }}"
    );
    let to = format!("{keep} target_buffer[index] = {expression};");
    Some(work.run(&gpu, &variant, &source.replace(from, &to), work.request.count as usize))
}

#[test]
fn directions_of_grids() {
    for grid in [Grid::Equirect { width: 40, height: 20 }, Grid::Cube { size: 9 }] {
        let mut work = Work::new(&filler(1, 8, 1), &[latent(1, 3)], vec![[0.0; 3]]);
        work.request.grid = grid;
        work.request.count = grid.directions() as u32;
        let Some(found) = each(&work, true, "vec4f(direction, 0.0)") else { return };
        for (i, [x, y, z, _]) in (0..).zip(found) {
            let expected = direction_of(&work.request, i);
            let off = [x, y, z].iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 3e-7, "{grid:?}, {i}: {:?} is not {expected:?}", [x, y, z]);
        }
    }
}

/// Largest errors of the phases and of the value of directional input `index`, for a latent of thousands. `change`
/// is applied to the kernel's text.
fn feature_error(index: usize, change: impl Fn(String) -> String) -> Option<[f64; 2]> {
    let mut large = latent(5, 3);
    large.vectors[1] = [4000.0, -7000.0, 0.0];
    let mut work = Work::new(&filler(5, 8, 1), &[large], directions(200));
    // directions as they are: to round one in its last bit would shift the phase by itself
    (work.request.frame, work.request.rotation) = (Frame::Blender, 0.0);
    let call = format!("veni_encode(veni_latent(0u), {index}u, direction)");
    let phases = format!("vec4f({call}.sin_once, {call}.sin_fourfold, {call}.cos_once, {call}.cos_fourfold)");
    let phases = each_changed(&work, false, &phases, &change)?;
    let values = each_changed(&work, false, &format!("vec4f({call}.value)"), &change)?;
    let mut worst = [0.0f64; 2];
    for ((phase, value), d) in phases.iter().zip(values).zip(&work.directions) {
        let expected = veni_encode(&work.twin, 0, index, *d);
        for (found, expected) in phase.iter().zip(expected) {
            worst[0] = worst[0].max((f64::from(*found) - expected).abs());
        }
        worst[1] = worst[1].max((f64::from(value[0]) - expected[4]).abs());
    }
    Some(worst)
}

#[test]
fn features() {
    for index in 0..7 {
        let Some([phase, value]) = feature_error(index, |source| source) else { return };
        // the value is an f32 of the latent's size; its phase does not lose what that rounds away, but is itself an f32
        // near 1/2 that is rounded in two sums and magnified by 8π
        let size = if index == 1 { 8000.0 } else { 5.0 };
        assert!(
            phase < 2e-6 && value < 2e-7 * size,
            "input {index}: phases off by {phase:e}, value by {value:e}"
        );
    }
}

/// The rounded inner product in place of its exact phase: seen for the latent of thousands, not for small ones.
#[test]
fn phases_that_are_not_reduced_are_seen() {
    let (from, to) = ("turns = fractions.x + fractions.y", "turns = value");
    let change = |source: String| {
        assert!(source.contains(from));
        source.replace(from, to)
    };
    let Some([small, _]) = feature_error(0, change) else { return };
    let [large, _] = feature_error(1, change).unwrap();
    assert!(small < 1e-5 && large > 1e-3, "{small:e} and {large:e}");
}
